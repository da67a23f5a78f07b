"""Ways through doors and lifts, from place to place, where each door can be shut.

The nodes are the cells on both sides of each door. Within a connected part of the floor the
distances between them are measured once and kept. A door that is not shut joins its two nodes, a
lift those before its doors. So a query with other doors shut needs no new look at the floor.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.rooms.level_rooms import Point
from semmap_log.analysis.rooms.regions import Costs
from semmap_log.analysis.rooms.room_graph import Lift
from semmap_log.analysis.rooms.walking_floor import Spot, WalkingFloor
from semmap_log.core.model.doors import Door, DoorId

LEFT, RIGHT = 1.0, -1.0
SAME = 1e-9
"""Sums of the same numbers in another order differ by less."""


@dataclass(frozen=True, slots=True)
class Place:
    """A point on a level, metres, frame `map`."""

    level: int
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class _Node:
    """Where a robot stands before a door."""

    level: int
    spot: Spot
    """Its own cell, at a distance of 0 m."""
    to_door_m: float
    """From there to the middle of the door."""


@dataclass(frozen=True, slots=True)
class _Passage:
    """Two nodes that a door or a lift joins, both ways."""

    one: int
    other: int
    metres: float
    rides: int
    """How many lift rides it takes."""
    doors: tuple[DoorId, ...]
    """Those that it leads through: it is shut when one of them is."""


class DoorWays:
    """The doors of some levels, and the costs of ways between places."""

    def __init__(self, floors: Mapping[int, WalkingFloor], lifts: Iterable[Lift] = ()) -> None:
        self._floors = floors
        self._nodes: list[_Node] = []
        self._at_door: dict[DoorId, dict[float, int]] = {}
        for floor in floors.values():
            for door in floor.doors:
                self._at_door[door.door_id] = dict(self._added(floor, door))
        self._passages = [*self._through_doors(), *self._by_lifts(lifts)]
        self._parts: dict[Part, list[int]] = {}
        for number, node in enumerate(self._nodes):
            self._parts.setdefault((node.level, node.spot.region), []).append(number)
        cells = {
            part: [self._nodes[number].spot.flat for number in numbers]
            for part, numbers in self._parts.items()
        }
        self._measured = MeasuredParts(floors, cells)
        self._kept_legs: dict[Part, Metres] = {}

    def before(self, door_id: DoorId, side: float) -> Place | None:
        """Return where the robot stands on a side of a door; None: there is no floor for it.

        Args:
            door_id: The door.
            side: `LEFT` or `RIGHT` of its line, looking from its start along theta.
        """
        number = self._at_door.get(door_id, {}).get(side)
        if number is None:
            return None
        node = self._nodes[number]
        return Place(node.level, *self._floors[node.level].point_of(node.spot.flat))

    def costs(
        self,
        sources: Sequence[Place],
        targets: Sequence[Place],
        *,
        shut: Collection[DoorId] = (),
        metre: float = 1.0,
        ride: float = 0.0,
    ) -> NDArray[np.float64]:
        """Return the costs of the best ways: (sources, targets); inf: there is no way.

        Args:
            sources: The starts.
            targets: The ends.
            shut: Doors that let nobody through.
            metre: The cost of a metre.
            ride: The cost of a lift ride.
        """
        starts, ends = self._spots(sources), self._spots(targets)
        nodes = [(node.level, node.spot) for node in self._nodes]
        best = self._direct(starts, ends) * metre
        reached = self._through(self._direct(starts, nodes) * metre, shut, metre, ride)
        last = self._direct(nodes, ends) * metre
        for node in range(len(nodes)):
            np.minimum(best, reached[:, node, None] + last[None, node], out=best)
        return best

    def way(
        self,
        source: Place,
        target: Place,
        *,
        shut: Collection[DoorId] = (),
        metre: float = 1.0,
        ride: float = 0.0,
    ) -> list[Place] | None:
        """Return the corners of a best way, from place to place; None: there is none.

        Args:
            source: The start.
            target: The end.
            shut: Doors that let nobody through.
            metre: The cost of a metre.
            ride: The cost of a lift ride.
        """
        start, end = self._spots([source, target])
        if start is None or end is None:
            return None
        nodes = [(node.level, node.spot) for node in self._nodes]
        first = self._direct([start], nodes)[0] * metre
        reached = self._through(first[None, :].copy(), shut, metre, ride)[0]
        last = reached + self._direct(nodes, [end])[:, 0] * metre
        direct = float(self._direct([start], [end])[0, 0]) * metre
        if not math.isfinite(min(direct, last.min(initial=math.inf))):
            return None
        chain = [] if direct <= last.min(initial=math.inf) else self._chain(
            int(last.argmin()), first, reached, (frozenset(shut), metre, ride)
        )  # fmt: skip
        stops = [start, *(nodes[number] for number in chain), end]
        corners = [source]
        for here, there in pairwise(stops):
            corners += self._corners(here, there)
        return [*corners, target]

    def _chain(
        self,
        node: int,
        first: NDArray[np.float64],
        reached: NDArray[np.float64],
        how: tuple[frozenset[DoorId], float, float],
    ) -> list[int]:
        """Return the nodes of a best way to one of them, that one last."""
        shut, metre, ride = how
        chain = [node]
        while not math.isclose(first[chain[0]], reached[chain[0]]):
            here = chain[0]
            steps = dict(self._steps_to(here, shut, metre, ride))
            before = [
                other
                for other, cost in steps.items()
                if other not in chain
                and math.isclose(reached[other] + cost, reached[here], abs_tol=SAME)
            ]
            chain.insert(0, min(before, key=lambda other: reached[other]))
        return chain

    def _steps_to(
        self, node: int, shut: frozenset[DoorId], metre: float, ride: float
    ) -> Iterator[tuple[int, float]]:
        """Yield the nodes from which one step leads to another, with what it costs."""
        part = (self._nodes[node].level, self._nodes[node].spot.region)
        legs, numbers = self._legs(part), self._parts[part]
        yield from zip(numbers, (legs[:, numbers.index(node)] * metre).tolist(), strict=True)
        for each in self._passages:
            if node in (each.one, each.other) and shut.isdisjoint(each.doors):
                other = each.other if node == each.one else each.one
                yield other, each.metres * metre + each.rides * ride

    def _corners(self, here: tuple[int, Spot], there: tuple[int, Spot]) -> list[Place]:
        """Return the corners of the way between two stops: over the floor, or through a door."""
        (level, one), (other_level, other) = here, there
        if (level, one.region) == (other_level, other.region):
            points = self._measured.way((level, one.region), one.flat, other.flat)
            return [Place(level, *point) for point in points]
        return [
            Place(level, *self._floors[level].point_of(one.flat)),
            Place(other_level, *self._floors[other_level].point_of(other.flat)),
        ]

    def _added(self, floor: WalkingFloor, door: Door) -> Iterable[tuple[float, int]]:
        """Add the nodes of a door; yield each side with the number of its node."""
        for side in (LEFT, RIGHT):
            spot = floor.before(door, side)
            if spot is not None:
                yield side, len(self._nodes)
                self._nodes.append(
                    _Node(floor.level, replace(spot, from_cell_m=0.0), spot.from_cell_m)
                )

    def _through_doors(self) -> Iterable[_Passage]:
        for door_id, sides in self._at_door.items():
            if len(sides) == 2:
                yield self._passage(sides[LEFT], sides[RIGHT], 0, (door_id,))

    def _by_lifts(self, lifts: Iterable[Lift]) -> Iterable[_Passage]:
        """Yield the rides from door to door of each lift, on two levels."""
        for lift in lifts:
            for one, other in combinations(lift.doors, 2):
                for a in self._at_door.get(one, {}).values():
                    for b in self._at_door.get(other, {}).values():
                        if self._nodes[a].level != self._nodes[b].level:
                            yield self._passage(a, b, 1, (one, other))

    def _passage(self, one: int, other: int, rides: int, doors: tuple[DoorId, ...]) -> _Passage:
        metres = self._nodes[one].to_door_m + self._nodes[other].to_door_m
        return _Passage(one, other, metres, rides, doors)

    def _spots(self, places: Sequence[Place]) -> list[tuple[int, Spot] | None]:
        """Return the cells of places; None: the robot cannot stand there."""
        found: list[tuple[int, Spot] | None] = []
        for place in places:
            floor = self._floors.get(place.level)
            spot = floor.spot(place.x, place.y) if floor else None
            found.append(None if spot is None else (place.level, spot))
        return found

    def _through(
        self, reached: Metres, shut: Collection[DoorId], metre: float, ride: float
    ) -> NDArray[np.float64]:
        """Return the costs to all nodes through doors, from those without: (sources, nodes)."""
        closed = frozenset(shut)
        usable = [each for each in self._passages if closed.isdisjoint(each.doors)]
        came = np.array([each.one for each in usable] + [each.other for each in usable], np.int64)
        went = np.array([each.other for each in usable] + [each.one for each in usable], np.int64)
        cost = np.array([each.metres * metre + each.rides * ride for each in usable] * 2)
        while True:
            passed = reached.T.copy()
            np.minimum.at(passed, went, (reached[:, came] + cost).T)
            passed = passed.T
            nearer = (passed < reached).any(axis=0)
            if not nearer.any():
                return reached
            reached = self._onward(passed, nearer, metre)

    def _onward(
        self, reached: NDArray[np.float64], nearer: NDArray[np.bool_], metre: float
    ) -> NDArray[np.float64]:
        """Return the costs after walking on from the nodes that are nearer than they were."""
        for part, numbers in self._parts.items():
            rows = np.flatnonzero(nearer[numbers])
            if not len(rows):
                continue
            legs = self._legs(part) * metre
            for row in rows.tolist():
                found = reached[:, numbers[row], None] + legs[row]
                reached[:, numbers] = np.minimum(reached[:, numbers], found)
        return reached

    def _legs(self, part: Part) -> Metres:
        """Return the distances between the nodes of a part."""
        if part not in self._kept_legs:
            spots = [self._nodes[number].spot for number in self._parts[part]]
            self._kept_legs[part] = self._measured.between(part, spots, spots)
        return self._kept_legs[part]

    def _direct(
        self, sources: Sequence[tuple[int, Spot] | None], targets: Sequence[tuple[int, Spot] | None]
    ) -> Metres:
        """Return how far it is between cells without passing a door: (sources, targets)."""
        found = np.full((len(sources), len(targets)), np.inf)
        ends = _by_part(targets)
        for part, starts in _by_part(sources).items():
            if part in ends:
                rows, columns = [row for row, _ in starts], [column for column, _ in ends[part]]
                found[np.ix_(rows, columns)] = self._measured.between(
                    part, [spot for _, spot in starts], [spot for _, spot in ends[part]]
                )
        return found


def _by_part(
    spots: Sequence[tuple[int, Spot] | None],
) -> dict[Part, list[tuple[int, Spot]]]:
    """Return the spots of each part, with their numbers."""
    parts: dict[Part, list[tuple[int, Spot]]] = {}
    for number, each in enumerate(spots):
        if each is not None:
            level, spot = each
            parts.setdefault((level, spot.region), []).append((number, spot))
    return parts


Metres = NDArray[np.float64]
Part = tuple[int, int]
"""A level, and the label of a connected part of its floor."""

MOST_TOGETHER = 16_000_000
"""Costs that are computed together: 64 MB."""
MOST_KEPT = 64_000_000
"""Costs that are kept, of fields that start before doors."""


class MeasuredParts:
    """The measured distances of some floors."""

    def __init__(
        self, floors: Mapping[int, WalkingFloor], kept: Mapping[Part, Collection[int]]
    ) -> None:
        """Start without any measurement.

        Args:
            floors: By level.
            kept: The cells of a part, row x width + column, whose fields are worth keeping.
        """
        self._floors = floors
        self._worth = {part: frozenset(cells) for part, cells in kept.items()}
        self._kept: dict[Part, dict[int, Costs]] = {}
        self._room = MOST_KEPT

    def between(self, part: Part, sources: Sequence[Spot], targets: Sequence[Spot]) -> Metres:
        """Return the metres of walking between spots of a part: (sources, targets)."""
        starts, ends = _cells(sources), _cells(targets)
        if len(self._missing(part, ends)) < len(self._missing(part, starts)):
            turned: Metres = self.between(part, targets, sources).T
            return turned
        rows, row_of = np.unique(starts, return_inverse=True)
        columns, column_of = np.unique(ends, return_inverse=True)
        costs = self._costs(part, rows, columns)[np.ix_(row_of, column_of)]
        beside = np.array([[spot.from_cell_m] for spot in sources])
        beside = beside + np.array([[spot.from_cell_m for spot in targets]])
        found: Metres = costs * self._floors[part[0]].metres + beside
        return found

    def way(self, part: Part, source: int, target: int) -> list[Point]:
        """Return the corners of a shortest way between two cells of a part, both included."""
        floor, measured = self._floors[part[0]], self._floors[part[0]].field(part[1])
        field = self._field_from(part, source)
        cells, step = [target], 0
        while cells[-1] != source:
            here = cells[-1]
            cost = int(field[measured.index_of(np.array([here]))[0]])
            ways = [(beside - here, beside, spent) for beside, spent in floor.beside(here)]
            onward = {
                turn: beside
                for turn, beside, spent in ways
                if field[measured.index_of(np.array([beside]))[0]] == cost - spent
            }
            turn = step if step in onward else min(onward)
            if turn == step and len(cells) > 1:
                cells.pop()  # straight on
            cells.append(onward[turn])
            step = turn
        return [floor.point_of(cell) for cell in cells[::-1]]

    def _field_from(self, part: Part, cell: int) -> Costs:
        """Return the costs from a cell to all cells of its part."""
        kept = self._kept.get(part, {}).get(cell)
        if kept is not None:
            return kept
        measured = self._floors[part[0]].field(part[1])
        return measured.from_cells(measured.index_of(np.array([cell])))[:, 0]

    def _missing(self, part: Part, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        kept = self._kept.get(part, {})
        return np.array([c for c in np.unique(cells).tolist() if c not in kept], np.int64)

    def _costs(
        self, part: Part, starts: NDArray[np.int64], ends: NDArray[np.int64]
    ) -> NDArray[np.int32]:
        """Return the costs between cells, measured where they are not kept: (starts, ends)."""
        measured = self._floors[part[0]].field(part[1])
        rows = {int(cell): row for row, cell in enumerate(starts)}
        columns = measured.index_of(ends)
        found = np.empty((len(starts), len(ends)), np.int32)
        for cell, field in self._kept.get(part, {}).items():
            if cell in rows:
                found[rows[cell]] = field[columns]
        missing = self._missing(part, starts)
        batch = max(1, MOST_TOGETHER // measured.size)
        for first in range(0, len(missing), batch):
            cells = missing[first : first + batch]
            fields = measured.from_cells(measured.index_of(cells))
            for column, cell in enumerate(cells.tolist()):
                found[rows[cell]] = fields[columns, column]
                self._keep(part, cell, fields[:, column])
        return found

    def _keep(self, part: Part, cell: int, field: Costs) -> None:
        if cell in self._worth.get(part, ()) and self._room >= len(field):
            self._room -= len(field)
            self._kept.setdefault(part, {})[cell] = field.copy()


def _cells(spots: Sequence[Spot]) -> NDArray[np.int64]:
    return np.array([spot.flat for spot in spots], np.int64)
