"""The command index of a segment: shows a writer whether a command is already stored.

Closing a segment writes it after `semmap_index`, as the MCAP Attachment `semmap_commands`: for
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

from semmap_log.core.messages import layout
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import COMMAND_ATTACHMENT, COMMIT_CHANNEL, TOMBSTONE_CHANNEL
from semmap_log.store.chunks import BuiltChunk

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
        command_ids: All command ids, concatenated.
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

    It sees every append, so it cuts these bytes out of the record and decodes nothing.
    """

    def __init__(self, head: bytes) -> None:
        """Begin.

        Args:
            head: Hash of the commit before the segment's first.
        """
        self._kept = bytearray()
        self._first, self._end, self._hash, self._size = _places()
        self._length = self._end - self._first
        self._last, self._last_at = head, -self._hash
        """What holds the last Commit record, and where."""

    def __len__(self) -> int:
        """How many there are."""
        return len(self._kept) // self._length

    @property
    def head(self) -> bytes:
        """Hash of the last commit."""
        return self._last[self._last_at + self._hash : self._last_at + self._size]

    def add(self, chunk: BuiltChunk) -> None:
        """Take in the commits whose Commit record is in a chunk."""
        at = chunk.commit_at
        if at >= 0:
            self._add(chunk.records, at)
        elif COMMIT_CHANNEL in chunk.facts.counts:
            for at in _places_in(chunk, COMMIT_CHANNEL):
                self._add(chunk.records, at)
        if TOMBSTONE_CHANNEL in chunk.facts.counts:
            self._take_gone(chunk)

    def _take_gone(self, chunk: BuiltChunk) -> None:
        """Take in the hash of commits that are gone, where no other follows them in a chunk."""
        from semmap_log.store.gone_commands import Tombstone

        at = max(_places_in(chunk, TOMBSTONE_CHANNEL))
        end = at + mcap.FRAME.size + mcap.FRAME.unpack_from(chunk.records, at)[1]
        last = Tombstone.in_record(chunk.records[at:end])
        if last.commits and at > max(_places_in(chunk, COMMIT_CHANNEL), default=-1):
            self._last, self._last_at = last.hash, -self._hash

    def _add(self, records: bytes, at: int) -> None:
        self._kept += records[at + self._first : at + self._end]
        self._last, self._last_at = records, at

    def command_ids(self) -> list[bytes]:
        """Return the command id of each commit, in order."""
        kept, size = self._kept, self._length
        ends = range(size, len(kept) + 1, size)
        return [bytes(kept[end - COMMAND_ID_BYTES : end]) for end in ends]

    def first_event(self, place: int) -> int:
        """Return the number of the first event of a commit, by its place among them."""
        at = place * self._length
        return int.from_bytes(self._kept[at : at + 8], "little")

    def rows(self, segment_first: int) -> NDArray[np.uint64]:
        """Return their command index.

        Args:
            segment_first: Number of the segment's first event.
        """
        size = self._length
        dtype = np.dtype(
            {
                "names": ["first_event", "command_id"],
                "formats": ["<u8", ("u1", (COMMAND_ID_BYTES,))],
                "offsets": [0, size - COMMAND_ID_BYTES],
                "itemsize": size,
            }
        )
        kept = np.frombuffer(bytes(self._kept), dtype)
        return command_rows(kept["command_id"].tobytes(), kept["first_event"], segment_first)


def _places_in(chunk: BuiltChunk, wanted: int) -> Iterator[int]:
    """Yield where the messages of a channel begin in its records, as its MessageIndexes say."""
    counts, data = chunk.facts.counts, chunk.data
    end = len(data)
    for channel in reversed(counts):  # they end it, ids ascending
        size = counts[channel] * mcap.MESSAGE_INDEX_ENTRY_BYTES
        if channel == wanted:
            yield from (at for (at,) in _OFFSET.iter_unpack(data[end - size : end]))
        end -= mcap.MESSAGE_INDEX_HEAD_BYTES + size


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
