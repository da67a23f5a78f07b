"""A commit that survives, in its new place: other numbers and another hash, all else as it was."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator

import numpy as np

from semmap_log.domain.events import Retracted, SightingsThinned
from semmap_log.messages import fixed_layout, layout
from semmap_log.store.chunks import BuiltChunk, build_chunk
from semmap_log.store.commit_records import commit_hash
from semmap_log.store.form import (
    CHUNK_BYTES,
    COMMIT_CHANNEL,
    HASH_BYTES,
    NO_HASH,
    NOTE_CHANNEL,
    TOMBSTONE_CHANNEL,
)
from semmap_log.store.records import MESSAGE, message
from semmap_log.store.salvage.renumbering import Renumbering
from semmap_log.store.verification import WholeCommit
from semmap_log.store.verification.hash_chain import SEQUENCE_RANGE


class Rewriter:
    """Gives commits their new numbers and chains them anew; records keep their bytes otherwise.

    Where nothing was lost before a commit, it comes out byte for byte as it was, hash included. A
    retraction of events that are all lost is dropped; in a commit with more events the records
    behind it come a nanosecond earlier, since within a commit no nanosecond is left out.
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

    def begin_behind(self, next_event: int, head: bytes, last_ns: int) -> None:
        """Go on behind commits that are taken over as they are.

        Args:
            next_event: Number of the first event behind them.
            head: The hash of the last.
            last_ns: Log time of the last record.
        """
        self.numbers.keep_all_below(next_event)
        self.head, self.last_ns = head, last_ns

    def rewrite(self, whole: WholeCommit) -> list[bytes]:
        """Return the records of a commit in its new place; none if no event of it is left."""
        commit, first = whole.commit, self.numbers.next_event
        durable_before = min(self.numbers.below(commit.durable_before), first)
        time, records = commit.recorded_ns, list[bytes]()
        for channel, old, record in _records_of(whole):
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
        count = self.numbers.next_event - first
        if not count:
            return []
        data = layout("Commit").pack(
            first,
            durable_before,
            count,
            commit.durability,
            commit.command_id,
            commit.content,
            commit.wall_clock_ns,
            commit.monotonic_clock_ns,
            commit.boot_id,
            self.head,
            NO_HASH,
        )
        record = message(COMMIT_CHANNEL, first + count - 1, time, time, data)
        self.head = commit_hash(record, _digests(records))
        self.last_ns = time
        return [*records, record[:-HASH_BYTES] + self.head]

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


def chunks_of(records: list[bytes]) -> Iterator[BuiltChunk]:
    """Yield the chunks of a commit's records, each of about a MiB."""
    part: list[bytes] = []
    size = 0
    for record in records:
        if size >= CHUNK_BYTES:
            yield _chunk(part)
            part, size = [], 0
        part.append(record)
        size += len(record)
    yield _chunk(part)


def _chunk(records: list[bytes]) -> BuiltChunk:
    sizes = np.array([0, *(len(record) for record in records[:-1])], np.int64)
    return build_chunk(b"".join(records), np.cumsum(sizes))


def _records_of(whole: WholeCommit) -> Iterator[tuple[int, int, bytes | memoryview]]:
    """Yield (channel, event number, record); what stands for records that are gone is left out."""
    first = whole.commit.first_event
    for part in whole.parts:
        for channel, sequence, _, _, start, end in part.piece.messages[part.first : part.last]:
            if channel != TOMBSTONE_CHANNEL:
                number = first + (sequence - first) % SEQUENCE_RANGE
                yield channel, number, part.piece.records[start:end]


def _digests(records: list[bytes]) -> dict[int, bytes]:
    """Return, for each channel, the sha256 of its records in order."""
    digests: dict[int, hashlib._Hash] = {}
    for record in records:
        (channel,) = struct.unpack_from("<H", record, 9)
        digests.setdefault(channel, hashlib.sha256()).update(record)
    return {channel: digest.digest() for channel, digest in digests.items()}
