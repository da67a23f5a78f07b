"""Floor plans as pictures can show them."""

from __future__ import annotations

import numpy as np

from semmap_log.core.model.events import FloorMap
from semmap_log.views.plots.room_plans import plan_cells


def plan(cells: np.ndarray) -> FloorMap:
    return FloorMap(level=0, resolution=0.5, origin_x=1.0, origin_y=2.0, cells=cells)


def test_a_small_plan_is_shown_as_it_is() -> None:
    """All of its cells, where they are."""
    cells = np.arange(12, dtype=np.int8).reshape(3, 4)

    shown, covered = plan_cells(plan(cells))

    assert shown is cells
    assert covered == (1.0, 3.0, 2.0, 3.5)


def test_of_a_large_plan_no_wall_is_lost() -> None:
    """Blocks of 3 x 3 cells, the last ones cut off; a block is what its most occupied cell is."""
    cells = np.full((10, 11), -1, np.int8)
    cells[4, :] = 0
    cells[:, 10] = 100

    shown, covered = plan_cells(plan(cells), most_cells=13)

    assert shown.tolist() == [[-1, -1, -1, 100], [0, 0, 0, 100], [-1, -1, -1, 100],
                              [-1, -1, -1, 100]]  # fmt: skip
    assert covered == (1.0, 7.0, 2.0, 8.0)
