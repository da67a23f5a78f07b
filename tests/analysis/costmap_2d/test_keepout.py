"""The mask for Nav2's KeepoutFilter, and what the filter makes of it."""

import numpy as np

from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, LETHAL, NO_INFORMATION
from semmap_log.analysis.costmap_2d.keepout import keepout_mask


def filtered(master, mask):
    """keepout_filter.cpp: Costmap2D(OccupancyGrid) of the mask, then process()."""

    def cost(value):
        return 255 if value == -1 else round(value / 100 * 254)

    def cell(old, data):
        if data == 255:
            return old
        return data if data > old or old == 255 else old

    return [
        [cell(old, cost(value)) for old, value in zip(olds, values, strict=True)]
        for olds, values in zip(master.tolist(), mask.tolist(), strict=True)
    ]


def test_closed_doors_are_kept_out_of_and_nothing_else():
    """Open and unknown doors, and floor without doors, leave the costmap as it is."""
    layer = np.array([[LETHAL, FREE_SPACE, NO_INFORMATION, LETHAL]], np.uint8)
    master = np.array([[0, 255, 255, 255]], np.uint8)

    mask = keepout_mask(layer)

    assert [[100, -1, -1, 100]] == mask.tolist()
    assert np.int8 == mask.dtype
    assert [[254, 255, 255, 254]] == filtered(master, mask)


def test_a_mask_of_zeros_would_free_unknown_space():
    """Why the rest is -1; who wants it can have it."""
    layer = np.array([[LETHAL, NO_INFORMATION]], np.uint8)

    mask = keepout_mask(layer, elsewhere=0)

    assert [[100, 0]] == mask.tolist()
    assert [[254, 0]] == filtered(np.full((1, 2), 255, np.uint8), mask)


def test_a_door_that_is_probably_closed_costs_in_between():
    """As the costmap would publish it."""
    assert [[1, 50, 98, 99]] == keepout_mask(np.array([[1, 128, 252, 253]], np.uint8)).tolist()
