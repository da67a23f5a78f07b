"""A log of a robot that patrols by day: what it tells of doors, and what it cannot tell."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, DoorObserved, Event
from semmap_log.core.model.moments import DAY_NS, format_local, parse_instant
from tests.conftest import SteadyClock

VIENNA = "Europe/Vienna"
FIRST_DAY = "2026-03-02"
"""A Monday."""
FRONT, STORE, ATTIC = DoorId(1), DoorId(2), DoorId(3)
ROUNDS = range(7, 20)
"""Local hours; half past each of them the robot looks."""
OPEN_HOURS = range(8, 18)


def patrolled(
    path: Path, *, days: int = 28, tz: str = VIENNA, first: str = FIRST_DAY
) -> sl.DoorLog:
    """`front` is open from 8 to 18 on working days, `store` never; nobody looks at `attic`.

    Each day is a commit, made at its 20:00.
    """
    midnight_ns = parse_instant(first, tz=tz)
    clock = SteadyClock(midnight_ns)
    with sl.create(path, tz=tz, clock=clock) as log:
        log.append([DoorAdded(door_id=door, x=float(door), y=0, theta=0, width=1)
                    for door in (FRONT, STORE, ATTIC)])  # fmt: skip
        names = ((FRONT, "front"), (STORE, "store"), (ATTIC, "attic"))
        log.append([DoorAnnotated(door_id=door, key="name", value=name) for door, name in names])
        for day in range(days):
            date = f"{_date(midnight_ns + day * DAY_NS + DAY_NS // 2, tz)}"
            clock.now_ns = parse_instant(f"{date}T20:00", tz=tz)
            log.append(_day(date, tz))
    return sl.read(path)


def _day(date: str, tz: str) -> list[Event]:
    works = dt.date.fromisoformat(date).weekday() < 5
    return [
        DoorObserved(
            door_id=door, state=DoorState.OPEN if is_open else DoorState.CLOSED,
            accuracy_open=0.95, accuracy_closed=0.95,
            happened_ns=parse_instant(f"{date}T{hour:02}:30", tz=tz),
        )
        for hour in ROUNDS
        for door, is_open in ((FRONT, works and hour in OPEN_HOURS), (STORE, False))
    ]  # fmt: skip


def _date(ns: int, tz: str) -> str:
    return format_local(ns, tz)[:10]
