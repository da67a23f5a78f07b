"""A round under way: where to go next after each event of its log."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from shutil import copytree

import pytest

import semmap_log as sl
from semmap_log.analysis.planning.door_chances import SkipRule
from semmap_log.analysis.planning.followed_round import FollowedRound, RoundStep
from semmap_log.analysis.planning.patrol_plan import PatrolOptions
from semmap_log.analysis.planning.round_planner import begun_round
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    Event,
    PatrolFinished,
    PatrolStarted,
    RobotPose,
)
from semmap_log.core.model.moments import HOUR_NS, SECOND_NS, parse_instant
from tests.analysis.planning.ward import DOOR_Y, FRONT, HALL, LAB, SIDE, STORE, TZ, ward
from tests.conftest import SteadyClock

MORNING_NS = parse_instant("2026-03-23T10:00", tz=TZ)
"""The Monday after the last round: the store is to be looked at again."""
TARGETS = ("lab", "store", "2")


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ward(tmp_path_factory.mktemp("ward") / "log").path


class Patrol:
    """A round that is followed, and the log that tells of it."""

    def __init__(self, path: Path, before: Sequence[Event] = (), **how: object) -> None:
        self.clock = SteadyClock(MORNING_NS)
        self.writer = sl.append(path, clock=self.clock)
        if before:
            self.writer.append(list(before))
        self.log = sl.read(path)
        self.how = {"start_at": HALL, "start": "2026-03-23T10:00", "rooms": TARGETS} | how
        self.round = FollowedRound(begun_round(self.log, **self.how), self.log.reopened_log)
        self.event = self.log.last_event()

    def tell(self, *events: Event, at_s: float) -> list[RoundStep]:
        """Record events of so many seconds after the start, and return the steps they make."""
        self.clock.now_ns = max(self.clock.now_ns, MORNING_NS + round(at_s * SECOND_NS))
        self.writer.append([_at(event, at_s) for event in events])
        return self.take()

    def take(self) -> list[RoundStep]:
        """Take in what was recorded since."""
        self.log.refresh()
        steps = []
        for followed in self.log.commits_after(self.event):
            steps += self.round.take(followed.batch)
            self.event = followed.commit.last_event
        return steps

    @property
    def next(self) -> str | None:
        stop = self.round.next_stop()
        return None if stop is None else stop.door.name

    @property
    def rest(self) -> list[str | None]:
        return [stop.door.name for stop in self.round.stops()]


def _at(event: Event, at_s: float) -> Event:
    return replace(event, happened_ns=MORNING_NS + round(at_s * SECOND_NS))


@pytest.fixture
def patrol(kept: Path, tmp_path: Path) -> Iterator[Callable[..., Patrol]]:
    patrols: list[Patrol] = []

    def begun(before: Sequence[Event] = (), **how: object) -> Patrol:
        path = tmp_path / f"log{len(patrols)}"
        copytree(kept, path)
        patrols.append(Patrol(path, before, **how))
        return patrols[-1]

    yield begun
    for each in patrols:
        each.writer.close()


def passed(door: DoorId, *, through: bool = True) -> Event:
    return DoorPassed(door_id=door, passed=through)


def seen(door: DoorId, state: DoorState, accuracy: float = 1.0) -> Event:
    return DoorObserved(door_id=door, state=state, accuracy_open=accuracy, accuracy_closed=accuracy)


def stands(x: float, y: float = DOOR_Y - 0.7) -> Event:
    return RobotPose(level=1, x=x, y=y, theta=0.0)


X_OF = {FRONT: 1.0, SIDE: 3.0, STORE: 5.5, LAB: 8.5}
ALL = PatrolOptions(skip=SkipRule(0.0))
"""No door is left out."""
Begun = Callable[..., Patrol]


def test_passed_is_visited(patrol: Begun) -> None:
    """The next stop follows, with why."""
    round_ = patrol()
    assert round_.rest == ["lab", "front"]

    (step,) = round_.tell(passed(LAB), at_s=10)
    early = round_.round.next_stop()
    assert round_.tell(passed(LAB), at_s=300) == []

    assert (step.because, step.stop and step.stop.door.name, step.left) == (
        "lab: passed", "front", 1
    )  # fmt: skip
    late = round_.round.next_stop()
    assert early is not None
    assert late is not None
    assert late.arrives_ns - early.arrives_ns == (300 - 10 - 17) * SECOND_NS
    assert [target.name for target in round_.round.visited] == ["lab"]


def test_the_other_door_where_the_robot_gave_up(patrol: Begun) -> None:
    """A room has two; and the round is over when nothing is left."""
    round_ = patrol(rooms=["2"])

    gave_up = round_.tell(passed(FRONT, through=False), at_s=10)
    again = round_.tell(passed(FRONT, through=False), at_s=12)
    over = round_.tell(passed(SIDE, through=False), at_s=30)

    assert [step.stop and step.stop.door.name for step in gave_up] == ["side"]
    assert again == []
    assert [(step.because, step.stop) for step in over] == [("side: gave up", None)]
    assert round_.round.is_over
    assert [target.name for target in round_.round.not_visited] == ["room 2"]


def test_seen_shut_where_the_robot_is_sent_and_stands(patrol: Begun) -> None:
    """Not before it is there: whoever tells of a door from afar makes it less likely, no more."""
    round_ = patrol(rooms=["2"])

    round_.tell(stands(8.5), at_s=1)
    from_afar = round_.tell(seen(FRONT, DoorState.CLOSED, 0.6), at_s=2)
    round_.tell(stands(1.5), at_s=5)
    at_it = round_.tell(seen(FRONT, DoorState.CLOSED, 0.6), at_s=6)

    assert from_afar == []
    assert [step.because for step in at_it] == ["front: shut, the robot is there"]
    assert round_.rest == ["side"]


def test_a_door_beside_the_way_is_not_struck_off(patrol: Begun) -> None:
    """The robot passes it while it is sent to another: only its P falls."""
    round_ = patrol(rooms=["lab", "store"], options=ALL)
    assert round_.rest == ["lab", "store"]

    round_.tell(stands(X_OF[STORE]), seen(STORE, DoorState.CLOSED), at_s=2)

    assert round_.rest == ["lab", "store"]


def test_what_others_tell_of_a_door_ahead(patrol: Begun) -> None:
    """A smart door reports itself shut: the robot goes elsewhere first."""
    round_ = patrol()
    before = round_.round._order.replans

    same = round_.tell(seen(FRONT, DoorState.OPEN, 0.9), at_s=1)
    assert (same, round_.round._order.replans) == ([], before)
    other = round_.tell(seen(LAB, DoorState.CLOSED), at_s=2)

    assert [step.because for step in other] == ["lab: CLOSED"]
    assert round_.rest == ["front", "lab"]
    assert round_.round._order.replans == before + 1
    lab = round_.round.stops()[1]
    assert lab.p_passes < 0.2
    assert lab.why == "told on the way: CLOSED"


def test_a_door_that_was_left_out_joins_when_it_is_told_open(patrol: Begun) -> None:
    """The store seems shut for ever, and reports itself open."""
    round_ = patrol()
    assert "store" not in round_.rest

    round_.tell(seen(STORE, DoorState.OPEN), at_s=3)

    assert "store" in round_.rest


@pytest.mark.parametrize(
    ("event", "at_s", "because", "left"),
    [
        (stands(8.5, DOOR_Y + 1.5), 12, "the robot is in lab", ["front"]),
        (DoorRemoved(door_id=LAB), 4, "lab was removed", ["front"]),
        (PatrolFinished(patrol=9), 5, "the round was finished", []),
        (stands(5.0), 61, "budget", []),
    ],
)
def test_what_takes_stops_away(
    patrol: Begun, event: Event, at_s: float, because: str, left: list[str]
) -> None:
    """A robot in a room has visited it; what comes after the end changes nothing."""
    round_ = patrol(options=PatrolOptions(budget_s=60.0))
    (step,) = round_.tell(event, at_s=at_s)

    assert step.because == because
    assert round_.rest == left
    assert (step.stop is None) == round_.round.is_over == (not left)
    assert left or round_.tell(passed(LAB), at_s=at_s + 1) == []


@pytest.mark.parametrize(
    "event", [passed(DoorId(6)), seen(DoorId(5), DoorState.OPEN), PatrolStarted(patrol=9)], ids=str
)
def test_what_does_not_concern_the_round(patrol: Begun, event: Event) -> None:
    """A door that is not in it; the start of a round is that of this one."""
    round_ = patrol()

    assert round_.tell(event, at_s=5) == []
    assert round_.rest == ["lab", "front"]


def test_a_robot_that_is_late(patrol: Begun) -> None:
    """What is ahead is not in the past: the plan is put off."""
    round_ = patrol()
    legs_ns = [stop.arrives_ns for stop in round_.round.stops()]

    round_.tell(stands(5.0), at_s=600)

    late_ns = [stop.arrives_ns for stop in round_.round.stops()]
    assert late_ns[0] == MORNING_NS + 600 * SECOND_NS
    assert late_ns[1] - late_ns[0] == pytest.approx(legs_ns[1] - legs_ns[0], abs=SECOND_NS)


def test_what_happened_before_the_start_changes_no_plan(patrol: Begun) -> None:
    """A late event: told in the round, and older than it."""
    round_ = patrol()

    assert round_.tell(passed(LAB), at_s=-5) == []
    assert round_.tell(PatrolFinished(patrol=8), at_s=0) == []
    assert round_.rest == ["lab", "front"]


def test_what_is_taken_back_did_not_happen(patrol: Begun) -> None:
    """The lab is a stop again, and one line says so; what was learnt from it is forgotten, too."""
    round_ = patrol()
    before = [(stop.door.name, stop.p_passes) for stop in round_.round.stops()]
    number = round_.log.last_event() + 1
    round_.tell(passed(LAB), at_s=10)
    round_.tell(seen(FRONT, DoorState.CLOSED), at_s=11)

    round_.writer.retract(number, number + 1)
    (step,) = round_.take()

    assert "taken back" in step.because
    assert step.stop is not None
    assert step.stop.door.name == "lab"
    after = [(stop.door.name, stop.p_passes) for stop in round_.round.stops()]
    assert after == before
    assert round_.round.visited == []


def test_the_order_in_which_events_come_does_not_matter(patrol: Begun) -> None:
    """Late ones, several in a commit, in any order: the round is what they make of it together."""
    told = [
        (stands(8.5), 8.0), (seen(STORE, DoorState.OPEN, 0.9), 9.0), (passed(LAB), 12.0),
        (seen(FRONT, DoorState.CLOSED, 0.9), 20.0), (stands(1.5), 40.0),
        (passed(FRONT, through=False), 52.0), (seen(SIDE, DoorState.OPEN), 53.0),
    ]  # fmt: skip
    found = []
    for seed in range(6):
        round_, mixed = patrol(), list(told)
        if seed:
            random.Random(seed).shuffle(mixed)
        for event, at_s in mixed:
            round_.clock.now_ns = MORNING_NS + 60 * SECOND_NS
            round_.tell(event, at_s=at_s)
        stops = [(s.door.name, s.p_passes, s.arrives_ns, s.why) for s in round_.round.stops()]
        found.append((stops, [target.name for target in round_.round.visited]))

    assert found[1:] == found[:1] * 5
    assert found[0][1] == ["lab"]


def test_a_robot_that_asks_is_told_nothing_by_a_shut_door(patrol: Begun) -> None:
    """It may open for who asks: P is that of passing, where enough tries are known."""
    tries = [
        DoorPassed(door_id=LAB, passed=True, happened_ns=MORNING_NS - hours * HOUR_NS)
        for hours in range(1, 21 * 24)
    ]
    asks = patrol(tries, options=PatrolOptions(asks=True))
    does_not = patrol(tries)

    for round_ in (asks, does_not):
        round_.tell(seen(LAB, DoorState.CLOSED), at_s=1)

    assert (asks.rest[0], does_not.rest[0]) == ("lab", "front")
