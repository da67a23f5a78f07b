"""A commit that survives, in its new place: other numbers and another hash, all else unchanged.

What was taken out on purpose stays out: its Tombstones are kept, and with them what answers its
commands when they are sent again. Event numbers of the damaged log are mapped to those of the log
that is made from what survives.
"""

from __future__ import annotations

import hashlib
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from semmap_log.core.messages import fixed_layout
from semmap_log.core.model.events import Retracted, SightingsThinned
from semmap_log.store.byte_layout import (
    CHUNK_BYTES,
    NO_HASH,
    NOTE_CHANNEL,
    TOMBSTONE_CHANNEL,
    kind_of_channel,
)
from semmap_log.store.chunks import BuiltChunk, build_chunk
from semmap_log.store.commit_records import Stamp, closing_record
from semmap_log.store.gone_commands import Tombstone
from semmap_log.store.records import MESSAGE, message
from semmap_log.store.verification import GoneCommits, ValidCommit
from semmap_log.store.verification.hash_chain import SEQUENCE_RANGE


class Rewriter:
    """Gives commits their new numbers and chains them again; records otherwise keep their bytes.

    Where nothing was lost before a commit, it comes out byte for byte as it was, hash included. A
    retraction of events that are all lost is dropped; in a commit with more events the records
    after it come a nanosecond earlier, since within a commit no nanosecond is left out.
    """

    def __init__(self) -> None:
        self.numbers = Renumbering()
        self.head = NO_HASH
        self.last_ns = -1
        """Log time of the last record."""
        self.dropped: list[int] = []
        """Old numbers of the retractions that were dropped."""
        self.has_moved = False
        """Whether an event has got another number."""
        self.has_changed = False
        """Whether a commit has got another hash, or was dropped."""

    def continue_after(self, next_event: int, head: bytes, last_ns: int) -> None:
        """Continue after commits that are taken over unchanged.

        Args:
            next_event: Number of the first event after them.
            head: The hash of the last.
            last_ns: Log time of the last record.
        """
        self.numbers.keep_all_below(next_event)
        self.head, self.last_ns = head, last_ns

    def rewrite(self, whole: ValidCommit) -> list[bytes]:
        """Return the records of a commit in its new place; none if no event of it is left."""
        commit, first = whole.commit, self.numbers.next_event
        durable_before = min(self.numbers.below(commit.durable_before), first)
        time, records, expected = commit.recorded_ns, list[bytes](), commit.first_event
        for channel, old, record in _records_of(whole):
            next_old = old if channel != NOTE_CHANNEL else old + 1
            self.numbers.keep(expected, next_old - expected)
            time += next_old - expected
            expected = old + 1
            body = self._body(channel, old, record)
            if body is None:
                self.dropped.append(old)
                continue
            is_event = channel != NOTE_CHANNEL
            number = self.numbers.keep(old) if is_event else self.numbers.next_event - 1
            self.has_moved |= is_event and number != old
            publish_ns = MESSAGE.unpack_from(record)[5] if is_event else time
            records.append(message(channel, number, time, publish_ns, body))
            time += 1
        at_end = commit.last_event + 1 - expected
        self.numbers.keep(expected, at_end)
        time += at_end
        count = self.numbers.next_event - first
        if not count:
            self.has_changed = True
            return []
        digests = _digests(records)
        if whole.lacks is not None:
            lacks = _of_what_is_left(replace(whole.lacks, first_event=first, count=count), digests)
            digests |= {part.channel: part.digest for part in lacks.parts}
            has_note = bool(records) and _channel_of(records[-1]) == NOTE_CHANNEL
            records.insert(len(records) - has_note, lacks.record(time - 1 - has_note))
        stamp = Stamp.of(commit, first, self.head, durable_before)
        record, self.head = closing_record(stamp, first + count, time, digests)
        self.has_changed |= self.head != commit.hash
        self.last_ns = time
        return [*records, record]

    def rewrite_gone(self, gone: GoneCommits) -> bytes:
        """Return the Tombstone of whole commits that were taken out, in its new place."""
        old, first, before = gone.tombstone, self.numbers.next_event, self.head
        self.numbers.keep(old.first_event, old.count)
        self.has_moved |= first != old.first_event
        self.head = old.hash
        if (first, before) != (old.first_event, old.previous_hash):
            self.has_changed = True
            self.head = hashlib.sha256(before + old.hash).digest()
        self.last_ns = max(self.last_ns, gone.time_ns)
        new = replace(old, first_event=first, previous_hash=before, hash=self.head)
        return new.record(self.last_ns)

    def _body(self, channel: int, old: int, record: bytes | memoryview) -> bytes | None:
        """Return a record's payload; of a retraction with the new numbers, None: all are lost."""
        body = bytes(record[MESSAGE.size :])
        if channel == SightingsThinned.kind and self.has_moved:
            said = fixed_layout(channel).unpack(body)
            known = self.numbers.range(said["first_event"], said["first_event"])
            said["first_event"] = known[0] if known else 0
            return fixed_layout(channel).pack(*said.values())
        if channel != Retracted.kind:
            return body
        said = fixed_layout(Retracted.kind).unpack(body)
        hidden = self.numbers.range(said["first_event"], min(said["last_event"], old - 1))
        return None if hidden is None else fixed_layout(Retracted.kind).pack(*hidden)


def _of_what_is_left(lacks: Tombstone, kept: dict[int, bytes]) -> Tombstone:
    """Return a Tombstone with the digests of the records that are left now."""
    parts = (replace(part, kept_digest=kept.get(part.channel, NO_HASH)) for part in lacks.parts)
    return replace(lacks, parts=tuple(parts))


def chunks_of(records: list[bytes], segment_first: int) -> Iterator[tuple[BuiltChunk, int]]:
    """Yield the chunks of a commit's records, each of about a MiB, and the next event's number.

    What is no event stands in one with the Commit: a Tombstone's place is found by it.

    Args:
        records: Its records; none if it was dropped.
        segment_first: Number of the first event of its segment.
    """
    part: list[bytes] = []
    size = 0
    for record in records:
        if size >= CHUNK_BYTES and kind_of_channel(_channel_of(record)) is not None:
            yield _chunk(part, segment_first)
            part, size = [], 0
        part.append(record)
        size += len(record)
    if part:
        yield _chunk(part, segment_first)


def _chunk(records: list[bytes], segment_first: int) -> tuple[BuiltChunk, int]:
    sizes = np.array([0, *(len(record) for record in records[:-1])], np.int64)
    behind = MESSAGE.unpack_from(records[-1])[3] + 1
    next_event = segment_first + (behind - segment_first) % SEQUENCE_RANGE
    return build_chunk(b"".join(records), np.cumsum(sizes)), next_event


def _records_of(whole: ValidCommit) -> Iterator[tuple[int, int, bytes | memoryview]]:
    """Yield (channel, event number, record); what stands for records that are gone is left out."""
    first = whole.commit.first_event
    for part in whole.parts:
        for channel, sequence, _, _, start, end in part.piece.messages[part.first : part.last]:
            if channel != TOMBSTONE_CHANNEL:
                number = first + (sequence - first) % SEQUENCE_RANGE
                yield channel, number, part.piece.records[start:end]


def _channel_of(record: bytes) -> int:
    return int.from_bytes(record[9:11], "little")


def _digests(records: list[bytes]) -> dict[int, bytes]:
    """Return, for each channel, the sha256 of its records in order."""
    digests: dict[int, hashlib._Hash] = {}
    for record in records:
        channel = _channel_of(record)
        digests.setdefault(channel, hashlib.sha256()).update(record)
    return {channel: digest.digest() for channel, digest in digests.items()}


class Renumbering:
    """Runs of events that survive; what was lost between them leaves no gap in the new numbers."""

    def __init__(self) -> None:
        self._old: list[int] = []
        """First old number of each run."""
        self._new: list[int] = []
        """Its new number."""
        self._counts: list[int] = []
        self.next_event = 0
        """The new number that comes next."""

    def keep_all_below(self, old: int) -> None:
        """Let all events below a number keep theirs, gaps included; to be called first."""
        self._old, self._new, self._counts = [0], [0], [old]
        self.next_event = old

    def keep(self, old: int, count: int = 1) -> int:
        """Return the new number of an event that survives; to be called in ascending order.

        Args:
            old: Its number.
            count: So many from it on survive, or were taken out on purpose and leave a gap.
        """
        new = self.next_event
        if self._old and old == self._old[-1] + self._counts[-1]:
            self._counts[-1] += count
        elif count:
            self._old.append(old)
            self._new.append(new)
            self._counts.append(count)
        self.next_event = new + count
        return new

    def below(self, old: int) -> int:
        """Return how many surviving events have a lower number: the new number, if it survives."""
        run = bisect_right(self._old, old) - 1
        if run < 0:
            return 0
        return self._new[run] + min(old - self._old[run], self._counts[run])

    def range(self, first: int, last: int) -> tuple[int, int] | None:
        """Return the new first and last number of those of a range that survive; None: none."""
        new_first, behind = self.below(first), self.below(last + 1)
        return (new_first, behind - 1) if behind > new_first else None
