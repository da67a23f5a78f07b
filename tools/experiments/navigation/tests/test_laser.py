"""The laser in a world of cells, and the obstacle layer that it marks and clears."""

from __future__ import annotations

import math

import numpy as np

from navigation.laser import Laser, Scan
from navigation.obstacle_layer import ObstacleLayer
from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, LETHAL, NO_INFORMATION
from semmap_log.analysis.costmap_2d.grid import CellWindow

ROOM = np.pad(np.zeros((18, 28), np.bool_), 1, constant_values=True)
"""20 x 30 cells of 0.1 m, walls around."""
HERE = (10, 5)


def laser(walls: np.ndarray = ROOM, *, noise_m: float = 0.0, **options: object) -> Laser:
    usual = {"cell_m": 0.1, "range_m": 2.0, "rng": np.random.default_rng(1)}
    return Laser(walls, noise_m=noise_m, **{**usual, **options})  # type: ignore[arg-type]


def cells(laser: Laser, scan: Scan, found: np.ndarray) -> set[tuple[int, int]]:
    rows, columns = np.divmod(found, 2 * laser.margin + 1)
    rows += scan.square[0].start - laser.margin
    columns += scan.square[1].start - laser.margin
    return set(zip(rows.tolist(), columns.tolist(), strict=True))


def hits(laser: Laser, scan: Scan) -> set[tuple[int, int]]:
    return cells(laser, scan, scan.hits)


def passed(laser: Laser, scan: Scan) -> set[tuple[int, int]]:
    everything = np.ones((2 * laser.margin + 1) ** 2, np.bool_)
    return cells(laser, scan, scan.passed(everything))


def test_beams_end_in_the_walls_that_they_see() -> None:
    """
    Ahead, 270 degrees wide, and no farther than the range: the wall at column 29 is not seen.
    """
    eye = laser()
    ahead = hits(eye, eye.scan(HERE, 0.0))

    assert all(ROOM[cell] for cell in ahead)
    assert {(0, 5), (19, 5)} <= ahead
    assert not any(column == 29 for _, column in ahead)
    assert (10, 0) not in ahead  # behind
    assert (10, 0) in hits(eye, eye.scan(HERE, math.pi))
    assert (10, 0) in hits(eye, eye.look_around(HERE))


def test_a_scan_passes_what_lies_before_its_hits() -> None:
    eye = laser()
    through = passed(eye, eye.scan((10, 20), 0.0))

    assert {(10, column) for column in range(21, 29)} <= through
    assert not any(ROOM[cell] for cell in through)


def test_a_beam_that_meets_nothing_clears_only_if_told() -> None:
    open_floor = np.zeros((20, 60), np.bool_)
    for clears in (False, True):
        eye = laser(open_floor, clears_beyond=clears)
        assert bool(passed(eye, eye.scan((10, 30), 0.0))) == clears


def test_noise_moves_hits_by_as_much_as_it_says() -> None:
    """
    Looking straight at a wall 1 m away, with a deviation of a cell: half of the hits miss the wall.
    """
    eye = laser(noise_m=0.1)
    scans = [eye.scan((10, 19), 0.0) for _ in range(400)]
    columns = [
        column for scan in scans for row, column in hits(eye, scan) if row == 10 and column > 15
    ]
    # The beam ends half a step within the wall: a cell's width is one deviation.
    assert 0.3 < np.mean(np.array(columns) < 29) < 0.6
    assert np.std(columns) > 0.5


def test_what_a_laser_does_not_see_behind_a_leaf() -> None:
    eye = laser()
    assert eye.sees((10, 20), 0.0, 0.7)
    eye.solid.reshape(-1)[eye.at((10, 24))] = True
    assert not eye.sees((10, 20), 0.0, 0.7)
    assert eye.sees((10, 20), 0.0, 0.3)
    assert eye.sees((10, 20), math.pi / 2, 0.7)


def test_a_shut_door_is_marked_and_cleared_when_a_beam_passes() -> None:
    eye = laser()
    layer = ObstacleLayer(ROOM, eye.margin)
    leaf = [eye.at((row, 15)) for row in range(1, 19)]
    eye.solid.reshape(-1)[leaf] = True

    layer.take_in(eye.scan((10, 12), 0.0))
    assert layer.marked[10, 15]
    assert set(np.argwhere(layer.marked)[:, 1].tolist()) == {15}
    (window, *_) = layer.take_changes()
    assert window.within(CellWindow(15, 0, 16, 20)) == window
    assert layer.take_changes() == []

    eye.solid.reshape(-1)[leaf] = False
    layer.take_in(eye.scan((10, 12), 0.0))
    assert not layer.marked[10, 15]
    assert layer.take_changes()


def test_walls_of_the_static_map_are_not_marked() -> None:
    eye = laser()
    layer = ObstacleLayer(ROOM, eye.margin)
    layer.take_in(eye.look_around(HERE))
    assert not layer.marked.any()


def test_the_greater_cost_counts() -> None:
    """
    A mark on free floor is lethal; where nothing is marked, what lies below stays.
    """
    eye = laser()
    layer = ObstacleLayer(ROOM, eye.margin)
    layer.marked[3, 4] = True
    master = np.full(ROOM.shape, NO_INFORMATION, np.uint8)
    master[3, :] = FREE_SPACE
    layer.update_costs(master, CellWindow(0, 0, 30, 20))
    assert master[3, 4] == LETHAL
    assert master[3, 5] == FREE_SPACE
    assert master[4, 4] == NO_INFORMATION


def test_recovery_forgets_what_is_not_near() -> None:
    layer = ObstacleLayer(ROOM, laser().margin)
    layer.marked[10, [2, 6, 20]] = True
    layer.forget(HERE, 3)
    assert np.flatnonzero(layer.marked[10]).tolist() == [2, 6]
    assert layer.take_changes()
