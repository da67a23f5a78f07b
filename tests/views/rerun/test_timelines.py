"""What a recording shows along each of its timelines is what a replay to there gives."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.core.model.doors import Door, DoorId, DoorMap, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorRemoved, Retracted
from semmap_log.views.rerun.recording import save_rrd
from tests.conftest import SteadyClock
from tests.views.rerun.some_logs import SECOND, START, Drawn, restless_log, wild_log

pytestmark = pytest.mark.viewer

STATE, STRIPS, SCALARS = "StateChange:state", "LineStrips2D:strips", "Scalars:scalars"
LEVELS = {1: "ground", 2: "first"}
MOMENTS = 40

Replay = Callable[[int], DoorMap]


def drawn_of(log: sl.DoorLog, tmp_path: Path, **how: Any) -> Drawn:
    save_rrd(log, tmp_path / "x.rrd", beliefs=False, **how)
    return Drawn(tmp_path / "x.rrd")


@pytest.mark.slow
@pytest.mark.parametrize("make", [restless_log, wild_log])
@pytest.mark.parametrize("seed", range(3))
def test_each_timeline_shows_what_a_replay_gives(
    make: Callable[..., sl.DoorLog], seed: int, tmp_path: Path
) -> None:
    """
    Along `happened` what was true, along `recorded` what was believed, along `event` the same by
    number: with late events, late removals, moves between levels, commits of many events, and much
    that is taken back; states, lines and given probabilities, as long as a door is there.
    """
    log = make(tmp_path / "log", seed=seed)
    rng = random.Random(seed)

    drawn = drawn_of(log, tmp_path)

    stamps = [(each.happened_ns, each.recorded_ns) for each in log.history()]
    moments = [rng.randrange(START, log.end_ns() + 1) for _ in range(MOMENTS)]
    happened = [*moments, *(rng.choice(stamps)[0] for _ in range(MOMENTS))]
    recorded = [*moments, *(rng.choice(stamps)[1] for _ in range(MOMENTS))]
    assert_same(drawn, "happened", happened, lambda at: log.replay(at=at))
    assert_same(drawn, "recorded", recorded, lambda at: log.replay(known_at=at))
    assert_same(drawn, "event", range(len(stamps)), lambda at: log.replay(event=at))


@pytest.mark.parametrize("seed", range(3))
def test_a_part_shows_the_same_along_its_timelines(seed: int, tmp_path: Path) -> None:
    """From a moment on and before another."""
    log = wild_log(tmp_path / "log", seed=seed)
    rng = random.Random(seed)
    since, until = START + 2_000 * SECOND, START + 6_000 * SECOND

    drawn = drawn_of(log, tmp_path, since=since, until=until)

    moments = [since, until - 1, *(rng.randrange(since, until) for _ in range(MOMENTS))]
    assert_same(drawn, "happened", moments, lambda at: log.replay(at=at))
    assert_same(drawn, "recorded", moments, lambda at: log.replay(known_at=at))


def test_a_part_holds_nothing_that_was_recorded_behind_it(tmp_path: Path) -> None:
    """A sighting within the part of which the log learnt later: on `happened`, and nowhere else."""
    clock = SteadyClock(START)
    until = START + 60 * SECOND
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append([DoorAdded(door_id=DoorId(1), x=0, y=0, theta=0, width=1)])
        clock.now_ns = until + SECOND
        log.append([DoorObserved(door_id=DoorId(1), state=DoorState.OPEN, happened_ns=until - 1)])

    drawn = drawn_of(sl.read(tmp_path / "log"), tmp_path, until=until)

    lane = "/map/doors/door_1"
    assert (until - 1, ["OPEN"]) == drawn.rows(lane, STATE)[-1]
    assert [["UNKNOWN"]] == [value for _, value in drawn.rows(lane, STATE, "recorded")]
    assert [(0, ["UNKNOWN"])] == drawn.rows(lane, STATE, "event")


def test_a_part_goes_on_from_what_was_known_at_its_begin(tmp_path: Path) -> None:
    """And not from what was known when something was taken back, long before."""
    clock = SteadyClock(START)
    door = DoorId(1)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append([DoorAdded(door_id=door, x=0, y=0, theta=0, width=1, state=DoorState.CLOSED)])
        log.append([DoorObserved(door_id=door, state=DoorState.OPEN)])
        log.append([Retracted(first_event=1, last_event=1)])
        log.append([DoorObserved(door_id=door, state=DoorState.OPEN)])
        since = clock.now_ns = START + 60 * SECOND
        log.append([DoorObserved(door_id=door, state=DoorState.CLOSED)])
        log.append([DoorObserved(door_id=door, state=DoorState.OPEN)])
        log.append([Retracted(first_event=5, last_event=5)])

    drawn = drawn_of(sl.read(tmp_path / "log"), tmp_path, since=since)

    rows = drawn.rows("/map/doors/door_1", STATE, "event")
    assert [(3, ["OPEN"]), (4, ["CLOSED"]), (5, ["OPEN"]), (6, ["CLOSED"])] == rows


def assert_same(drawn: Drawn, timeline: str, moments: Any, replay: Replay) -> None:
    for at in moments:
        expected = {door.door_id: _told(door) for door in replay(at).doors.values()}
        assert expected == _seen(drawn, at, timeline), (timeline, at)


def _told(door: Door) -> Any:
    line = (LEVELS[door.level], _rounded([door.start, door.end])) if door.is_placed else None
    return door.state.name, line, _shares([door.prob_open, door.prob_closed])


def _seen(drawn: Drawn, at: int, timeline: str) -> dict[int, Any]:
    """Return the same as the viewer would draw it."""
    seen: dict[int, Any] = {}
    for entity in sorted(drawn.entities):
        _, _, level, kind, part = (entity.split("/") + [""] * 3)[:5]
        if kind != "doors":
            continue
        door_id = int(part.removeprefix("door_"))
        state, line, shares = seen.get(door_id, (None, None, None))
        (told,) = drawn.latest(entity, STATE, at, timeline) or [None]
        strips = drawn.latest(entity, STRIPS, at, timeline)
        point = drawn.latest(entity, SCALARS, at, timeline)
        seen[door_id] = (
            told or state,
            (level, _rounded(strips[0])) if strips else line,
            _shares(point) if point else shares,
        )
    nothing = _shares([math.nan, math.nan])
    return {
        door_id: (state, line, shares or nothing)
        for door_id, (state, line, shares) in seen.items()
        if state is not None or line is not None
    }


def _rounded(strip: Any) -> Any:
    return np.asarray(strip, np.float32).round(3).tolist()


def _shares(both: Any) -> Any:
    return [None if math.isnan(share) else share for share in both]


def test_a_sighting_counts_until_it_is_taken_back(tmp_path: Path) -> None:
    """The state falls back to what the map says without it; it is not on `happened` at all."""
    door = DoorId(1)
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=door, x=0, y=0, theta=0, width=1, state=DoorState.CLOSED)])
        log.append([DoorObserved(door_id=door, state=DoorState.OPEN)])
        log.append([Retracted(first_event=1, last_event=1)])

    drawn = drawn_of(sl.read(tmp_path / "log"), tmp_path)

    lane = "/map/doors/door_1"
    assert [(0, ["CLOSED"]), (1, ["OPEN"]), (2, ["CLOSED"])] == drawn.rows(lane, STATE, "event")
    assert [["CLOSED"]] == [value for _, value in drawn.rows(lane, STATE)]


def test_a_door_comes_back_when_its_removal_is_taken_back(tmp_path: Path) -> None:
    """Along `event` it vanishes and returns with all it had."""
    door = DoorId(1)
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=door, x=0, y=0, theta=0, width=1, state=DoorState.OPEN)])
        log.append([DoorRemoved(door_id=door)])
        log.append([Retracted(first_event=1, last_event=1)])

    drawn = drawn_of(sl.read(tmp_path / "log"), tmp_path)

    lane = "/map/doors/door_1"
    shows = [bool(drawn.latest(lane, STRIPS, number, "event")) for number in range(3)]
    assert [True, False, True] == shows
    assert ["OPEN"] == drawn.latest(lane, STATE, 2, "event")
    assert [] == drawn.rows(lane, "Clear:is_recursive")


def test_a_removal_and_a_return_in_one_commit_leave_the_door_there(tmp_path: Path) -> None:
    """A commit is known as a whole: along `recorded` the door never goes."""
    door = DoorId(1)
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([DoorAdded(door_id=door, x=0, y=0, theta=0, width=1, state=DoorState.OPEN)])
        log.append([DoorRemoved(door_id=door), Retracted(first_event=1, last_event=1)])

    drawn = drawn_of(sl.read(tmp_path / "log"), tmp_path)

    lane = "/map/doors/door_1"
    end_ns = sl.read(tmp_path / "log").event(2).recorded_ns
    assert drawn.latest(lane, STRIPS, end_ns, "recorded")
    assert drawn.latest(lane, STRIPS, 1, "event") is None


def test_a_door_that_was_added_by_mistake_is_seen_until_that_was_known(tmp_path: Path) -> None:
    """Along `recorded` it comes and goes; along `happened` it never was."""
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.append([DoorAdded(door_id=DoorId(1), x=0, y=0, theta=0, width=1)])
        clock.now_ns = START + 60 * SECOND
        log.append([Retracted(first_event=0, last_event=0)])

    drawn = drawn_of(sl.read(tmp_path / "log"), tmp_path)

    lane = "/map/doors/door_1"
    known_ns = sl.read(tmp_path / "log").event(1).recorded_ns
    assert drawn.latest(lane, STRIPS, known_ns - 1, "recorded")
    assert drawn.latest(lane, STRIPS, known_ns, "recorded") is None
    assert [] == drawn.rows(lane, STATE)
