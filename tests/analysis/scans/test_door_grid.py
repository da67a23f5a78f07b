"""Doors found by place, against all of them asked."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.scans.door_beams import DoorGrid
from semmap_log.analysis.scans.visit import DoorPlaces
from tests.analysis.scans.scenes import joined, places


def many(seed: int, count: int) -> DoorPlaces:
    rng = np.random.default_rng(seed)
    return DoorPlaces(
        ids=np.arange(1, count + 1),
        levels=rng.integers(0, 3, count),
        lines=rng.uniform((-30, -30, -4, 0.5), (30, 30, 4, 3), (count, 4)),
        kinds=("",) * count,
        glass=np.zeros(count, bool),
    )


@pytest.mark.parametrize("seed", range(5))
def test_pairs_are_all_those_within_reach_on_one_level(seed: int) -> None:
    doors, rng = many(seed, 200), np.random.default_rng(seed)
    points, levels = rng.uniform(-35, 35, (50, 2)), rng.integers(0, 4, 50)
    grid = DoorGrid(doors, reach=6.0)

    at, door = grid.near(levels, points)

    x, y, theta, width = doors.lines.T
    middles = np.stack([x + width / 2 * np.cos(theta), y + width / 2 * np.sin(theta)], axis=1)
    apart = np.linalg.norm(points[:, None] - middles, axis=2)
    together = (apart < 6.0) & (levels[:, None] == doors.levels)
    assert np.argwhere(together).tolist() == list(map(list, zip(at, door, strict=True)))


def test_no_doors_and_no_points_are_no_pairs() -> None:
    none = joined([places((np.nan, 0, 0, 1))])

    at, door = DoorGrid(none, reach=6.0).near(np.zeros(3, np.int64), np.zeros((3, 2)))
    nor, neither = DoorGrid(places(), reach=6.0).near(np.zeros(0, np.int64), np.zeros((0, 2)))

    assert 0 == len(at) == len(door) == len(nor) == len(neither)
