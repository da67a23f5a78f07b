"""A commit split at the keyframe within it: repairs what an earlier version's `retain` broke.

Up to version 0.1.0 `retain --keep` could take a keyframe between the chunks of one commit for the
horizon. The events before it went, and no reader found the keyframe's place any more. Here that
commit becomes two: one of what is gone, which ends at the keyframe, and one of what is left. The
commits after it are chained to these; every event keeps its number.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from semmap_log.core.messages import layout
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.commit_records import commit_hash
from semmap_log.store.form import (
    CHUNK_BYTES,
    COMMIT_CHANNEL,
    HASH_BYTES,
    KEYFRAME_CHANNEL,
    NO_HASH,
    NOTE_CHANNEL,
    TOMBSTONE_CHANNEL,
)
from semmap_log.store.header import TrimReason
from semmap_log.store.reading.segment_reading import commit_of, page_at
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.tombstone import Tombstone, read_tombstone
from semmap_log.store.trimming.records_left import SEQUENCE_RANGE, KeptRecords


class SplitSegment:
    """A first segment whose horizon lies within a commit, as it is once that is two commits."""

    def __init__(self, segment: Segment, horizon: int) -> None:
        """Find the commit.

        Raises:
            CorruptLogError: None holds the event at the horizon.
        """
        whole = commit_of(segment, horizon)
        if whole is None or whole.first_event >= horizon:
            raise CorruptLogError(segment.path, None, f"no commit reaches across event {horizon}")
        self._whole = whole
        self._segment = segment
        self._horizon = horizon
        self._head = segment.header.hash_so_far
        self._last_ns = -1
        self._next_event = segment.header.first_event
        self._records: list[tuple[int, bytes]] = []
        """Channel and bytes of the records of the commit under way."""
        self._lacks: Tombstone | None = None
        self._delay_ns = 0
        self._is_split = False
        self._kept: list[bytes] = []
        self._size = 0
        self._ready: list[KeptRecords] = []

    def parts(self) -> Iterator[KeptRecords]:
        """Yield its records, in parts of about a chunk, keyframes by themselves.

        Raises:
            CorruptLogError: The keyframe of the horizon is not there, or a chunk is damaged.
        """
        for chunk in range(len(self._segment.chunks)):
            page = page_at(self._segment, chunk)
            for i, channel in enumerate(page.heads["channel_id"].tolist()):
                self._take(channel, bytes(page.record(i)))
            ready, self._ready = self._ready, []
            yield from ready
        self._flush()
        yield from self._ready
        if not self._is_split:
            problem = f"the keyframe before event {self._horizon}, its horizon, is not there"
            raise CorruptLogError(self._segment.path, None, problem)

    def _take(self, channel: int, record: bytes) -> None:
        if channel == KEYFRAME_CHANNEL:
            self._keyframe(record)
        elif channel == TOMBSTONE_CHANNEL:
            found = read_tombstone(record, self._segment.path)
            if found.commits:
                self._gone(found, _time_of(record))
            else:
                self._lacks = found
        elif channel == COMMIT_CHANNEL:
            self._close(record)
        else:
            self._add(channel, record)

    def _keyframe(self, record: bytes) -> None:
        sequence = mcap.MESSAGE.unpack_from(record)[3]
        if sequence == (self._horizon - 1) % SEQUENCE_RANGE:
            self._end_of_gone()
        elif sequence != (self._next_event - 1) % SEQUENCE_RANGE:
            return  # within a commit, and not needed
        self._flush()
        self._last_ns = max(self._last_ns, _time_of(record))
        self._put(_at(record, self._last_ns))
        self._flush()

    def _add(self, channel: int, record: bytes) -> None:
        time_ns = _time_of(record)
        if not self._records:
            self._delay_ns = max(0, self._last_ns + 1 - time_ns)
        self._last_ns = time_ns + self._delay_ns
        self._records.append((channel, _at(record, self._last_ns)))

    def _gone(self, tombstone: Tombstone, time_ns: int) -> None:
        """Put what stands for whole commits that are gone."""
        self._last_ns = max(self._last_ns, time_ns)
        self._put(replace(tombstone, previous_hash=self._head).record(self._last_ns))
        self._head, self._next_event = tombstone.hash, tombstone.next_event

    def _end_of_gone(self) -> None:
        """Put the first of the two commits: what is left before the keyframe."""
        first, kept = self._whole.first_event, len(self._records)
        count = self._horizon - first
        reasons = TrimReason.EXPIRED
        time_ns = self._whole.recorded_ns + count
        lacks = Tombstone(first, count, 0, count - kept, 0, reasons)
        if kept:
            self._lacks, self._delay_ns = lacks, 0
            command = hashlib.sha256(self._whole.command_id).digest()[:16]
            self._commit(first, count, time_ns, {"command_id": command})
        else:
            its_hash = hashlib.sha256(self._whole.hash).digest()
            whole = replace(lacks, commits=1, previous_hash=self._head, hash=its_hash)
            self._gone(whole, time_ns)
        self._is_split = True

    def _close(self, record: bytes) -> None:
        """Put a commit whose Commit record has come."""
        fields = layout("Commit").unpack(record, mcap.MESSAGE.size)
        first, count = fields["first_event"], fields["count"]
        if self._is_split and first == self._whole.first_event:
            last = first + count
            first, count = self._horizon, last - self._horizon
            kept = sum(channel != NOTE_CHANNEL for channel, _ in self._records)
            lacks = self._lacks
            self._lacks = None
            if lacks is not None and (kept < count or lacks.notes_gone):
                self._lacks = Tombstone(
                    first, count, 0, count - kept, lacks.notes_gone, lacks.reasons
                )
        self._commit(first, count, _time_of(record) + self._delay_ns, fields)

    def _commit(self, first: int, count: int, time_ns: int, changed: dict[str, Any]) -> None:
        """Put the records of a commit, chained to the one before."""
        whole = self._whole
        fields: dict[str, Any] = {
            "durability": whole.durability,
            "command_id": whole.command_id,
            "content": whole.content,
            "wall_clock_ns": whole.wall_clock_ns,
            "monotonic_clock_ns": whole.monotonic_clock_ns,
            "boot_id": whole.boot_id,
            "durable_before": whole.durable_before,
        }
        fields |= changed
        fields |= {"first_event": first, "count": count, "previous_hash": self._head}
        fields |= {"durable_before": min(fields["durable_before"], first), "hash": NO_HASH}
        time_ns = max(time_ns, self._last_ns + 1)
        names = layout("Commit").dtype.names or ()
        data = layout("Commit").pack(*(fields[n] for n in names if not n.startswith("_")))
        record = mcap.message(COMMIT_CHANNEL, first + count - 1, time_ns, time_ns, data)
        self._head = commit_hash(record, self._digests())
        note = [one for channel, one in self._records if channel == NOTE_CHANNEL]
        events = [one for channel, one in self._records if channel != NOTE_CHANNEL]
        lacks = [] if self._lacks is None else [self._lacks.record(time_ns - 1 - len(note))]
        self._put(*events, *lacks, *note, record[:-HASH_BYTES] + self._head)
        self._last_ns, self._next_event = time_ns, first + count
        self._records, self._lacks, self._delay_ns = [], None, 0
        if self._size >= CHUNK_BYTES:
            self._flush()

    def _put(self, *records: bytes) -> None:
        self._kept += records
        self._size += sum(map(len, records))

    def _flush(self) -> None:
        if self._kept:
            self._ready.append(KeptRecords(b"".join(self._kept), self._next_event))
            self._kept, self._size = [], 0

    def _digests(self) -> dict[int, bytes]:
        """Return the SHA-256 of each channel's records, of lost ones as the tombstone has it."""
        found: dict[int, Any] = {}
        for channel, record in self._records:
            found.setdefault(channel, hashlib.sha256()).update(record)
        digests = {channel: digest.digest() for channel, digest in found.items()}
        lost = () if self._lacks is None else self._lacks.parts
        return digests | {part.channel: part.digest for part in lost}


def _at(record: bytes, time_ns: int) -> bytes:
    """Return a Message record with another log time; a Keyframe's happened time is the same."""
    opcode, length, channel, sequence, log_ns, publish_ns = mcap.MESSAGE.unpack_from(record)
    if log_ns == time_ns:
        return record
    publish_ns = time_ns if publish_ns == log_ns else publish_ns
    head = mcap.MESSAGE.pack(opcode, length, channel, sequence, time_ns, publish_ns)
    return head + record[mcap.MESSAGE.size :]


def _time_of(record: bytes) -> int:
    time_ns: int = mcap.MESSAGE.unpack_from(record)[4]
    return time_ns
