"""Where logs do not agree about a door that they share, and which doors may be one by geometry."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

from semmap_log.fleet.join.door_matches import DoorRow
from semmap_log.fleet.join.door_plan import BuildingDoor, DoorPlan, LogDoor
from semmap_log.fleet.join.joined_logs import JoinedLogs

TOLERANCE_M = 0.3
"""Ends of one door that lie farther apart are two meanings of it."""
NEAR_M = 0.6
"""Doors whose ends lie nearer are proposed as one."""

Ends = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class DoorConflict:
    """What two logs say of one door; the later event counts, whoever told it."""

    door: BuildingDoor
    what: str
    """`geometry`, `type`, `level` or `removed`."""
    says: tuple[str, str]
    """Log and value, of the one and of the other."""


@dataclass(frozen=True, slots=True)
class DoorProposal:
    """Two doors that lie at the same place."""

    first: LogDoor
    second: LogDoor
    apart_m: float
    """How far their ends lie apart at most."""

    def rows(self) -> Iterator[DoorRow]:
        """Yield the rows of a table by which they would be one."""
        name = self.first.door.name or self.second.door.name
        called = name or f"{self.first.log}/{self.first.door_id}"
        for each in (self.first, self.second):
            yield DoorRow(each.log, f"id:{each.door_id}", called)


def door_conflicts(joined: JoinedLogs, plan: DoorPlan) -> list[DoorConflict]:
    """Return where logs differ about shared doors, by the doors' numbers."""
    return [
        DoorConflict(door, what, says)
        for door in plan.doors
        for one, other in combinations(sorted(door.doors, key=_key), 2)
        if one.log != other.log
        for what, says in _differing(joined, plan, one, other)
    ]


def _key(each: LogDoor) -> tuple[str, int]:
    return each.log, each.door_id


def _differing(
    joined: JoinedLogs, plan: DoorPlan, one: LogDoor, other: LogDoor
) -> Iterator[tuple[str, tuple[str, str]]]:
    logs = (one.log, other.log)

    def said(*values: object) -> tuple[str, str]:
        first, second = (f"{log}: {value}" for log, value in zip(logs, values, strict=True))
        return first, second

    if one.is_present != other.is_present:
        values = ("there" if each.is_present else "removed" for each in (one, other))
        yield "removed", said(*values)
    levels = [plan.levels.of(each.log, each.door.level) for each in (one, other)]
    if levels[0] != levels[1]:
        yield "level", said(*levels)
    types = [each.door.annotations.get("type") for each in (one, other)]
    if None not in types and types[0] != types[1]:
        yield "type", said(*types)
    ends = [_ends(joined, each) for each in (one, other)]
    if ends[0] and ends[1] and (apart := _apart(ends[0], ends[1])) > TOLERANCE_M:
        yield "geometry", said(*(f"{_told(each)}, {apart:.2f} m apart" for each in ends if each))


def _told(ends: Ends) -> str:
    return " to ".join(f"({x:.2f}, {y:.2f})" for x, y in ends)


def _ends(joined: JoinedLogs, each: LogDoor) -> Ends | None:
    """Return a door's ends in the building's frame; None: they are not known there."""
    frame = next(log.frame for log in joined.logs if log.name == each.log)
    if frame is None or not each.door.is_placed:
        return None
    start, end = (frame.moved(x, y, 0.0)[:2] for x, y in (each.door.start, each.door.end))
    return (float(start[0]), float(start[1])), (float(end[0]), float(end[1]))


def _apart(one: Ends, other: Ends) -> float:
    """Return how far the ends lie apart at most, in whichever order fits better."""
    return min(max(math.dist(one[0], other[i]), math.dist(one[1], other[1 - i])) for i in (0, 1))


def propose_doors(joined: JoinedLogs, plan: DoorPlan) -> list[DoorProposal]:
    """Return doors of two logs at one place, nearest first; each door once for each pair of logs.

    Only doors that are there, not shared yet, and of logs in the building's frame.
    """
    free = [door.doors[0] for door in plan.unmatched if door.doors[0].is_present]
    found = sorted(
        _near(joined, plan, free), key=lambda p: (p.apart_m, _key(p.first), _key(p.second))
    )
    taken: set[tuple[tuple[str, int], str]] = set()
    chosen = []
    for proposal in found:
        keys = {
            (_key(proposal.first), proposal.second.log),
            (_key(proposal.second), proposal.first.log),
        }
        if not keys & taken:
            taken |= keys
            chosen.append(proposal)
    return chosen


def _near(joined: JoinedLogs, plan: DoorPlan, doors: Sequence[LogDoor]) -> Iterator[DoorProposal]:
    placed = [(each, ends) for each in sorted(doors, key=_key) if (ends := _ends(joined, each))]
    for (one, one_ends), (other, other_ends) in combinations(placed, 2):
        levels = {plan.levels.of(each.log, each.door.level) for each in (one, other)}
        apart = _apart(one_ends, other_ends)
        if one.log != other.log and len(levels) == 1 and apart <= NEAR_M:
            yield DoorProposal(one, other, apart)
