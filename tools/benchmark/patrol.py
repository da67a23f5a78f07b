"""The events that are measured: a patrol's, made from a seed; the same count, the same events."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from semmap_log.events import DoorObserved, Event

START_NS = 1_772_406_000 * 10**9
"""Monday 2 March 2026, 00:00 in Vienna."""
STEP_NS = 10 * 10**9
"""From one event to the next: some 8,640 a day."""
LATE_SHARE = 0.02
"""How many events are told up to an hour late: radio gaps, people who note things down later."""

T = TypeVar("T")


def patrol(count: int) -> Iterator[Event]:
    """Yield a building's doors, then what a robot sees of them, `count` events in all.

    Of the later ones 70 % are sightings, 18 % poses, 5 % updates, 4 % passages, 3 % requests.
    """
    from semmap_log.doors import DoorId, DoorState
    from semmap_log.events import (
        Changed,
        DoorAdded,
        DoorAnnotated,
        DoorObserved,
        DoorPassed,
        DoorRequested,
        DoorUpdated,
        RobotPose,
    )

    def build() -> Iterator[Event]:
        for door in range(1, doors + 1):
            yield DoorAdded(happened_ns=START_NS, door_id=DoorId(door), x=float(door % 20), y=1.5,
                            theta=0.0, width=0.9, prob_open=0.5, prob_closed=0.5)  # fmt: skip
            yield DoorAnnotated(
                happened_ns=START_NS, door_id=DoorId(door), key="name", value=f"door {door}"
            )

    def drive() -> Iterator[Event]:
        for i in range(2 * doors, count):
            happened_ns = START_NS + i * STEP_NS
            if draw() < LATE_SHARE:
                happened_ns = max(START_NS, happened_ns - int(draw() * 3600) * 10**9)
            door = DoorId(1 + int(draw() * doors))
            state = states[draw() < 0.3]
            kind = draw()
            if kind < 0.70:
                yield DoorObserved(
                    happened_ns=happened_ns,
                    door_id=door,
                    state=state,
                    accuracy_open=0.9,
                    accuracy_closed=0.95,
                    opening=draw(),
                )
            elif kind < 0.88:
                yield RobotPose(
                    happened_ns=happened_ns,
                    x=draw() * 40,
                    y=draw() * 20,
                    theta=draw(),
                    sd_xy=0.05,
                    sd_theta=0.02,
                )
            elif kind < 0.93:
                yield DoorUpdated(
                    happened_ns=happened_ns,
                    door_id=door,
                    changed=Changed.STATE | Changed.PROB_OPEN,
                    state=state,
                    prob_open=draw(),
                )
            elif kind < 0.97:
                yield DoorPassed(
                    happened_ns=happened_ns, door_id=door, passed=draw() < 0.9, waited_s=draw() * 30
                )
            else:
                yield DoorRequested(happened_ns=happened_ns, door_id=door, state=DoorState.OPEN)

    doors = max(1, min(500, count // 20))
    draw = random.Random(count).random
    states = (DoorState.CLOSED, DoorState.OPEN)
    yield from islice(build(), count)
    yield from drive()


def sightings(count: int) -> Iterator[DoorObserved]:
    """Yield that many sightings of the doors 1 to 100."""
    from semmap_log.doors import DoorId, DoorState
    from semmap_log.events import DoorObserved

    draw = random.Random(1).random
    states = (DoorState.CLOSED, DoorState.OPEN)
    for i in range(count):
        yield DoorObserved(
            happened_ns=START_NS + i * STEP_NS, door_id=DoorId(1 + i % 100),
            state=states[draw() < 0.3], accuracy_open=0.9, accuracy_closed=0.95, opening=draw(),
        )  # fmt: skip


def grouped(events: Iterable[T], size: int) -> Iterator[list[T]]:
    """Yield lists of `size` events, the last maybe shorter."""
    iterator = iter(events)
    while group := list(islice(iterator, size)):
        yield group
