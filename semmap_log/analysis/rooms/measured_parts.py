"""Distances between spots on connected parts of floors, measured once and kept."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.rooms.distance_fields import Costs
from semmap_log.analysis.rooms.strokes import Point
from semmap_log.analysis.rooms.walking_floor import Spot, WalkingFloor

Metres = NDArray[np.float64]
Part = tuple[int, int]
"""A level, and the label of a connected part of its floor."""

MOST_TOGETHER = 16_000_000
"""So many costs are worked out together: 64 MB."""
MOST_KEPT = 64_000_000
"""So many are kept, of fields that start before doors."""


class MeasuredParts:
    """What has been measured of some floors."""

    def __init__(
        self, floors: Mapping[int, WalkingFloor], kept: Mapping[Part, Collection[int]]
    ) -> None:
        """Nothing yet.

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
        beside = np.array([[spot.beside_m] for spot in sources])
        beside = beside + np.array([[spot.beside_m for spot in targets]])
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
