"""What a laser sees, cell by cell: 271 beams, one a degree, over 270 degrees.

Beams are cast from the middle of the robot's cell, in steps of half a cell: along each, the first
solid cell ends it. A reading has noise, and with it the cell that an obstacle layer would mark.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navigation.floors import Cell

Indices = NDArray[np.intp]

FIELD_DEG = 270
STEPS_A_CELL = 2


@dataclass(frozen=True)
class Scan:
    """What one turn of the laser tells; flat indices of the square that the laser reaches."""

    square: tuple[slice, slice]
    """Rows and columns of the padded grid that it is."""
    hits: Indices
    """Cells in which beams ended."""
    beams: Indices
    """(beams, steps): the cells along each."""
    until: Indices
    """(beams,): so many of them it passed."""

    def passed(self, cells: NDArray[np.bool_]) -> Indices:
        """Return which of these cells of the square beams went through; some more than once."""
        if not cells.any():
            return _NO_CELLS
        beam, step = np.nonzero(cells.take(self.beams, mode="clip"))
        before = step < self.until[beam]
        return self.beams[beam[before], step[before]]


_NO_CELLS = np.empty(0, np.intp)


class Laser:
    """The laser in a world of cells; the world has a margin as wide as the laser reaches."""

    def __init__(
        self, walls: NDArray[np.bool_], *, cell_m: float, range_m: float, noise_m: float,
        rng: np.random.Generator, clears_beyond: bool = False,
    ) -> None:  # fmt: skip
        """Put it into a world.

        Args:
            walls: (rows, columns), what is solid at first.
            cell_m: Metres a cell.
            range_m: What is farther away is not seen.
            noise_m: Standard deviation of a range.
            rng: Where noise comes from.
            clears_beyond: Also a beam that meets nothing has passed cells.
        """
        self._step_m = cell_m / STEPS_A_CELL
        self._noise_m, self._rng, self._clears_beyond = noise_m, rng, clears_beyond
        self.margin = math.ceil(range_m / cell_m) + 2
        self.solid = np.pad(walls, self.margin)
        """(rows, columns) with the margin; whoever moves doors writes here."""
        self._steps = int(range_m / self._step_m)
        self._beams = self._table()

    def _table(self) -> Indices:
        """Return (360, steps + 1): the cell of the square at each step along a bearing."""
        bearings = np.radians(np.arange(360))
        # One step more than is seen: noise may push the end of a beam there.
        far = np.arange(1, self._steps + 2) / STEPS_A_CELL
        rows = np.floor(np.sin(bearings)[:, None] * far + 0.5).astype(np.intp)
        columns = np.floor(np.cos(bearings)[:, None] * far + 0.5).astype(np.intp)
        table: Indices = (rows + self.margin) * (2 * self.margin + 1) + columns + self.margin
        return table

    def at(self, cell: Cell) -> int:
        """Return the flat index of a cell of the world."""
        width = int(self.solid.shape[1])
        return (cell[0] + self.margin) * width + cell[1] + self.margin

    def scan(self, cell: Cell, heading: float) -> Scan:
        """Return what is seen from a cell.

        Args:
            cell: Of the robot.
            heading: rad, the middle of the field of view.
        """
        first = round(math.degrees(heading)) - FIELD_DEG // 2
        bearings = np.arange(first, first + FIELD_DEG + 1) % 360
        return self._seen(cell, self._beams[bearings])

    def look_around(self, cell: Cell) -> Scan:
        """Return what is seen from a cell in a whole turn of the robot."""
        return self._seen(cell, self._beams)

    def sees(self, cell: Cell, bearing: float, distance_m: float) -> bool:
        """Tell whether nothing solid stands nearer than that in one direction."""
        steps = min(int(distance_m / self._step_m), self._steps)
        beam = self._beams[round(math.degrees(bearing)) % 360, :steps]
        return not self.solid[self._square(cell)].reshape(-1)[beam].any()

    def _square(self, cell: Cell) -> tuple[slice, slice]:
        """Return the rows and columns that it may reach from a cell."""
        side = 2 * self.margin + 1
        return slice(cell[0], cell[0] + side), slice(cell[1], cell[1] + side)

    def _seen(self, cell: Cell, beams: Indices) -> Scan:
        square = self._square(cell)
        is_solid = self.solid[square].reshape(-1).take(beams[:, :-1], mode="clip")
        end = is_solid.argmax(axis=1)
        met = is_solid[np.arange(len(beams)), end]
        # A beam ends within the first solid cell: one step inside it, give or take the noise.
        noise = self._rng.normal(0.0, self._noise_m / self._step_m, len(beams))
        read = np.clip(np.rint(end + 0.5 + noise).astype(np.intp), 0, self._steps)
        hits = beams[met, read[met]]
        until = np.where(met, np.minimum(end, read), self._steps if self._clears_beyond else 0)
        return Scan(square, hits, beams[:, :-1], until)
