"""Door 0, which the thesis's files and servers may have: everything that is said of it is kept.

A batch's `door_ids` has 0 for what is about no door, too: a robot's poses, rounds, floors.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.cli.show import run
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorEvent, PatrolStarted, RobotPose
from semmap_log.errors import UnknownDoorError
from semmap_log.interop.topics.topic_reader import Known
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.compaction.compacting import compact
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.rerun.shown_retractions import taken_back

ZERO, TWIN = DoorId(0), DoorId(7)


@pytest.fixture
def log(tmp_path: Path, clock: SteadyClock) -> Iterator[sl.DoorLogWriter]:
    """Doors 0 and 7, of which the same is said, and what is about no door between."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        log.start_patrol()
        for door in (ZERO, TWIN):
            log.add_door(door_id=door, x=2.0, y=1.5, theta=0.0, width=0.9, name=f"door-{door}")
        log.append([RobotPose(x=1.0, y=1.0, theta=0.0)])
        for door in (ZERO, TWIN):
            log.update_door(door, state="closed", prob_open=0.3)
            log.observe(door, "open", accuracy=0.9)
        log.finish_patrol()
        yield log


def _of(door: DoorId, log: sl.DoorLog) -> tuple[Any, ...]:
    """Return what a log answers about a door, but for its number and those of the events."""
    seen = log.replay().doors[door]
    known = dataclasses.replace(seen, door_id=TWIN, annotations={}, last_event=0, last_seen_ns=0)
    timeline = log.timeline(door)
    entries = list(log.history(door))
    return (
        repr(known),
        [type(entry.event) for entry in entries],
        repr([c for entry in entries for c in entry.changes or () if c.field != "name"]),
        sum(len(batch) for batch in log.batches(doors=[door])),
        timeline.state.tolist(),
    )


def test_all_that_is_said_of_it_is_answered_as_of_any_door(log: sl.DoorLogWriter) -> None:
    """Its state, history, changes, events and timeline are those of another door told the same."""
    assert ("door-0", DoorState.OPEN) == (log.replay()[ZERO].name, log.replay()[ZERO].state)
    assert _of(TWIN, log) == _of(ZERO, log)
    assert {0, 7} == {int(e.event.door_id) for e in log.history() if isinstance(e.event, DoorEvent)}


def test_a_keyframe_and_a_compacted_log_hold_it(log: sl.DoorLogWriter) -> None:
    """What a robot does behind the keyframe is none of its events."""
    before = _of(ZERO, log)
    log.close()
    compact(log.path)

    with sl.append(log.path) as again:
        again.start_patrol()
        again.observe(TWIN, "closed")
        last = again.replay()[ZERO].last_event

    read = sl.read(log.path)
    assert before == _of(ZERO, read)
    assert last == [e.number for e in read.history(ZERO)][-1]
    assert not verify(log.path).findings


def test_what_is_about_no_door_is_not_about_it(log: sl.DoorLogWriter) -> None:
    """Chosen doors bring their own events, and excerpts those about none besides."""
    log.retract(0)  # a round's start
    log.retract(next(e.number for e in log.history(ZERO)))
    excerpt = Excerpt(log, None, None, frozenset({TWIN}))
    kinds = {kind for batch in excerpt.batches() for kind in batch.kind.tolist()}
    ids = np.concatenate([batch.door_ids()[batch.about_doors()] for batch in excerpt.batches()])

    assert [frozenset({ZERO})] == [one.doors for one in taken_back(Excerpt(log, None, None, None))]
    assert {7} == set(ids.tolist())
    assert {PatrolStarted.kind, RobotPose.kind} <= kinds
    assert ZERO not in log.replay().doors


def test_ids_are_given_from_1_on_all_the_same(log: sl.DoorLogWriter, tmp_path: Path) -> None:
    """0 comes from outside only."""
    with sl.create(tmp_path / "another", tz="UTC") as another:
        another.add_door(door_id=ZERO)

        assert 1 == another.add_door()
        assert 2 == Known.of(another).next_id


@pytest.mark.parametrize("door", [ZERO, "0", "id:0"])
def test_who_counts_from_0_is_told_where_ids_begin(door: DoorId | str, tmp_path: Path) -> None:
    """Of a log whose doors did not come from the thesis."""
    with sl.create(tmp_path / "another", tz="UTC") as another:
        another.add_door()

        with pytest.raises(UnknownDoorError, match=r"door 0 is not in the map: ids .* from 1 on"):
            another.observe(door, "open")


def test_a_name_is_shown_of_its_own_events_alone(
    log: sl.DoorLogWriter, capsys: pytest.CaptureFixture[str]
) -> None:
    """`show` of a round names no door."""
    log.close()

    run(log.path, 0)
    run(log.path, 1)

    round_, door = capsys.readouterr().out.split("DoorAdded")
    assert "door-0" not in round_
    assert "door-0" in door


def test_its_name_and_level_in_a_table_are_its_own(log: sl.DoorLogWriter) -> None:
    """What is about no door has neither of them, though its column of doors holds a 0."""
    rows = log.to_arrow(columns=["kind", "door_id", "door_name", "level_name"]).to_pylist()

    told = {(row["kind"], row["door_id"], row["door_name"], row["level_name"]) for row in rows}
    assert ("PatrolFinished", None, None, None) in told
    assert ("RobotPose", None, None, "0") in told
    assert ("DoorObserved", 0, "door-0", "0") in told
    assert ("DoorObserved", 7, "door-7", "0") in told
