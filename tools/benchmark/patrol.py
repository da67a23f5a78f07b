"""The events that are measured: a patrol's, made from a seed; the same count, the same events.

They are drawn as numpy columns, a block at a time, so that ten million take seconds and little
memory; as events they are what a log is given.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from semmap_log.core.model.events import DoorObserved, Event

START_NS = 1_772_406_000 * 10**9
"""Monday 2 March 2026, 00:00 in Vienna."""
STEP_NS = 10 * 10**9
"""From one event to the next: some 8,640 a day."""
LATE_SHARE, LATE_S = 0.02, 3600
"""How many events are told up to an hour late: radio gaps, people who note things down later."""

DOORS = 100
REMOVALS = {5_000: 100, 50_000: 99}
"""Event number -> door that is taken out there, if there are so many doors."""
BLOCK = 122_880
"""Events that are drawn together."""

ADDED, UPDATED, REMOVED, OBSERVED, REQUESTED, PASSED, POSE, NAMED = range(8)
"""What an event is; the later ones of a patrol: see `SHARES`."""
SHARES = {OBSERVED: 0.70, POSE: 0.18, UPDATED: 0.05, PASSED: 0.04, REQUESTED: 0.03}
SURVEYED_SHARE = 0.1
"""Of the updates: pose and width measured anew; the others set state and P(open)."""

UNKNOWN, OPEN, CLOSED = 0, 1, 2
CHANGED_PLACE, CHANGED_STATE = 1 | 2, 4 | 8
"""DoorUpdated.changed: POSE | WIDTH, STATE | PROB_OPEN."""

ROW = np.dtype([
    ("number", "i8"), ("happened_ns", "i8"), ("what", "u1"), ("door_id", "u4"), ("state", "u1"),
    ("changed", "u1"), ("passed", "?"), ("x", "f8"), ("y", "f8"), ("theta", "f8"),
    ("width", "f8"), ("value", "f8"),
])  # fmt: skip
"""An event as a row: `value` is the opening, P(open), or how long the robot waited."""

_DRAWN = ("door", "late", "by", "state", "passed", "surveyed", "x", "y", "theta", "value")

Rows = NDArray[np.void]
T = TypeVar("T")


def blocks(count: int) -> Iterator[Rows]:
    """Yield a patrol's events as rows, `BLOCK` at a time: its doors, then what a robot sees."""
    doors = doors_of(count)
    for first in range(0, count, BLOCK):
        yield _block(first, min(BLOCK, count - first), doors)


def doors_of(count: int) -> int:
    """Return how many doors there are at the start of a patrol of so many events."""
    return max(1, min(DOORS, count // 20))


def patrol(count: int) -> Iterator[Event]:
    """Yield the same as events.

    Of those behind the doors 70 % are sightings, 18 % poses, 5 % updates, 4 % passages,
    3 % requests; two doors are removed on the way.
    """
    makers = _makers()
    for rows in blocks(count):
        names = ROW.names or ()
        for values in rows.tolist():
            row = dict(zip(names, values, strict=True))
            yield makers[row["what"]](row)


def _block(first: int, count: int, doors: int) -> Rows:
    rng = np.random.default_rng([2026, first // BLOCK])
    rows = np.zeros(count, ROW)
    number = rows["number"] = first + np.arange(count)
    rows["happened_ns"] = START_NS + number * STEP_NS
    kinds, shares = list(SHARES), list(SHARES.values())
    rows["what"] = rng.choice(np.array(kinds, "u1"), BLOCK, p=shares)[:count]
    here = np.full(count, doors)
    for at, door in REMOVALS.items():
        here -= (number >= at) & (door <= doors)
    draws = {name: rng.random(BLOCK)[:count] for name in _DRAWN}
    rows["door_id"] = 1 + (draws["door"] * here).astype("u4")
    rows["state"] = np.where(draws["state"] < 0.3, OPEN, CLOSED)
    rows["passed"] = draws["passed"] < 0.9
    surveyed = draws["surveyed"] < SURVEYED_SHARE
    rows["changed"] = np.where(surveyed, CHANGED_PLACE, CHANGED_STATE)
    rows["x"], rows["y"], rows["theta"] = draws["x"] * 40, draws["y"] * 20, draws["theta"]
    rows["width"], rows["value"] = 0.9 + draws["y"] / 10, draws["value"]
    late_ns = (draws["by"] * LATE_S).astype("i8") * 10**9
    rows["happened_ns"] -= np.where(draws["late"] < LATE_SHARE, late_ns, 0)
    rows["happened_ns"] = np.maximum(rows["happened_ns"], START_NS)
    _build(rows, doors)
    return rows


def _build(rows: Rows, doors: int) -> None:
    """Put in what is not drawn: each door is added and named at the start, two are removed."""
    for i in np.flatnonzero(rows["number"] < 2 * doors).tolist():
        door, named = divmod(int(rows["number"][i]), 2)
        rows[i] = (rows["number"][i], START_NS, NAMED if named else ADDED, 1 + door, UNKNOWN, 0,
                   False, door % 20, 1.5, 0.0, 0.9, 0.5)  # fmt: skip
    for at, door in REMOVALS.items():
        i = at - int(rows["number"][0])
        if 0 <= i < len(rows) and door <= doors:
            rows["what"][i], rows["door_id"][i] = REMOVED, door
            rows["happened_ns"][i] = START_NS + at * STEP_NS


def _makers() -> dict[int, Callable[[dict[str, Any]], Event]]:
    """Return what makes an event of a row."""
    from semmap_log.core.model.doors import DoorState
    from semmap_log.core.model.events import (
        Changed,
        DoorAdded,
        DoorAnnotated,
        DoorObserved,
        DoorPassed,
        DoorRemoved,
        DoorRequested,
        DoorUpdated,
        RobotPose,
    )

    states = (DoorState.UNKNOWN, DoorState.OPEN, DoorState.CLOSED)
    changes = {bits: Changed(bits) for bits in (CHANGED_PLACE, CHANGED_STATE)}

    def updated(row: dict[str, Any]) -> Event:
        about = {"happened_ns": row["happened_ns"], "door_id": row["door_id"],
                 "changed": changes[row["changed"]]}  # fmt: skip
        if row["changed"] == CHANGED_STATE:
            return DoorUpdated(**about, state=states[row["state"]], prob_open=row["value"])
        return DoorUpdated(**about, x=row["x"], y=row["y"], theta=row["theta"], width=row["width"])

    return {
        ADDED: lambda row: DoorAdded(
            happened_ns=row["happened_ns"], door_id=row["door_id"], x=row["x"], y=row["y"],
            theta=row["theta"], width=row["width"], prob_open=row["value"],
            prob_closed=row["value"],
        ),
        NAMED: lambda row: DoorAnnotated(
            happened_ns=row["happened_ns"], door_id=row["door_id"], key="name",
            value=name_of(row["door_id"]),
        ),
        UPDATED: updated,
        REMOVED: lambda row: DoorRemoved(happened_ns=row["happened_ns"], door_id=row["door_id"]),
        OBSERVED: lambda row: DoorObserved(
            happened_ns=row["happened_ns"], door_id=row["door_id"], state=states[row["state"]],
            accuracy_open=0.9, accuracy_closed=0.95, opening=row["value"],
        ),
        REQUESTED: lambda row: DoorRequested(
            happened_ns=row["happened_ns"], door_id=row["door_id"], state=DoorState.OPEN
        ),
        PASSED: lambda row: DoorPassed(
            happened_ns=row["happened_ns"], door_id=row["door_id"], passed=row["passed"],
            waited_s=row["value"] * 30,
        ),
        POSE: lambda row: RobotPose(
            happened_ns=row["happened_ns"], x=row["x"], y=row["y"], theta=row["theta"],
            sd_xy=0.05, sd_theta=0.02,
        ),
    }  # fmt: skip


def name_of(door_id: int) -> str:
    """Return what a door is called."""
    return f"door {door_id}"


def sightings(count: int) -> Iterator[DoorObserved]:
    """Yield that many sightings of the doors 1 to 100."""
    from semmap_log.core.model.doors import DoorId, DoorState
    from semmap_log.core.model.events import DoorObserved

    draw = np.random.default_rng(1).random(2 * count).tolist()
    states = (DoorState.CLOSED, DoorState.OPEN)
    for i in range(count):
        yield DoorObserved(
            happened_ns=START_NS + i * STEP_NS, door_id=DoorId(1 + i % 100),
            state=states[draw[2 * i] < 0.3], accuracy_open=0.9, accuracy_closed=0.95,
            opening=draw[2 * i + 1],
        )  # fmt: skip


def grouped(events: Iterable[T], size: int) -> Iterator[list[T]]:
    """Yield lists of `size` events, the last maybe shorter."""
    iterator = iter(events)
    while group := list(islice(iterator, size)):
        yield group
