"""A commit has the bytes of the format page, however its events are given; rewritten, too."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.batches.columnar_events import ColumnarEvents
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_index import SIGHTINGS
from semmap_log.core.messages import encode, layout, type_name, write_message
from semmap_log.core.model.commits import Commit, Durability, Note
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAnnotated, DoorObserved, Event, FloorMap
from semmap_log.errors import CommandError
from semmap_log.store import commit_records
from semmap_log.store.chunk_builder import kept_template
from semmap_log.store.chunks import BuiltChunk, build_chunk
from semmap_log.store.commit_records import CommitBuilder, Stamp, closing_record
from semmap_log.store.record_runs import FEW, MOST
from semmap_log.store.records import message
from tests.strategies import events, fixed_size

hashes = st.binary(min_size=32, max_size=32)
ids = st.binary(min_size=16, max_size=16)
times = st.integers(1, 2**62)
SALT = bytes(range(16))
NO_NOTE, NOTE = Note(), Note(actor="me", reason="a reason", salt=SALT)

stamps = st.builds(
    Stamp,
    first_event=st.integers(0, 2**40) | st.just(2**32 - 3),
    recorded_ns=times,
    previous_hash=hashes,
    command_id=ids,
    wall_clock_ns=times,
    monotonic_clock_ns=times,
    boot_id=ids,
    durability=st.sampled_from(Durability),
    durable_before=st.integers(0, 2**40),
    content=ids,
)


def plain_commit(
    stamp: Stamp, note: Note, given_events: Sequence[Event], chunk_bytes: int = 2**20
) -> tuple[list[BuiltChunk], bytes]:
    """Return a commit's chunks and its hash, each record made by itself, as the page says."""
    records, time, number = [], stamp.recorded_ns, stamp.first_event
    for event in given_events:
        happened = stamp.wall_clock_ns if event.happened_ns is None else event.happened_ns
        channel = 100 + event.level if isinstance(event, FloorMap) else event.kind
        records.append((channel, message(channel, number, time, happened, encode(event, happened))))
        time, number = time + 1, number + 1
    if note:
        said = {
            "salt": note.salt,
            "actor": note.actor,
            "source": note.source,
            "reason": note.reason,
            "correlation": note.correlation,
        }
        data = write_message(type_name("CommitNote"), said)
        records.append((91, message(91, number - 1, time, time, data)))
        time += 1
    fields = {
        "first_event": stamp.first_event,
        "durable_before": stamp.durable_before,
        "count": len(given_events),
        "durability": int(stamp.durability),
        "command_id": stamp.command_id,
        "content": stamp.content,
        "wall_clock_ns": stamp.wall_clock_ns,
        "monotonic_clock_ns": stamp.monotonic_clock_ns,
        "boot_id": stamp.boot_id,
        "previous_hash": stamp.previous_hash,
        "hash": bytes(32),
    }
    blank = message(90, number - 1, time, time, layout("Commit").pack(*fields.values()))
    whole = hashlib.sha256(blank[:-32])
    for channel in sorted({channel for channel, _ in records}):
        of_channel = b"".join(record for its, record in records if its == channel)
        whole.update(struct.pack("<H", channel) + hashlib.sha256(of_channel).digest())
    chunks: list[list[bytes]] = [[]]
    size = 0
    for channel, record in records:
        if channel != 91 and size >= chunk_bytes:
            chunks.append([])
            size = 0
        chunks[-1].append(record)
        size += len(record)
    chunks[-1].append(blank[:-32] + whole.digest())
    return [_chunk(of_chunk) for of_chunk in chunks], whole.digest()


def _chunk(records: Sequence[bytes]) -> BuiltChunk:
    sizes = np.array([*map(len, records)])
    return build_chunk(b"".join(records), np.cumsum(sizes) - sizes)


def built(stamp: Stamp, note: Note, given_events: object) -> tuple[list[BuiltChunk], Commit]:
    builder = CommitBuilder(stamp, note, bytes)
    chunks = list(builder.chunks(given_events))  # type: ignore[arg-type]
    return chunks, builder.commit


def check(stamp: Stamp, note: Note, given_events: list[Event]) -> None:
    """Check a commit of events as a list, one after the other, and as columns."""
    given_events = [
        replace(event, salt=SALT) if isinstance(event, DoorAnnotated) else event
        for event in given_events
    ]
    expected, its_hash = plain_commit(stamp, note, given_events)
    ways: list[object] = [
        given_events,
        iter(given_events),
        [EventBatch.from_events(given_events)],
        [EventBatch.from_events([event]) for event in given_events[:40]] + given_events[40:],
    ]
    if {type(event) for event in given_events} <= set(SIGHTINGS):
        ways.append(ColumnarEvents(given_events, {type(event) for event in given_events}))  # type: ignore[arg-type]
    for way in ways:
        chunks, commit = built(stamp, note, way)
        assert (chunks, commit.hash) == (expected, its_hash)
        for chunk in chunks:
            _check_places(chunk)
    again = Stamp.of(commit, stamp.first_event, stamp.previous_hash, stamp.durable_before)
    _check_written_again(again, commit, expected)


def _check_places(chunk: BuiltChunk) -> None:
    """Check what a chunk's builder says of where records begin."""
    if chunk.offsets is not None:
        assert build_chunk(chunk.records, chunk.offsets) == chunk
    if chunk.commit_at >= 0:
        assert chunk.records[chunk.commit_at + 9] == 90


def _check_written_again(stamp: Stamp, commit: Commit, expected: Sequence[BuiltChunk]) -> None:
    """Check the Commit record of a log that is recovered, whose commits are chained again."""
    digests: dict[int, hashlib._Hash] = {}
    records = b"".join(chunk.records for chunk in expected)
    while records:
        size = 9 + int.from_bytes(records[1:9], "little")
        one, records = records[:size], records[size:]
        digests.setdefault(int.from_bytes(one[9:11], "little"), hashlib.sha256()).update(one)
    digests.pop(90)
    found = {channel: digest.digest() for channel, digest in digests.items()}
    record, its_hash = closing_record(stamp, commit.last_event + 1, commit.closed_ns, found)
    assert (record, its_hash) == (one, commit.hash)


@pytest.mark.slow
@settings(deadline=None, max_examples=30)
@given(
    stamps,
    st.sampled_from([NO_NOTE, NOTE]),
    fixed_size,
    st.sampled_from([1, 2, FEW, FEW + 1, 40, MOST, MOST + 1]),
    st.data(),
)
def test_events_of_one_kind(
    stamp: Stamp, note: Note, first: Event, count: int, data: st.DataObject
) -> None:
    """
    Few, many, and so many that their chunk is compressed.
    """
    drawn = data.draw(st.lists(st.none() | times, min_size=1, max_size=min(count, 40)))
    check(stamp, note, [replace(first, happened_ns=drawn[i % len(drawn)]) for i in range(count)])


@settings(deadline=None)
@given(stamps, st.sampled_from([NO_NOTE, NOTE]), st.lists(events, min_size=1, max_size=4))
def test_events_of_any_kinds(stamp: Stamp, note: Note, given_events: list[Event]) -> None:
    """
    Also with texts and floor maps.
    """
    check(stamp, note, given_events)


@settings(deadline=None)
@given(stamps, st.lists(fixed_size, min_size=1, max_size=3 * FEW))
def test_events_of_many_kinds_of_fixed_sizes(stamp: Stamp, given_events: list[Event]) -> None:
    """
    Mixed as they come.
    """
    check(stamp, NO_NOTE, given_events)


@settings(deadline=None)
@given(stamps, st.lists(events, min_size=5, max_size=20), st.integers(100, 900))
def test_long_commits_are_split(stamp: Stamp, given_events: list[Event], most: int) -> None:
    """
    A chunk takes one more as long as it has any room; note and Commit stand in the last.
    """
    given_events = [
        replace(event, salt=SALT) if isinstance(event, DoorAnnotated) else event
        for event in given_events
    ]
    expected, its_hash = plain_commit(stamp, NOTE, given_events, most)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(commit_records, "CHUNK_BYTES", most)
        for way in (given_events, [EventBatch.from_events(given_events)]):
            chunks, commit = built(stamp, NOTE, way)
            assert (chunks, commit.hash) == (expected, its_hash)


def test_a_commit_wants_an_event() -> None:
    """
    Of a generator that is only known once it has ended.
    """
    stamp = Stamp(0, 1, bytes(32), bytes(16), 1, 1, bytes(16))
    with pytest.raises(CommandError, match="at least one event"):
        built(stamp, NOTE, iter(()))


@pytest.mark.parametrize("note", [NO_NOTE, NOTE])
@pytest.mark.parametrize("as_columns", [False, True])
def test_the_template_of_a_chunk_is_made_once(note: Note, as_columns: bool) -> None:
    """
    A commit like one before, with other values: of events, of columns, with a note as long.
    """
    stamp = Stamp(0, 1, bytes(32), bytes(16), 1, 1, bytes(16))
    seen = [DoorObserved(door_id=DoorId(i), state=DoorState.OPEN) for i in range(20)]
    before = kept_template.cache_info().misses

    for some in (seen, seen[::-1], seen):
        built(stamp, note, [EventBatch.from_events(some)] if as_columns else some)

    assert kept_template.cache_info().misses <= before + 1
