"""Doors found by place, so that a thousand doors cost what those in reach cost."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.placed_scan import DoorPlaces
from semmap_log.analysis.scans.scan_stack import FARTHEST

Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Rows of points and of doors, which belong together."""


class DoorGrid:
    """The doors of a moment, by level and square of the floor."""

    def __init__(self, doors: DoorPlaces, *, reach: float) -> None:
        self._reach = reach
        lines = doors.lines.reshape(-1, 4)
        # a door without a place, or with an absurd one, is met nowhere
        usable = (np.abs(lines) < FARTHEST).all(1) & (lines[:, 3] > 0)
        x, y, theta, width = np.where(usable[:, None], lines, 0).T
        self.middles = np.stack(
            [x + 0.5 * width * np.cos(theta), y + 0.5 * width * np.sin(theta)], axis=1
        )
        """(d, 2) m"""
        self._squares = self._by_square(doors.levels, usable)

    def _by_square(
        self, levels: NDArray[np.int64], usable: NDArray[np.bool_]
    ) -> dict[tuple[int, int, int], NDArray[np.intp]]:
        """Return the doors in each square and its eight neighbours."""
        near = defaultdict(list)
        for row in np.flatnonzero(usable).tolist():
            column, line = self._square(self.middles[row : row + 1])[0].tolist()
            for dx in (-1, 0, 1):
                for dy in (-1, 0, 1):
                    near[int(levels[row]), column + dx, line + dy].append(row)
        return {square: np.array(rows, np.intp) for square, rows in near.items()}

    def _square(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.floor(points / self._reach).astype(np.int64)

    def near(self, levels: NDArray[np.int64], points: NDArray[np.float64]) -> Pairs:
        """Return the pairs of a point (n, 2) and a door's middle within reach, on one level."""
        found: list[Pairs] = []
        keys = np.column_stack([levels, self._square(points)])
        squares, place = np.unique(keys, axis=0, return_inverse=True)
        for i, square in enumerate(squares.tolist()):
            doors = self._squares.get(tuple(square))
            if doors is None:
                continue
            rows = np.flatnonzero(place.ravel() == i)
            apart = points[rows, None] - self.middles[None, doors]
            at, door = np.nonzero((apart**2).sum(-1) < self._reach**2)
            found.append((rows[at], doors[door]))
        if not found:
            return np.empty(0, np.intp), np.empty(0, np.intp)
        points_of, doors_of = (np.concatenate(parts) for parts in zip(*found, strict=True))
        order = np.lexsort((doors_of, points_of))
        return points_of[order], doors_of[order]
