"""Events as lines of text."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.folds.door_changes import door_changes
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    KINDS,
    Changed,
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    FloorMap,
    HistoryTrimmed,
    LevelAdded,
    LogExported,
    MomentPinned,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
    SightingsThinned,
)
from semmap_log.views.event_words import reported_state, words_of
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.rerun.contents import find_scene
from semmap_log.views.rerun.drawable import EventLine, EventLines
from tests.conftest import SteadyClock
from tests.views.rerun.some_logs import SECOND, START

ONE = DoorId(1)
PLAN = FloorMap(resolution=0.05, origin_x=0, origin_y=0, cells=np.zeros((8, 10), np.int8))

SAID: list[tuple[Event, str, DoorState | None]] = [
    (DoorAdded(door_id=ONE), "added without a place, UNKNOWN", DoorState.UNKNOWN),
    (DoorAdded(door_id=ONE, x=1, y=2, theta=0, width=1, state=DoorState.OPEN, prob_open=0.25),
     "added, OPEN, P(open) 0.25", DoorState.OPEN),
    (DoorUpdated(door_id=ONE, changed=Changed.STATE | Changed.POSE, x=1, y=2, theta=0,
                 state=DoorState.CLOSED), "set to CLOSED, moved to 1.00, 2.00", DoorState.CLOSED),
    (DoorUpdated(door_id=ONE, changed=Changed.WIDTH | Changed.PROB_CLOSED, width=0.9,
                 prob_closed=0.75), "width 0.90 m, P(closed) 0.75", None),
    (DoorRemoved(door_id=ONE), "removed from the map", None),
    (DoorObserved(door_id=ONE, state=DoorState.OPEN), "seen OPEN", DoorState.OPEN),
    (DoorObserved(door_id=ONE, state=DoorState.OPEN, accuracy_open=0.9, accuracy_closed=0.8,
                  opening=0.4), "seen OPEN (90%), 40% open", DoorState.OPEN),
    (DoorObserved(door_id=ONE, state=DoorState.OPEN, accuracy_open=0.996), "seen OPEN (99.6%)",
     DoorState.OPEN),
    (DoorObserved(door_id=ONE, state=DoorState.CLOSED, accuracy_closed=0.99996),
     "seen CLOSED (99.996%)", DoorState.CLOSED),
    (DoorRequested(door_id=ONE, state=DoorState.OPEN), "asked to be OPEN", None),
    (DoorPassed(door_id=ONE, passed=True), "passed", DoorState.OPEN),
    (DoorPassed(door_id=ONE, passed=False, waited_s=12.4), "given up after 12 s", None),
    (PatrolStarted(patrol=7), "patrol 7 started", None),
    (PatrolFinished(patrol=7), "patrol 7 finished", None),
    (RobotPose(x=1, y=2, theta=math.pi), "robot at 1.00, 2.00", None),
    (Retracted(first_event=3, last_event=5), "events 3..5 retracted", None),
    (DoorAnnotated(door_id=ONE, key="name", value="会議室"), "name = 会議室", None),
    (LevelAdded(level=2, name="first"), "level 2 is called first", None),
    (PLAN, "floor plan of level 0: 10 x 8 cells", None),
    (LogExported(format="yaml", file_name="doors.yaml", at_ns=0), "exported as yaml: doors.yaml",
     None),
    (HistoryTrimmed(next_event=9, events_gone=3, notes_gone=2, horizon=0, reasons="redacted",
                    rule="tracks of the robot", tombstones=""),
     "history trimmed (redacted): tracks of the robot", None),
    (SightingsThinned(door_id=ONE, state=DoorState.OPEN, count=3, first_ns=1, last_ns=2),
     "seen OPEN 3 times more; thinned", None),
    (MomentPinned(at_ns=10**18, name="audit"),
     "moment pinned: audit, 2001-09-09T01:46:40.000000000Z", None),
    (ClassDefined(class_name="dock", geometry="point", states="free,taken", blocks=""),
     "class dock: a point, free,taken; blocks nothing", None),
]  # fmt: skip


@pytest.mark.parametrize(("event", "words", "state"), SAID, ids=lambda value: type(value).__name__)
def test_every_kind_has_its_words(event: Event, words: str, state: DoorState | None) -> None:
    """What happened, in a few words; and which state it gives to the door."""
    assert words == words_of(event)
    assert state == reported_state(event)


def test_no_kind_is_forgotten() -> None:
    """A new kind of event fails here until it can be put into words."""
    assert set(KINDS) == {type(event) for event, _, _ in SAID}


def lines_of(tmp_path: Path, *commits: Event) -> list[EventLine]:
    clock = SteadyClock(START)
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        for event in commits:
            clock.now_ns += 60 * SECOND
            log.append([event], note=sl.Note(actor="rover", reason="round 1"))
    excerpt = Excerpt(sl.read(tmp_path / "log"))
    lines = EventLines(find_scene(excerpt), excerpt, excerpt.log.commits())
    return [line for batch in excerpt.batches() for line in lines.of(batch, door_changes(batch))]


def test_what_changes_the_map_stands_out_from_what_repeats_it(tmp_path: Path) -> None:
    """The first sighting is news, the second is not; a robot that gave up is worth a look."""
    lines = lines_of(
        tmp_path,
        DoorAdded(door_id=ONE),
        DoorObserved(door_id=ONE, state=DoorState.OPEN),
        DoorObserved(door_id=ONE, state=DoorState.OPEN),
        DoorUpdated(door_id=ONE, changed=Changed.PROB_OPEN, prob_open=0.5),
        DoorPassed(door_id=ONE, passed=False),
        DoorRemoved(door_id=ONE),
    )

    assert ["INFO", "INFO", "DEBUG", "DEBUG", "WARN", "WARN"] == [line.importance for line in lines]


def test_a_line_tells_when_which_door_what_who_and_why(tmp_path: Path) -> None:
    """The door is called by the name it got, also before it got it; the id stands behind."""
    first, *_ = lines_of(
        tmp_path, DoorAdded(door_id=ONE), DoorAnnotated(door_id=ONE, key="name", value="会議室 3")
    )
    assert "03-01 21:21:00  door 1  added without a place, UNKNOWN  · rover: round 1" == first.text


def test_events_about_a_door_that_was_not_there_say_so(tmp_path: Path) -> None:
    """A sighting from before the door was added is history, and no change of the map."""
    _, late = lines_of(
        tmp_path,
        DoorAdded(door_id=ONE),
        DoorObserved(door_id=ONE, state=DoorState.OPEN, happened_ns=START),
    )

    assert ("DEBUG", None) == (late.importance, late.state)
    assert "door 1  seen OPEN (not in the map then)" in late.text


def test_poses_are_not_told(tmp_path: Path) -> None:
    """They would drown everything else."""
    assert [] == lines_of(tmp_path, RobotPose(x=0, y=0, theta=0))


def test_times_are_those_of_the_building(tmp_path: Path) -> None:
    """Also over the night in which the clocks change: 03:00 follows 01:59."""
    change_ns = 1_774_746_000 * SECOND  # 2026-03-29T01:00Z
    clock = SteadyClock(change_ns - 60 * SECOND)
    with sl.create(tmp_path / "log", tz="Europe/Vienna", clock=clock) as log:
        log.append([DoorAdded(door_id=ONE)])
        clock.now_ns = change_ns
        log.append([DoorObserved(door_id=ONE, state=DoorState.OPEN)])
    excerpt = Excerpt(sl.read(tmp_path / "log"))

    lines = EventLines(find_scene(excerpt), excerpt, excerpt.log.commits())

    told = [
        line.text for batch in excerpt.batches() for line in lines.of(batch, door_changes(batch))
    ]
    assert ["03-29 01:59:00 UTC+1", "03-29 03:00:00 UTC+2"] == [text[:20] for text in told]
