"""The master, brought up to date, is the master drawn anew: byte for byte, whatever happened."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pytest

from semmap_log.analysis.costmap_2d.costs import (
    FEW,
    FREE_SPACE,
    INSCRIBED,
    LETHAL,
    NO_INFORMATION,
    DoorLayer,
    DoorLine,
    addition,
    maximum,
    overwrite,
    overwrite_all,
)
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry
from semmap_log.analysis.costmap_2d.layered import (
    CostmapLayer,
    InflationLayer,
    LayeredCostmap,
    StaticLayer,
)
from semmap_log.errors import CostmapError

SEQUENCES = 2000
PARTS = 8


@dataclass
class World:
    """A building, drawn at random, with doors that come, move, change and go."""

    dice: random.Random

    def __post_init__(self) -> None:
        dice = self.dice
        self.geometry = GridGeometry(
            dice.randint(1, 90), dice.randint(1, 90), dice.choice([0.05, 0.1, 1.0]),
            dice.uniform(-3, 3), dice.uniform(-3, 3),
        )  # fmt: skip
        walls = np.random.default_rng(dice.randrange(2**32))
        shape = self.geometry.shape
        self.static = np.full(shape, FREE_SPACE, np.uint8)
        self.static[walls.random(shape) < dice.choice([0, 0.2])] = NO_INFORMATION
        self.static[walls.random(shape) < dice.choice([0, 0.001, 0.02, 0.3])] = LETHAL
        self.radius = dice.choice([0, 1, 2, 3, 5, 8, 13]) * self.geometry.resolution * 0.99
        self.inscribed = dice.uniform(0, 3) * self.geometry.resolution
        self.scaling = dice.choice([0.0, 1.0, 10.0])
        self.inflate_unknown = dice.random() < 0.5
        self.has_wide_doors = dice.random() < 0.3
        self.doors_come_last = dice.random() < 0.2
        self.doors: dict[int, DoorLine] = {}

    def costmap(self) -> tuple[DoorLayer, LayeredCostmap]:
        """New layers, nothing drawn in them."""
        grid, doors = self.geometry, DoorLayer(self.geometry)
        layers: list[CostmapLayer] = [
            StaticLayer(grid, self.static),
            InflationLayer(grid, self.radius, scaling=self.scaling, inscribed=self.inscribed,
                           inflate_unknown=self.inflate_unknown),
        ]  # fmt: skip
        if self.has_wide_doors:
            layers.append(InflationLayer(grid, self.radius * 1.7, scaling=1.0, around=doors))
        layers.insert(len(layers) if self.doors_come_last else 1, doors)
        return doors, LayeredCostmap(grid, layers)

    def step(self) -> None:
        """Let something happen to one door, to some or to many."""
        for _ in range(self.dice.choice([1, 1, 1, 2, FEW + 8])):
            door = self.dice.randint(-3, 60)
            if self.dice.random() < 0.25:
                self.doors.pop(door, None)
            else:
                self.doors[door] = self._line()

    def _line(self) -> DoorLine:
        dice, grid = self.dice, self.geometry
        return DoorLine(
            grid.origin_x + dice.uniform(-0.2, 1.2) * grid.width * grid.resolution,
            grid.origin_y + dice.uniform(-0.2, 1.2) * grid.height * grid.resolution,
            dice.uniform(-4, 4),
            dice.uniform(-0.2, 1) * dice.choice([1, 5, 40]) * grid.resolution,
            dice.choice([FREE_SPACE, LETHAL, NO_INFORMATION, 100]),
        )


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_updated_is_drawn_anew(part: int) -> None:
    """2,000 sequences of doors over walls; nothing changes outside of the windows."""
    dice = random.Random(part)
    for _ in range(SEQUENCES // PARTS):
        world = World(dice)
        doors, costmap = world.costmap()
        costmap.update()
        for _ in range(dice.randint(1, 4)):
            world.step()
            earlier = doors.costs.copy(), costmap.costs.copy()

            drawn = doors.draw(world.doors), costmap.update()

            fresh_doors, fresh = world.costmap()
            fresh_doors.draw(world.doors)
            fresh.update()
            assert np.array_equal(fresh_doors.costs, doors.costs)
            assert np.array_equal(fresh.costs, costmap.costs)
            _is_as_before_outside(drawn[0], earlier[0], doors.costs)
            _is_as_before_outside(drawn[1], earlier[1], costmap.costs)


def _is_as_before_outside(
    windows: list[CellWindow],
    before: np.ndarray[tuple[int, int], np.dtype[np.uint8]],
    after: np.ndarray[tuple[int, int], np.dtype[np.uint8]],
) -> None:
    outside = np.ones(before.shape, np.bool_)
    for window in windows:
        outside[window.slices] = False
    assert np.array_equal(before[outside], after[outside])


def _two_doors(states: Mapping[int, int]) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
    layer = DoorLayer(GridGeometry(9, 9, 1.0))
    layer.draw({
        1: DoorLine(0.5, 4.5, 0.0, 8.0, states[1]),
        2: DoorLine(4.5, 0.5, 1.5707963267948966, 8.0, states[2]),
    })  # fmt: skip
    return layer.costs


def test_the_greater_id_has_the_cell() -> None:
    """Also where it knows nothing: then nothing is left of the lower one."""
    assert FREE_SPACE == _two_doors({1: LETHAL, 2: FREE_SPACE})[4, 4]
    assert LETHAL == _two_doors({1: FREE_SPACE, 2: LETHAL})[4, 4]
    assert NO_INFORMATION == _two_doors({1: LETHAL, 2: NO_INFORMATION})[4, 4]


def test_a_door_that_ends_on_another_continent_is_not_drawn() -> None:
    """Within 10^8 cells it is, as far as the map goes."""
    drawn = {}
    for width in (0.9e8, 1.1e8, 1e300, math.inf, math.nan):
        layer = DoorLayer(GridGeometry(9, 9, 1.0))
        layer.draw({1: DoorLine(2.5, 4.5, 0.0, width, LETHAL)})
        drawn[width] = int((layer.costs == LETHAL).sum())

    assert [7, 0, 0, 0, 0] == list(drawn.values())


def test_a_removed_door_leaves_no_ghost() -> None:
    """Nor does one that moved; what it covered shows again, in the layer and in the master."""
    geometry = GridGeometry(9, 9, 1.0)
    doors = DoorLayer(geometry)
    costmap = LayeredCostmap(geometry, [doors, InflationLayer(geometry, 2.0)])
    across = DoorLine(0.5, 4.5, 0.0, 8.0, LETHAL)
    doors.draw({1: across})
    costmap.update()
    one = doors.costs.copy(), costmap.costs.copy()

    for x, cost in ((4.5, LETHAL), (4.5, FREE_SPACE), (1.5, LETHAL), (6.5, LETHAL)):
        doors.draw({1: across, 2: DoorLine(x, 0.5, 1.5, 8.0, cost)})
        costmap.update()
    doors.draw({1: across})
    costmap.update()

    assert np.array_equal(one[0], doors.costs)
    assert np.array_equal(one[1], costmap.costs)


def test_an_open_door_cuts_through_a_wall_and_an_unknown_one_does_not() -> None:
    """Only cells with information reach the master."""
    geometry = GridGeometry(9, 9, 1.0)
    wall = np.full(geometry.shape, FREE_SPACE, np.uint8)
    wall[4] = LETHAL
    found = {}
    for cost in (FREE_SPACE, LETHAL, NO_INFORMATION):
        doors = DoorLayer(geometry)
        costmap = LayeredCostmap(geometry, [StaticLayer(geometry, wall), doors])
        doors.draw({1: DoorLine(3.5, 4.5, 0.0, 2.0, cost)})
        costmap.update()
        found[cost] = costmap.costs[4].tolist()

    assert [LETHAL] * 3 + [FREE_SPACE] * 3 + [LETHAL] * 3 == found[FREE_SPACE]
    assert [LETHAL] * 9 == found[LETHAL] == found[NO_INFORMATION]


def test_grids_that_are_handed_out_cannot_be_written() -> None:
    """Who wants to draw in one takes a copy."""
    geometry = GridGeometry(3, 3, 1.0)
    doors = DoorLayer(geometry)

    for grid in (doors.costs, LayeredCostmap(geometry, [doors]).costs):
        with pytest.raises(ValueError, match="read-only"):
            grid[0, 0] = 1


def test_a_map_of_another_size_is_an_error() -> None:
    """It is not drawn somewhere."""
    with pytest.raises(CostmapError, match=r"expected \(3, 4\) cells, got \(4, 3\)"):
        StaticLayer(GridGeometry(4, 3, 1.0), np.zeros((4, 3), np.uint8))


@pytest.mark.parametrize(
    ("combine", "expected"),
    [
        (overwrite_all, lambda m, c: c),
        (overwrite, lambda m, c: m if c == 255 else c),
        (maximum, lambda m, c: c if c != 255 and (m == 255 or m < c) else m),
        (
            addition,
            lambda m, c: m if c == 255 else c if m == 255 else min(m + c, INSCRIBED - 1),
        ),
    ],
)
def test_all_pairs_of_costs_are_combined_as_ros_does(combine, expected) -> None:
    """All 65,536 of them, against the condition that stands in costmap_layer.cpp."""
    master, layer = (np.ascontiguousarray(a, np.uint8) for a in np.indices((256, 256)))

    combine(master, layer)

    assert [[expected(m, c) for c in range(256)] for m in range(256)] == master.tolist()
