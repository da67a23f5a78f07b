"""Questions about a part of a log: the same events as of all of it, and little is read."""

from __future__ import annotations

import random
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import KINDS, DoorAdded, DoorObserved, PatrolStarted
from semmap_log.errors import CorruptLogError
from semmap_log.store.compaction import compact
from semmap_log.store.reading import segment_reading
from semmap_log.store.reading.chunk_table import ChunkTable
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window
from tests.conftest import SteadyClock
from tests.log.replay.test_state import tiny_steps
from tests.test_replay import random_log


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32))
def test_a_part_of_the_log_is_what_all_of_it_would_give(seed: int) -> None:
    """Ranges of happened and recorded time and of numbers, kinds and doors, in any mixture."""
    dice = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder, tiny_steps():
        path = Path(folder) / "log"
        told = random_log(path, dice, commits=30)
        if dice.random() < 0.6:
            compact(path, merge=dice.random() < 0.5)
        log = sl.read(path)
        times = [t for _, happened, recorded, *_ in told for t in (happened, recorded)]
        for _ in range(12):
            asked: dict[str, Any] = {
                "since": dice.choice([None, dice.choice(times), _some_event(dice, told)]),
                "until": dice.choice([None, dice.choice(times), _some_event(dice, told)]),
                "recorded": dice.random() < 0.4,
                "kinds": dice.choice([None, dice.sample(KINDS, 3)]),
                "doors": dice.choice([None, [DoorId(dice.randint(1, 4))]]),
                "retracted": dice.random() < 0.5,
            }

            found = [str(e) for batch in log.batches(**asked) for e in batch]

            assert [str(e) for e in _all_within(log, **asked)] == found


def _some_event(dice: random.Random, told: list[Any]) -> str:
    """Return an event's number, or the one behind the last."""
    return f"event:{dice.randint(0, len(told))}"


def _all_within(log: sl.DoorLog, **asked: Any) -> list[Any]:
    """Return the same, by looking at every event."""
    first, last = log.moment(asked["since"]), log.moment(asked["until"])
    chosen = []
    for batch in log.batches(retracted=asked["retracted"]):
        times = (batch.recorded_ns if asked["recorded"] else batch.folds_ns).tolist()
        for event, time in zip(batch, times, strict=True):
            if (
                (first.ns is None or time >= first.ns)
                and (last.ns is None or time < last.ns)
                and (first.event is None or event.number >= first.event)
                and (last.event is None or event.number < last.event)
                and (asked["kinds"] is None or type(event.event) in asked["kinds"])
                and (asked["doors"] is None or getattr(event.event, "door_id", 0) in asked["doors"])
            ):
                chosen.append(event)
    return chosen


@pytest.fixture
def pages_read(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Takes note of how many chunks are read at a time."""
    read: list[int] = []
    read_page = segment_reading.read_page

    def noted(chunks: ChunkTable, first_event: int, **how: bool) -> object:
        read.append(len(chunks))
        return read_page(chunks, first_event, **how)

    monkeypatch.setattr(segment_reading, "read_page", noted)
    return read


@pytest.mark.slow
def test_a_day_of_a_year_reads_that_day(
    tmp_path: Path, clock: SteadyClock, pages_read: list[int]
) -> None:
    """Of 365 chunks, one: by happened time, by recorded time, by number, and by kind."""
    day_ns = 24 * 3600 * 10**9
    with sl.create(tmp_path / "log", tz="UTC", clock=clock, compact=False) as log:
        log.append([DoorAdded(door_id=DoorId(1))])
        for day in range(365):
            clock.now_ns += day_ns
            kinds = [PatrolStarted(patrol=1)] if day == 100 else []
            log.append([DoorObserved(door_id=DoorId(1), state=DoorState.OPEN), *kinds])
    log = sl.read(tmp_path / "log")
    when = int(next(b.happened_ns[0] for b in log.batches("event:40", "event:41")))
    log._reader.retractions()
    asked: list[dict[str, Any]] = [
        {"since": when, "until": when + 1},
        {"since": when, "until": when + day_ns, "recorded": True},
        {"since": "event:40", "until": "event:41"},
        {"kinds": [PatrolStarted]},
    ]
    for question in asked:
        pages_read.clear()

        assert 1 == sum(len(batch) for batch in log.batches(**question))
        assert [1] == pages_read


def test_history_finds_who_did_it_whatever_was_left_out(tmp_path: Path) -> None:
    """The note of a commit that ends many chunks behind the event; of one in the same chunk."""
    with sl.create(tmp_path / "log", tz="UTC", compact=False) as log:
        door = log.add_door(actor="survey")
        log.append(
            [
                DoorObserved(door_id=door, state=DoorState(n % 2 + 1), happened_ns=n)
                for n in range(40_000)
            ],
            note=sl.Note(actor="import"),
        )
        log.observe(door, "open", actor="robot")
    log = sl.read(tmp_path / "log")

    said = [
        [entry.actor for entry in log.history(door, f"event:{first}", f"event:{first + 1}")]
        for first in (0, 1, 17_000, 40_000, 40_001)
    ]

    assert [["survey"], ["import"], ["import"], ["import"], ["robot"]] == said


def test_events_that_are_not_those_of_the_index_are_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the index says of a chunk's events is compared with what is there."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
    reader = LogReader(tmp_path / "log")
    (segment,) = reader.segments
    spans = segment.spans.copy()
    spans["events"] += np.array([1, 0])
    monkeypatch.setitem(vars(segment), "_spans", spans)

    with pytest.raises(CorruptLogError, match="expected 1 event from 1 on"):
        list(reader.batches(Window(first_event=0)))


def test_kinds_that_are_not_those_of_the_summary_are_damage(tmp_path: Path) -> None:
    """By its summary a chunk is left out of a question."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
    reader = LogReader(tmp_path / "log")
    (segment,) = reader.segments
    segment.chunks.rows["kinds"][1] |= 1 << PatrolStarted.kind

    with pytest.raises(CorruptLogError, match="other kinds of messages"):
        list(reader.batches())


def test_small_chunks_read_where_they_lie_are_checked_all_the_same(tmp_path: Path) -> None:
    """A wrong bit of any chunk of many is found, with its place, when all of them are read."""
    with sl.create(tmp_path / "log", tz="UTC", compact=False) as log:
        door = log.add_door()
        for n in range(30):
            log.observe(door, DoorState(n % 2 + 1))
    (segment,) = sl.read(tmp_path / "log")._reader.segments
    offsets = segment.chunks.rows["offset"].tolist()
    whole = segment.path.read_bytes()
    for offset in offsets[5:25:5]:
        segment.path.write_bytes(
            whole[: offset + 120] + bytes([whole[offset + 120] ^ 1]) + whole[offset + 121 :]
        )

        with pytest.raises(CorruptLogError, match=f"damaged at byte {offset}: its CRC"):
            list(sl.read(tmp_path / "log").batches())
