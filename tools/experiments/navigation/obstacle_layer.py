"""The obstacle layer of a costmap: a laser's readings mark cells, and clear them.

costmap_2d's ObstacleLayer in two dimensions: beams clear the cells that they pass and mark those
in which they end; into the master comes the greater cost (`updateWithMax`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from navigation.floors import Cell
from navigation.laser import Scan
from semmap_log.analysis.costmap_2d.costs import LETHAL, NO_INFORMATION, bounds_of, maximum
from semmap_log.analysis.costmap_2d.grid import CellWindow, merged


class ObstacleLayer:
    """The layer: which cells are marked.

    Marks on walls of the static map are left out: they change nothing in the master.
    """

    reach = 0
    """A change of it concerns no cells but those that changed."""

    def __init__(self, walls: NDArray[np.bool_], margin: int) -> None:
        """Begin without a mark.

        Args:
            walls: (rows, columns), of the static map.
            margin: So many cells the laser's grid has more on each side.
        """
        self._open = np.pad(~walls, margin)
        self._marked = np.zeros(self._open.shape, np.bool_)
        rows, columns = walls.shape
        self._inside = (slice(margin, margin + rows), slice(margin, margin + columns))
        self._before = self.marked.copy()
        self._may_differ = False

    @property
    def marked(self) -> NDArray[np.bool_]:
        """(rows, columns) of the costmap."""
        return self._marked[self._inside]

    def take_in(self, scan: Scan) -> None:
        """Clear and mark as a scan tells."""
        marked = self._marked[scan.square]
        cells = marked.reshape(-1)  # a copy
        passed = scan.passed(cells)
        cells[passed] = False
        hits = scan.hits[self._open[scan.square].reshape(-1)[scan.hits]]
        cells[hits] = True
        if len(passed) or len(hits):
            marked[:] = cells.reshape(marked.shape)
            self._may_differ = True

    def forget(self, around: Cell, keep_cells: int) -> None:
        """Clear all but a square around the robot, as `clear_costmap_recovery` does."""
        row, column = around
        rows = slice(max(row - keep_cells, 0), row + keep_cells + 1)
        columns = slice(max(column - keep_cells, 0), column + keep_cells + 1)
        kept = self.marked[rows, columns].copy()
        self._marked[:] = False
        self.marked[rows, columns] = kept
        self._may_differ = True

    def take_changes(self) -> list[CellWindow]:
        """Return where marks changed since the last call."""
        if not self._may_differ:
            return []
        self._may_differ = False
        changed = self.marked != self._before
        if not changed.any():
            return []
        self._before = self.marked.copy()
        (whole,) = bounds_of(changed)
        rows, columns = np.nonzero(changed)
        if len(rows) > MOST_APART:
            return [whole]
        cells = zip(columns.tolist(), rows.tolist(), strict=True)
        return merged(CellWindow(x, y, x + 1, y + 1) for x, y in cells)

    def update_costs(self, master: NDArray[np.uint8], window: CellWindow) -> CellWindow:
        """Write the marks into the master, in that window."""
        marked = self.marked[window.slices]
        maximum(master[window.slices], np.where(marked, LETHAL, NO_INFORMATION).astype(np.uint8))
        return window


MOST_APART = 12
"""Up to so many changed cells are told one by one; more, as one window."""
