"""Cells as shades: what each cost looks like, on a screen and on a grey print."""

import numpy as np

from semmap_log.views.palette import (
    COST_FREE,
    COST_HATCH,
    COST_INSCRIBED,
    COST_LETHAL,
    COST_UNKNOWN,
    costs_of,
    shaded,
)


def test_y_points_up():
    """The grid's row 0 is the picture's last."""
    costs = np.array([[254, 0], [253, 255]], np.uint8)

    found = shaded(costs, 1).tolist()

    assert list(COST_INSCRIBED) == found[0][0]
    assert tuple(found[0][1]) in {COST_UNKNOWN, COST_HATCH}
    assert [list(COST_LETHAL), list(COST_FREE)] == found[1]


def test_costs_darken_as_they_rise():
    """As a grey print shows them: free, inflated, inscribed, lethal."""
    row = shaded(np.arange(255, dtype=np.uint8)[None], 1)[0].astype(float)

    grey = row @ [0.299, 0.587, 0.114]

    assert np.all(np.diff(grey) <= 0)
    steps = grey[[0, 1, 252, 253, 254]]
    assert np.all(np.diff(steps) < -15)


def test_unknown_is_hatched_and_nothing_else_is():
    """Its two greys are no cost's."""
    every = {tuple(shade) for shade in shaded(np.arange(255, dtype=np.uint8)[None], 1)[0].tolist()}

    unknown = {
        tuple(shade) for row in shaded(np.full((9, 9), 255, np.uint8), 1).tolist() for shade in row
    }

    assert {COST_UNKNOWN, COST_HATCH} == unknown
    assert not unknown & every


def test_a_wall_of_one_cell_survives_any_shrinking():
    """The dearest cell of a block shows; unknown only where nothing else is."""
    costs = np.full((7, 7), 255, np.uint8)
    costs[0, 0] = 0
    costs[5, 5] = 254

    found = shaded(costs, -4)

    assert (2, 2, 3) == found.shape
    assert COST_FREE == tuple(found[1, 0])
    assert COST_LETHAL == tuple(found[0, 1])
    assert tuple(found[0, 0]) in {COST_UNKNOWN, COST_HATCH}


def test_map_values_look_like_the_costs_they_stand_for():
    """What a costmap publishes as int8; and what is no map value is lethal."""
    values = np.array([[-1, 0, 1, 98, 99, 100, 101, -2]], np.int8)

    assert [[255, 0, 1, 252, 253, 254, 254, 254]] == costs_of(values).tolist()
