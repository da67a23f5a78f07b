"""The door map at a moment: from keyframes, and without them, it is the same, byte for byte."""

from __future__ import annotations

import random
import shutil
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    Event,
    LevelAdded,
    Retracted,
)
from semmap_log.errors import CorruptLogError, KeyframeWarning, LogError
from semmap_log.log.replay import keyframes, state, written_state
from semmap_log.log.replay.keyframes import encode
from semmap_log.log.replay.state import state_at
from semmap_log.store import commit_records as commits
from semmap_log.store.byte_layout import CHUNK_BYTES, KEYFRAME_EVERY_BYTES
from semmap_log.store.chunks import StoredChunk
from semmap_log.store.compaction import compact, merge
from semmap_log.store.pages import KEYFRAME_BIT
from semmap_log.store.reading import segment_reading
from semmap_log.store.reading.chunk_table import ChunkTable
from semmap_log.store.reading.reader import BEGINNING, ChunkPlace, LogReader
from semmap_log.store.writing import segment_chain
from tests.conftest import SteadyClock
from tests.core.folds.dictionary_model import model
from tests.test_replay import expected, plain, random_log

START_NS = 1_772_400_000 * 10**9


@contextmanager
def tiny_steps() -> Iterator[None]:
    """Segments of a few commits, chunks of a few events, a keyframe for every few chunks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(written_state, "KEYFRAME_EVERY_BYTES", 700)
        patch.setattr(written_state, "KEYFRAME_RARITY", 0)
        patch.setattr(commits, "CHUNK_BYTES", 300)
        patch.setattr(segment_chain, "ROLL_COMMITS", 11)
        patch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 20_000)
        patch.setattr(merge, "CHUNK_BYTES", 900)
        patch.setattr(merge, "KEYFRAME_EVERY_BYTES", 700)
        yield


@contextmanager
def starts_of() -> Iterator[list[ChunkPlace]]:
    """Note where each search for a keyframe ended."""
    found: list[ChunkPlace] = []
    nearest = state._Search.nearest

    def noted(search: state._Search) -> tuple[DoorMapState, ChunkPlace]:
        answer = nearest(search)
        found.append(answer[1])
        return answer

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(state._Search, "nearest", noted)
        yield found


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32))
def test_the_answer_is_the_same_without_keyframes(seed: int) -> None:
    """At any event number, happened time and both, as written, rechunked and merged."""
    dice = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder, tiny_steps(), starts_of() as starts:
        path = Path(folder) / "log"
        told = random_log(path, dice, commits=40)
        times = [
            t for _, happened, recorded, *_ in told for t in (happened, recorded, recorded - 1)
        ]
        for step in ("as written", "rechunked", "merged"):
            if step != "as written":
                compact(path, merge=step == "merged")
            reader = LogReader(path)
            for _ in range(15):
                bounds = {
                    "at_ns": dice.choice([None, *times]),
                    "limit": dice.choice([None, dice.randrange(len(told))]),
                }

                quick = encode(state_at(reader, **bounds))

                assert encode(state_at(reader, **bounds, uses_keyframes=False)) == quick
    assert any(start != BEGINNING for start in starts)


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32))
def test_with_many_keyframes_every_moment_is_what_the_model_says(seed: int) -> None:
    """Late events, equal stamps, retractions, borders of segments: against dictionaries."""
    dice = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder, tiny_steps():
        path = Path(folder) / "log"
        told = random_log(path, dice, commits=40)
        if dice.random() < 0.5:
            compact(path, merge=dice.random() < 0.5)
        log = sl.read(path)
        times = [t for _, happened, recorded, commit, _ in told
                 for t in (happened, recorded, commit, commit - 1)]  # fmt: skip
        for _ in range(15):
            at, known_at = dice.choice([None, *times]), dice.choice([None, *times])
            event = dice.choice([None, dice.randrange(len(told))])

            doors = log.replay(at=at, known_at=known_at, event=event)

            assert repr(expected(model(told, at, known_at, event))) == repr(plain(doors))


def sightings(count: int, *, start: int = 0) -> list[Event]:
    """Return sightings of door 1, one a second."""
    return [
        DoorObserved(door_id=DoorId(1), happened_ns=START_NS + (start + i) * 10**9,
                     state=DoorState.OPEN if i % 2 else DoorState.CLOSED)
        for i in range(count)
    ]  # fmt: skip


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A door and 100,000 sightings of it, imported in one commit."""
    path = tmp_path_factory.mktemp("long") / "log"
    with sl.create(path, tz="UTC", compact=False) as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        log.append(sightings(100_000))
    return path


@pytest.mark.slow
def test_a_long_commit_has_keyframes_inside(long_log: Path) -> None:
    """About one for each MiB of records, with the log time of the record before."""
    reader = LogReader(long_log)
    (segment,) = reader.segments

    places = segment.chunks.having(KEYFRAME_BIT)

    rows = segment.chunks.rows
    assert int(rows["size"].sum()) // CHUNK_BYTES - 1 <= len(places) - 1 <= 10
    assert rows["end_ns"][places[1:] - 1].tolist() == rows["start_ns"][places[1:]].tolist()


def test_a_moment_reads_what_it_needs(long_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a log of many MiB: a keyframe and the one chunk behind it."""
    sizes: list[int] = []
    read_page = segment_reading.read_page

    def counted(chunks: ChunkTable, first_event: int, **how: bool) -> object:
        sizes.append(int(chunks.rows["size"].sum()))
        return read_page(chunks, first_event, **how)

    monkeypatch.setattr(segment_reading, "read_page", counted)
    log = sl.read(long_log)
    log.replay(at=START_NS)
    for second in (0, 30_000, 77_777, 99_999):
        sizes.clear()

        door = log.replay(at=START_NS + second * 10**9 + 5).doors[DoorId(1)]

        assert START_NS + second * 10**9 == door.last_seen_ns
        assert sum(sizes) < 2.1 * CHUNK_BYTES


@pytest.fixture(scope="module")
def patrolled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40,000 sightings of a door, one a second, 100 a commit, each tenth commit a minute late."""
    path = tmp_path_factory.mktemp("patrolled") / "log"
    clock = SteadyClock(START_NS)
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        for n in range(400):
            clock.now_ns = START_NS + (n + 1) * 100 * 10**9
            log.append(sightings(100, start=100 * n - 60 * (n % 10 == 9)), sync=False)
    compact(path)
    return path


@pytest.mark.parametrize("asked", ["at", "known_at", "event", "both"])
def test_a_moment_unpacks_no_chunk_twice(
    patrolled: Path, asked: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No more of what came late is read than lies between two keyframes."""
    unpacked: list[tuple[int, int]] = []
    records = StoredChunk.records

    def noted(chunk: StoredChunk, *given: Any) -> bytes | memoryview:
        unpacked.append((chunk.offset, chunk.size))
        return records(chunk, *given)

    monkeypatch.setattr(StoredChunk, "records", noted)
    log = sl.read(patrolled)
    log.replay()
    borders = [int(t) for t in log._reader.segments[0].chunks.rows["start_ns"][1:]]
    dice = random.Random(asked)
    for known_at in [*borders, *(START_NS + dice.randrange(40_000 * 10**9) for _ in range(40))]:
        at = known_at - dice.randrange(300 * 10**9)
        event = dice.randrange(40_000)
        moment = {"at": {"at": at}, "known_at": {"known_at": known_at}, "event": {"event": event},
                  "both": {"at": at, "known_at": known_at}}[asked]  # fmt: skip
        unpacked.clear()

        log.replay(**moment)

        assert log._reader._at_hand is None
        assert len(unpacked) == len(set(unpacked))
        parts = 3 if asked == "both" else 2
        assert 0 < sum(size for _, size in unpacked) < parts * 1.05 * KEYFRAME_EVERY_BYTES


def test_a_live_log_is_asked_while_it_is_written(tmp_path: Path, clock: SteadyClock) -> None:
    """Its keyframes are used before anything is closed."""
    with tiny_steps(), sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        for n in range(9):
            log.append(sightings(5, start=5 * n))
        reader = LogReader(tmp_path / "log")
        assert not reader.segments[-1].closed

        with starts_of() as starts:
            answers = [encode(state_at(reader, limit=n)) for n in range(46)]

    assert 3 < len(set(starts))
    plainly = [encode(state_at(reader, limit=n, uses_keyframes=False)) for n in range(46)]
    assert plainly == answers


def retracted_log(path: Path, first: int, last: int) -> LogReader:
    """Return a log of 60 sightings, one a commit, of which some were taken back at the end."""
    with tiny_steps(), sl.create(path, tz="UTC", compact=False) as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        for event in sightings(60):
            log.append([event])
        log.append([Retracted(first_event=first, last_event=last)])
    return LogReader(path)


def test_a_keyframe_serves_if_what_was_retracted_was_overwritten_before(tmp_path: Path) -> None:
    """Sightings 5 to 8 are hidden; behind them others had said what the state is."""
    reader = retracted_log(tmp_path / "log", 5, 8)

    with starts_of() as starts:
        late, early = (state_at(reader, at_ns=START_NS + s * 10**9) for s in (50, 7))

    assert BEGINNING not in starts[:1]
    assert (START_NS + 50 * 10**9, 51) == late.stamp(1, "state")
    assert (START_NS + 3 * 10**9, 4) == early.stamp(1, "state")


def test_a_keyframe_that_rests_on_what_was_retracted_is_passed_over(tmp_path: Path) -> None:
    """The adding of the door is hidden, so that no keyframe behind it is right."""
    reader = retracted_log(tmp_path / "log", 0, 0)

    with starts_of() as starts:
        found = state_at(reader, at_ns=START_NS + 50 * 10**9)

    assert not found.is_present(1)
    assert {1} == found.used_door_ids
    assert all(start.chunk <= 1 for start in starts)


VERSION_AT, HASH = 12, slice(16, 48)
"""Where they are in a keyframe's bytes."""


@pytest.mark.parametrize(
    ("at", "why"), [(VERSION_AT, "state version"), (20, "hash"), (200, "hash")]
)
def test_a_keyframe_that_cannot_be_used_is_left_out_with_a_warning(
    at: int, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of another version, or with a wrong bit under a right CRC."""
    encoded = keyframes.encode

    def damaged(some_state: DoorMapState) -> bytes:
        data = bytearray(encoded(some_state))
        data[at] ^= 1
        if at == VERSION_AT:  # then all the rest is right, the hash, too
            data[HASH] = bytes(32)
            data[HASH] = sha256(data).digest()
        return bytes(data)

    with tiny_steps(), sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        monkeypatch.setattr(keyframes, "encode", damaged)
        for event in sightings(10):
            log.append([event])

    with pytest.warns(KeyframeWarning, match=f"the keyframe at byte .* is not used: .*{why}"):
        door_map = sl.read(tmp_path / "log").replay(event=9)

    assert START_NS + 8 * 10**9 == door_map.doors[DoorId(1)].last_seen_ns


@pytest.mark.parametrize("column", ["annotation_value", "level_event", "level_name"])
def test_a_keyframe_whose_columns_do_not_fit_is_no_crash(
    column: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its right hash, made by a hand: left out, or an error of ours."""
    to_arrays = DoorMapState.to_arrays

    def shorter(some_state: DoorMapState) -> dict[str, Any]:
        arrays = to_arrays(some_state)
        return arrays | {column: arrays[column][:-1]}

    with tiny_steps(), sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([LevelAdded(level=1, name="first floor")])
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        log.append([DoorAnnotated(door_id=DoorId(1), key="name", value="front")])
        monkeypatch.setattr(DoorMapState, "to_arrays", shorter)
        for event in sightings(10):
            log.append([event])

    with warnings.catch_warnings(), suppress(LogError):
        warnings.simplefilter("ignore", KeyframeWarning)
        doors = sl.read(tmp_path / "log").replay(event=9).doors

        assert {"name": "front"} == dict(doors[DoorId(1)].annotations)


def test_a_good_log_warns_of_nothing(long_log: Path) -> None:
    """A warning means something."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")

        assert 1 == len(sl.read(long_log).replay().doors)


def test_damage_behind_the_keyframe_is_an_error(long_log: Path, tmp_path: Path) -> None:
    """And damage elsewhere is none of this question's business."""
    path = shutil.copytree(long_log, tmp_path / "log")
    (segment,) = LogReader(path).segments
    keyframe = int(segment.chunks.having(KEYFRAME_BIT)[3])
    offsets = segment.chunks.rows["offset"].tolist()
    data = bytearray(segment.path.read_bytes())
    data[offsets[keyframe + 1] + 500] ^= 1
    segment.path.write_bytes(data)
    log = sl.read(path)
    times = segment.spans["least"].tolist()

    for place in (keyframe - 1, keyframe + 3):
        assert DoorId(1) in log.replay(at=times[place]).doors
    with pytest.raises(CorruptLogError, match=f"damaged at byte {offsets[keyframe + 1]}"):
        log.replay(at=times[keyframe + 1])
