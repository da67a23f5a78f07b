"""Doors as facts of a kernel: `(DOOR_STATE DOOR_3 OPEN)`, `(DOOR_PROBABILITY DOOR_3 0.75)`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from semmap_log.domain.doors import Door, DoorId, DoorMap
from semmap_log.oprs.expressions import NIL, Expression, Symbol

STATE, PROBABILITY, REMOVED = Symbol("DOOR_STATE"), Symbol("DOOR_PROBABILITY"), Symbol("REMOVED")


def all_facts(door_map: DoorMap, removed: Iterable[DoorId] = ()) -> list[Expression]:
    """Return what is to be told to a kernel of which nobody knows what it remembers.

    Args:
        door_map: The doors that there are.
        removed: Doors that there were: it may not have heard that they are gone.
    """
    doors = door_map.doors
    return [
        fact
        for door_id in sorted({*doors, *removed})
        for fact in _facts(door_id, None, doors.get(door_id))
    ]


def changed_facts(before: DoorMap, after: DoorMap) -> list[Expression]:
    """Return what is to be told to a kernel that knows the doors as they were.

    A door that is gone is in the state REMOVED; a probability that is not given is NIL.
    """
    return [
        fact
        for door_id in sorted({*before.doors, *after.doors})
        for fact in _facts(door_id, before.doors.get(door_id), after.doors.get(door_id))
    ]


def _facts(door_id: DoorId, before: Door | None, after: Door | None) -> Iterator[Expression]:
    door = Symbol(f"DOOR_{door_id}")
    state = Symbol(after.state.name) if after else REMOVED
    if before is None or after is None or before.state is not after.state:
        yield Expression(STATE, (door, state))
    probability = _probability(after)
    if before is None or after is None or _probability(before) != probability:
        yield Expression(PROBABILITY, (door, probability))


def _probability(door: Door | None) -> float | Symbol:
    return NIL if door is None or math.isnan(door.prob_open) else door.prob_open
