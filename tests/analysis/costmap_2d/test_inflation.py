"""Costs around obstacles: noetic's brushfire, and updates that are equal to it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    INSCRIBED,
    LETHAL,
    NO_INFORMATION,
    DoorLayer,
    DoorLine,
)
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry
from semmap_log.analysis.costmap_2d.layered import (
    Brushfire,
    InflationLayer,
    LayeredCostmap,
    StaticLayer,
)
from semmap_log.errors import CostmapError
from tests.analysis.costmap_2d import scalar


@st.composite
def inflations(draw: st.DrawFn) -> tuple[np.ndarray[Any, Any], dict[str, Any]]:
    """A grid of random costs, and parameters."""
    rows, columns = draw(st.integers(1, 30)), draw(st.integers(1, 30))
    dice = np.random.default_rng(draw(st.integers(0, 2**32)))
    grid = dice.choice(
        np.array([FREE_SPACE, LETHAL, NO_INFORMATION, 100], np.uint8),
        (rows, columns),
        p=draw(st.sampled_from([(0.97, 0.01, 0.01, 0.01), (0.6, 0.1, 0.2, 0.1), (0, 1, 0, 0)])),
    )
    resolution = draw(st.sampled_from([0.05, 0.1, 2.5]))
    return grid, {
        "resolution": resolution,
        "radius": draw(st.integers(0, 9)) * resolution * 0.99,
        "scaling": draw(st.sampled_from([0.0, 1.0, 10.0, 100.0])),
        "inscribed": draw(st.integers(0, 4)) * resolution,
        "inflate_unknown": draw(st.booleans()),
    }


@settings(max_examples=80, deadline=None)
@given(inflations())
def test_the_fire_burns_as_cell_by_cell(inflation: tuple[Any, dict[str, Any]]) -> None:
    """The plain port of inflation_layer.cpp gives the same costs, whatever the obstacles."""
    grid, given_ = inflation
    geometry = GridGeometry(grid.shape[1], grid.shape[0], given_["resolution"])
    parameters = {name: value for name, value in given_.items() if name != "resolution"}
    costmap = LayeredCostmap(
        geometry, [StaticLayer(geometry, grid), InflationLayer(geometry, **parameters)]
    )

    costmap.update()

    assert np.array_equal(scalar.inflated(grid, **given_), costmap.costs)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 12), st.sampled_from([0.005, 0.03, 0.2]))
def test_every_cell_is_claimed_by_the_same_source(seed: int, reach: int, density: float) -> None:
    """And over the same last step: order is kept, on which all that lies further out rests."""
    obstacles = np.random.default_rng(seed).random((40, 40)) < density
    side = 2 * reach + 3
    expected = np.zeros(obstacles.shape, np.int64)
    for x, y, source_x, source_y, step in scalar.fire(obstacles, reach):
        place = (y - source_y + reach + 1) * side + x - source_x + reach + 1
        expected[y, x] = place * 4 + step + 1

    claims = Brushfire(reach).burnt(obstacles)

    assert np.array_equal(expected, claims)


def test_a_change_beyond_the_window_asks_for_a_wider_one() -> None:
    """Cells outside of the window are not left as they were."""
    geometry = GridGeometry(80, 80, 0.05)
    layer = InflationLayer(geometry, 0.55)
    master = np.zeros(geometry.shape, np.uint8)
    layer.update_costs(master, geometry.whole)
    master[40, 40] = LETHAL
    narrow = CellWindow(38, 38, 43, 43)

    needed = layer.update_costs(master, narrow)
    master[needed.slices] = FREE_SPACE
    master[40, 40] = LETHAL
    done = layer.update_costs(master, needed)

    assert narrow.dilated(layer.reach + 8) == needed == done
    expected = np.zeros(geometry.shape, np.uint8)
    expected[40, 40] = LETHAL
    assert np.array_equal(
        scalar.inflated(expected, resolution=0.05, radius=0.55, scaling=10.0, inscribed=0.0,
                        inflate_unknown=False), master)  # fmt: skip


def test_doors_are_given_more_room_than_walls() -> None:
    """Around closed doors, and doors that may be closed, costs reach further."""
    geometry = GridGeometry(60, 60, 0.1)
    doors = DoorLayer(geometry)
    around = InflationLayer(geometry, 1.0, scaling=1.0, around=doors)
    costmap = LayeredCostmap(geometry, [doors, InflationLayer(geometry, 0.3), around])
    doors.draw({
        1: DoorLine(1.0, 1.05, 0.0, 0.5, LETHAL),
        2: DoorLine(1.0, 3.05, 0.0, 0.5, 60),
        3: DoorLine(1.0, 5.05, 0.0, 0.5, FREE_SPACE),
    })  # fmt: skip

    costmap.update()

    costs = costmap.costs
    assert (LETHAL, 60, FREE_SPACE) == (costs[10, 12], costs[30, 12], costs[50, 12])
    assert int(252 * math.exp(-0.8)) == costs[18, 12] == costs[38, 12]
    assert FREE_SPACE == costs[58, 12]


@pytest.mark.parametrize("name", ["radius", "scaling", "inscribed"])
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_what_no_inflation_can_be(name: str, value: float) -> None:
    """It is said, not drawn."""
    parameters = {"radius": 0.5, name: value}

    with pytest.raises(CostmapError, match=f"inflation's {name}: expected 0 or more"):
        InflationLayer(GridGeometry(3, 3, 0.1), **parameters)


def test_inscribed_cells_show_where_nothing_is_known() -> None:
    """The rest of the costs only if they are asked to."""
    geometry = GridGeometry(30, 1, 0.1)
    for inflate_unknown in (False, True):
        doors = DoorLayer(geometry)
        layer = InflationLayer(geometry, 0.5, inscribed=0.2, inflate_unknown=inflate_unknown)
        costmap = LayeredCostmap(geometry, [doors, layer], track_unknown=True)
        doors.draw({1: DoorLine(1.05, 0.05, 0.0, 0.0, LETHAL)})

        costmap.update()

        row = costmap.costs[0].tolist()
        assert [LETHAL, INSCRIBED, INSCRIBED] == row[10:13]
        assert inflate_unknown == (NO_INFORMATION != row[13])
        assert NO_INFORMATION == row[16]


def test_a_radius_that_no_table_can_hold() -> None:
    """A kilometre on a great map is an error; on a small one nothing lies beyond the map."""
    with pytest.raises(CostmapError, match=r"at most 1,500 cells \(75 m\), got 1000 m"):
        InflationLayer(GridGeometry(4000, 4000, 0.05), 1000.0)

    assert 73 == InflationLayer(GridGeometry(60, 40, 0.05), 1000.0).reach
