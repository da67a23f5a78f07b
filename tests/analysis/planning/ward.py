"""A ward that was patrolled for three weeks: three rooms at a hall, and doors beside them."""

from __future__ import annotations

from pathlib import Path

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRequested,
    Event,
    LevelAdded,
    RobotPose,
)
from semmap_log.core.model.moments import DAY_NS, HOUR_NS, SECOND_NS, parse_instant
from tests.analysis.rooms.buildings import drawn
from tests.conftest import SteadyClock

TZ = "Europe/Vienna"
MONDAY = "2026-03-02"
PLAN = """
####################
#......#.....#.....#
#......#.....#.....#
#......#.....#.....#
#......#.....#.....#
#..##..###..####..##
#..................#
#..................#
#..................#
####################
"""
"""Half a metre a sign; the lowest line is y = 0."""
DOOR_Y = 2.25
FRONT, SIDE, STORE, LAB = (DoorId(number) for number in range(1, 5))
LOOSE, ATTIC, CELLAR = DoorId(5), DoorId(6), DoorId(7)
DOORS = {FRONT: ("front", 0.5), SIDE: ("side", 2.5), STORE: ("store", 5.0), LAB: ("lab", 8.0)}
"""Doors of the ward -> name, and the x where they begin; each 1 m wide.

`front` and `side` lead into one room. `loose` has no place, `attic` is on a level without a plan,
nobody looks at `cellar`.
"""
ROUNDS = range(7, 20)
OPEN_HOURS = range(8, 18)
HALL = "5,1,1"
DAYS = 21


def ward(path: Path, *, days: int = DAYS) -> sl.DoorLog:
    """Front is open from 8 to 18, side for the even ones of these hours; store never; lab always.

    Of `lab` and `store` each is asked for at noon: the lab's opens, the store's does not.
    """
    midnight_ns = parse_instant(MONDAY, tz=TZ)
    clock = SteadyClock(midnight_ns)
    with sl.create(path, tz=TZ, clock=clock) as log:
        log.append([drawn(PLAN, level=1, cell_m=0.1, scale=5), LevelAdded(level=2, name="L2")])
        log.append([
            DoorAdded(door_id=door, level=1, x=x, y=DOOR_Y, theta=0.0, width=1.0)
            for door, (_, x) in DOORS.items()
        ])  # fmt: skip
        log.append([
            DoorAdded(door_id=LOOSE, level=1),
            DoorAdded(door_id=ATTIC, level=2, x=3.0, y=0.0, theta=0.0, width=1.0),
            DoorAdded(door_id=CELLAR, level=2, x=30.0, y=0.0, theta=0.0, width=1.0),
        ])  # fmt: skip
        names = {door: name for door, (name, _) in DOORS.items()}
        names |= {LOOSE: "loose", ATTIC: "attic", CELLAR: "cellar"}
        log.append([DoorAnnotated(door_id=d, key="name", value=name) for d, name in names.items()])
        for day in range(days):
            clock.now_ns = midnight_ns + day * DAY_NS + 20 * HOUR_NS
            log.append(list(_day(midnight_ns + day * DAY_NS)))
    return sl.read(path)


def _day(midnight_ns: int) -> list[Event]:
    events: list[Event] = []
    for hour in ROUNDS:
        at_ns = midnight_ns + hour * HOUR_NS + HOUR_NS // 2
        is_open = {
            FRONT: hour in OPEN_HOURS, SIDE: hour in OPEN_HOURS and hour % 2 == 0,
            STORE: False, LAB: True, ATTIC: True,
        }  # fmt: skip
        events += [
            DoorObserved(
                happened_ns=at_ns, door_id=door, state=DoorState.OPEN if opened else
                DoorState.CLOSED, accuracy_open=0.97, accuracy_closed=0.97,
            )
            for door, opened in is_open.items()
        ]  # fmt: skip
        if hour == 12:
            for door in (LAB, STORE):
                events += [
                    DoorRequested(happened_ns=at_ns + SECOND_NS, door_id=door,
                                  state=DoorState.OPEN),
                    DoorPassed(happened_ns=at_ns + 9 * SECOND_NS, door_id=door,
                               passed=door == LAB, waited_s=8.0),
                ]  # fmt: skip
    pose_ns = midnight_ns + 19 * HOUR_NS + 45 * 60 * SECOND_NS
    return [*events, RobotPose(happened_ns=pose_ns, level=1, x=5.0, y=1.0, theta=0.0)]
