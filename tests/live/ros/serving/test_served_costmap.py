"""Grids for stock planners: read with their own rules, they are the costmap that we mean."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import semmap_log as sl
from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    LETHAL,
    NO_INFORMATION,
    static_costs,
    to_occupancy,
)
from semmap_log.analysis.costmaps import CostmapOptions, costmap_at
from semmap_log.core.model.events import FloorMap
from semmap_log.live.ros.serving.served_topics import LevelNames, ServedTopics, levels_of
from semmap_log.live.ros.serving.server import ServedCostmaps
from tests.live.ros.collecting_node import CollectingNode

MASTER, LAYER = "semmap/costmap", "semmap/door_layer"


@pytest.fixture
def log(tmp_path: Path) -> sl.DoorLogWriter:
    return sl.create(tmp_path / "log", tz="UTC", durability="none")


def _floor(**more: Any) -> FloorMap:
    """A room of 6 x 5 m, a wall at y = 2, unknown beyond it."""
    cells = np.zeros((50, 60), np.int8)
    cells[20], cells[21:] = 100, -1
    return FloorMap(resolution=0.1, origin_x=0.0, origin_y=0.0, cells=cells, **more)


def _served(node: CollectingNode, log: sl.DoorLogWriter, **more: Any) -> ServedCostmaps:
    names = LevelNames(levels_of(log.door_map()) | more.get("floors", {}).keys())
    served = ServedCostmaps(
        ServedTopics(node), names, log.floor_of, more.pop("warn", print), **more
    )
    served.show(log.door_map(), 0)
    return served


COSTS = CostmapOptions(by="belief", door_inflate_m=0.4, scaling=3.0)


def test_what_doors_cost_can_be_chosen(furnished: sl.DoorLogWriter) -> None:
    """By P(open), and with costs around doors that may close."""
    node = CollectingNode()
    served = _served(node, furnished, options=COSTS)

    seen = []
    for p_open in (None, 0.9, 0.1):
        if p_open is not None:
            furnished.update_door(1, prob_open=p_open)
            served.show(furnished.door_map(), 0)
        meant = costmap_at(furnished, COSTS)
        for topic, costs in ((MASTER, meant.master.costs), (LAYER, meant.layer.costs)):
            assert np.array_equal(to_occupancy(costs), _cells(node.messages[topic][-1]))
        seen.append(_cells(node.messages[MASTER][-1]))

    at_door = [int(cells[10, 15]) for cells in seen]
    beside = [int(cells[12, 15]) for cells in seen]
    assert at_door[1] < at_door[0] < at_door[2] < 100
    assert min(beside) > 0
    assert np.array_equal(
        static_costs(seen[-1], trinary=False) > 0, costmap_at(furnished, COSTS).master.costs > 0
    )


def _cells(grid: Any) -> NDArray[np.int8]:
    return np.asarray(grid.data, np.int8).reshape(grid.info.height, grid.info.width)


def _keepout(master: NDArray[np.uint8], mask: NDArray[np.int8]) -> NDArray[np.uint8]:
    """Nav2's KeepoutFilter::process over a mask of the costmap's size, base 0, multiplier 1.

    nav2_costmap_2d/plugins/costmap_filters/keepout_filter.cpp: -1 is passed over; else the cost is
    100 -> lethal, 0 -> free, and is written where it is greater, or the old one is not known.
    """
    out = master.copy()
    for at, value in np.ndenumerate(mask):
        if value == -1:
            continue
        cost = round(value / 100 * LETHAL)
        if out[at] < cost or out[at] == NO_INFORMATION:
            out[at] = cost
    return out


def _maximum(master: NDArray[np.uint8], mask: NDArray[np.int8]) -> NDArray[np.uint8]:
    """A StaticLayer with use_maximum (updateWithMax, costmap_layer.cpp)."""
    costs = static_costs(mask)
    wins = (costs != NO_INFORMATION) & ((master == NO_INFORMATION) | (master < costs))
    return np.where(wins, costs, master)


@pytest.fixture
def furnished(log: sl.DoorLogWriter) -> sl.DoorLogWriter:
    """A closed door in the free, an open one in the wall, one of unknown state, one behind."""
    log.append([_floor()])
    log.add_door(x=1.05, y=1.05, theta=0.0, width=1.0, state="closed", prob_open=0.5)
    log.add_door(x=1.05, y=2.05, theta=0.0, width=1.0, state="open")
    log.add_door(x=3.05, y=2.05, theta=0.0, width=1.0)
    log.add_door(x=3.05, y=3.05, theta=0.0, width=1.0, state="open")
    return log


@pytest.mark.parametrize("trinary", [True, False])
def test_a_static_layer_reads_the_costmap_that_we_mean(
    furnished: sl.DoorLogWriter, trinary: bool
) -> None:
    """In place of /map: every cell, also with the scale of costs between."""
    node = CollectingNode()

    _served(node, furnished)

    (grid,) = node.messages[MASTER]
    meant = costmap_at(furnished).master.costs
    assert np.array_equal(meant, static_costs(_cells(grid), trinary=trinary))
    assert {FREE_SPACE, LETHAL, NO_INFORMATION} == set(np.unique(meant).tolist())
    assert ("map", 60, 50) == (grid.header.frame_id, grid.info.width, grid.info.height)
    assert node.topics[MASTER].is_latched


@pytest.mark.parametrize("planner", [_keepout, _maximum])
def test_the_doors_alone_close_what_another_map_leaves_open(
    furnished: sl.DoorLogWriter, planner: Any
) -> None:
    """
    Beside the robot's own map: closed doors are lethal, an open one frees what is not known, walls
    and all else stay as they are.
    """
    node = CollectingNode()
    own = static_costs(_floor().cells)

    _served(node, furnished)
    seen = planner(own, _cells(node.messages[LAYER][0]))

    meant = own.copy()
    meant[10, 10:21] = LETHAL
    meant[30, 30:41] = FREE_SPACE
    assert np.array_equal(meant, seen)


@pytest.mark.parametrize("version", [1, 2])
def test_changes_come_as_updates_and_as_whole_grids(log: sl.DoorLogWriter, version: int) -> None:
    """A reader of updates alone, and one of grids alone, see the same after each change."""
    node = CollectingNode(version)
    log.append([_floor()])
    served = _served(node, log)
    door = log.add_door(x=1.05, y=3.05, theta=0.0, width=1.0, state="closed")
    changes = [lambda: None, lambda: log.observe(door, "open"), lambda: log.observe(door, "open"),
               lambda: log.update_door(door, x=3.05), lambda: log.remove_door(door)]  # fmt: skip

    for change in changes:
        change()
        served.show(log.door_map(), 0)

    for name in (MASTER, LAYER):
        first, *later = node.messages[name]
        cells = _cells(first).copy()
        updates = node.messages[f"{name}_updates"]
        for update in updates:
            part = np.asarray(update.data, np.int8).reshape(update.height, update.width)
            cells[update.y : update.y + update.height, update.x : update.x + update.width] = part
        assert np.array_equal(_cells(later[-1]), cells)
        assert 4 == len(later)
        assert all(update.width == 11 and update.height == 1 for update in updates)
    assert [f"{MASTER}_updates", MASTER] == node.order[-2:]


def test_without_a_floor_the_grid_grows_with_the_doors(log: sl.DoorLogWriter) -> None:
    """No door is left out because it came later; before the first there is nothing to send."""
    node = CollectingNode()
    warnings: list[str] = []
    served = _served(node, log, warn=warnings.append)
    before = list(node.messages)

    log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, state="closed")
    served.show(log.door_map(), 1)
    log.add_door(x=20.0, y=-7.0, theta=0.0, width=1.0, state="closed")
    served.show(log.door_map(), 2)
    log.remove_door(2)
    served.show(log.door_map(), 3)

    sizes = [(grid.info.width, grid.info.height) for grid in node.messages[MASTER]]
    closed = [int((_cells(grid) == 100).sum()) for grid in node.messages[MASTER]]
    assert [] == before
    assert [] == warnings
    assert [(60, 40), (440, 200), (440, 200)] == sizes
    assert [21, 42, 21] == [min(count, 42) for count in closed]


@pytest.mark.parametrize(("x", "width"), [(1e7, 1.0), (1e308, 1.0), (1e308, 1e308)])
def test_a_door_far_away_does_not_fill_the_memory(
    log: sl.DoorLogWriter, x: float, width: float
) -> None:
    """Anybody can add one: the level keeps its grid."""
    node = CollectingNode()
    warnings: list[str] = []
    log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, state="closed")
    served = _served(node, log, warn=warnings.append)

    log.add_door(x=x, y=1.0, theta=0.0, width=width)
    served.show(log.door_map(), 1)
    log.observe(1, "open")
    served.show(log.door_map(), 2)
    log.add_door(x=7.0, y=1.0, theta=0.0, width=1.0, state="closed")
    served.show(log.door_map(), 3)
    log.remove_door(2)
    served.show(log.door_map(), 4)

    assert 1 == len(warnings)
    assert "no new costmap of level 0" in warnings[0]
    assert "remove the door that is far away" in warnings[0]
    assert [21, 0, 21] == [int((_cells(grid) == 100).sum()) for grid in node.messages[MASTER]]
    assert [60, 60, 180] == [grid.info.width for grid in node.messages[MASTER]]


@pytest.mark.parametrize("has_floor", [True, False])
def test_after_any_changes_the_grids_are_those_of_the_doors_drawn_at_once(
    log: sl.DoorLogWriter, *, has_floor: bool
) -> None:
    """Doors come, move, change and go, on the map and off it, one or forty at a time."""
    dice, node = np.random.default_rng(8), CollectingNode()
    if has_floor:
        log.append([_floor()])
    log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, state="closed")
    served = _served(node, log)

    for round_number in range(40):
        for _ in range(40 if round_number % 8 == 7 else 1):
            _change_any_door(log, dice)
        served.show(log.door_map(), round_number)

        costmap = costmap_at(log, floor=_floor() if has_floor else None)
        last = node.messages[MASTER][-1]
        if has_floor:
            assert np.array_equal(costmap.master.costs == LETHAL, _cells(last) == 100)
        else:  # the served grid has not become smaller
            assert int((costmap.master.costs == LETHAL).sum()) == int((_cells(last) == 100).sum())


def _change_any_door(log: sl.DoorLogWriter, dice: np.random.Generator) -> None:
    x, y, theta, width = dice.uniform((-1, -1, -3, 0.1), (7, 6, 3, 3)).tolist()
    there = list(log.door_map().doors)
    state = ("open", "closed", "unknown")[dice.integers(3)]
    match dice.integers(4):
        case 0:
            log.add_door(x=x, y=y, theta=theta, width=width, state=state)
        case 1:
            log.update_door(dice.choice(there), x=x, y=y, theta=theta, width=width)
        case 2 if len(there) > 1:
            log.remove_door(dice.choice(there))
        case _:
            log.observe(dice.choice(there), state)


def test_a_floor_that_is_logged_later_is_drawn(log: sl.DoorLogWriter) -> None:
    """Instead of the grid around the doors; one that was given by the caller stays."""
    nodes = [CollectingNode(), CollectingNode()]
    log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, state="closed")
    given = FloorMap(resolution=0.1, origin_x=0.0, origin_y=0.0, cells=np.zeros((9, 8), np.int8))
    served = [_served(nodes[0], log), _served(nodes[1], log, floors={0: given})]

    log.append([_floor()])
    for each in served:
        each.show(log.door_map(), 1)

    sizes = [[grid.info.width for grid in node.messages[MASTER]] for node in nodes]
    assert [[60, 60], [8]] == sizes
    assert (50, 60) == _cells(nodes[0].messages[MASTER][-1]).shape


def test_a_clock_that_goes_back_stops_no_grid(log: sl.DoorLogWriter) -> None:
    """A simulation begins again: changes are sent on, with stamps that do not go back."""
    node = CollectingNode()
    log.append([_floor()])
    door = log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, state="closed")
    served = _served(node, log)
    served.show(log.door_map(), 9 * 10**9)

    for at_s, state in ((10, "open"), (1, "closed")):
        log.observe(door, state)
        served.show(log.door_map(), at_s * 10**9)

    assert [0, 10, 10] == [grid.header.stamp.sec for grid in node.messages[MASTER]]
