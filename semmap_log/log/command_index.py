"""The command index of a segment: by it a writer tells whether a command is stored already.

Closing a segment writes it behind `semmap_index`, as the MCAP Attachment `semmap_commands`: for
each commit one little-endian uint64, ascending. The upper half is the fingerprint of the commit's
command id, the first four bytes of its sha256 as a little-endian number; the lower half is the
number of the commit's first event, counted from the segment's first. Two commands may share a
fingerprint: who finds one reads the commit that it points to.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import cache
from hashlib import sha256

import numpy as np
from mcap.records import Attachment
from numpy.typing import NDArray

from semmap_log.log import records as mcap
from semmap_log.log.chunks import BuiltChunk
from semmap_log.log.form import COMMAND_ATTACHMENT, COMMIT_CHANNEL
from semmap_log.messages import layout

COMMAND_ID_BYTES = 16
MEDIA_TYPE = "application/octet-stream"

_OFFSET = struct.Struct("<8xQ")
"""An entry of a MessageIndex: log time, offset."""


def fingerprint(command_id: bytes) -> int:
    """Return the 32 bits by which a command is looked up."""
    return int.from_bytes(sha256(command_id).digest()[:4], "little")


def command_rows(
    command_ids: bytes, first_events: NDArray[np.unsignedinteger], segment_first: int
) -> NDArray[np.uint64]:
    """Return the command index of these commits.

    Args:
        command_ids: All of them, one behind the other.
        first_events: Number of the first event of each commit.
        segment_first: Number of the segment's first event.
    """
    starts = range(0, len(command_ids), COMMAND_ID_BYTES)
    prints = [fingerprint(command_ids[at : at + COMMAND_ID_BYTES]) for at in starts]
    offsets = first_events.astype(np.uint64) - np.uint64(segment_first)
    rows: NDArray[np.uint64] = (np.array(prints, np.uint64) << np.uint64(32)) | offsets
    rows.sort()
    return rows


def attachment(rows: NDArray[np.uint64], end_ns: int) -> Attachment:
    """Return the MCAP record of a command index.

    Args:
        rows: The index.
        end_ns: The segment's last log time.
    """
    data = rows.astype("<u8").tobytes()
    return Attachment(
        create_time=end_ns,
        log_time=end_ns,
        name=COMMAND_ATTACHMENT,
        media_type=MEDIA_TYPE,
        data=data,
    )


class WrittenCommits:
    """What a segment's writer keeps of its commits: 37 bytes each, and the last hash.

    It is told of every append, so it cuts these bytes out of the record and decodes nothing.
    """

    def __init__(self, head: bytes) -> None:
        """Begin.

        Args:
            head: Hash of the commit before the segment's first.
        """
        self.head = head
        """Hash of the last commit."""
        self._kept = bytearray()
        self._first, self._end, self._hash, self._size = _places()

    def __len__(self) -> int:
        return len(self._kept) // _dtype().itemsize

    def add(self, chunk: BuiltChunk) -> None:
        """Take in the commits whose Commit record is in a chunk."""
        counts = chunk.facts.counts
        if COMMIT_CHANNEL not in counts:
            return
        records, data = chunk.records, chunk.data
        end = len(data)
        for channel in reversed(counts):  # the MessageIndexes end it, ids ascending
            size = counts[channel] * mcap.MESSAGE_INDEX_ENTRY_BYTES
            if channel == COMMIT_CHANNEL:
                break
            end -= mcap.MESSAGE_INDEX_HEAD_BYTES + size
        at = 0
        for entry in range(end - size, end, mcap.MESSAGE_INDEX_ENTRY_BYTES):
            (at,) = _OFFSET.unpack_from(data, entry)
            self._kept += records[at + self._first : at + self._end]
        self.head = records[at + self._hash : at + self._size]

    def since(self, count: int) -> Iterator[tuple[bytes, int]]:
        """Yield command id and first event of the commits behind the first `count`, in order."""
        kept = self._columns(count)
        ids = kept["command_id"].tobytes()
        for i, first_event in enumerate(kept["first_event"].tolist()):
            yield ids[i * COMMAND_ID_BYTES : (i + 1) * COMMAND_ID_BYTES], first_event

    def rows(self, segment_first: int) -> NDArray[np.uint64]:
        """Return their command index.

        Args:
            segment_first: Number of the segment's first event.
        """
        kept = self._columns(0)
        return command_rows(kept["command_id"].tobytes(), kept["first_event"], segment_first)

    def _columns(self, start: int) -> NDArray[np.void]:
        kept = bytes(self._kept[start * _dtype().itemsize :])
        return np.frombuffer(kept, _dtype())


@cache
def _places() -> tuple[int, int, int, int]:
    """Return where in a Commit record its kept bytes begin and end, its hash begins, it ends."""
    commit = layout("Commit").dtype
    assert commit.fields is not None
    head = mcap.MESSAGE.size
    return (
        head + commit.fields["first_event"][1],
        head + commit.fields["command_id"][1] + COMMAND_ID_BYTES,
        head + commit.fields["hash"][1],
        head + commit.itemsize,
    )


@cache
def _dtype() -> np.dtype[np.void]:
    first, end, *_ = _places()
    size = end - first
    return np.dtype(
        {
            "names": ["first_event", "command_id"],
            "formats": ["<u8", ("u1", (COMMAND_ID_BYTES,))],
            "offsets": [0, size - COMMAND_ID_BYTES],
            "itemsize": size,
        }
    )
