"""Ways over the costmap, and what the robot meets on them."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from navigation.global_costmap import GlobalCostmap
from navigation.tests.world_of_three_rooms import (
    ALL_OPEN,
    CORRIDOR,
    IN_LEFT,
    IN_MIDDLE,
    LEFT,
    MIDDLE,
    floor,
)
from navigation.ways import MissingPlannerError, Way, WayFinder, planner, straightened


def test_without_the_library_the_line_that_installs_it_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "pyastar2d", None)
    with pytest.raises(MissingPlannerError, match=r"pip install 'semmap-log\[experiment\]'"):
        planner()


def finder(**doors: bool) -> WayFinder:
    pytest.importorskip("pyastar2d", reason="not installed: pip install 'semmap-log[experiment]'")
    costmap = GlobalCostmap(floor(), None)
    if doors:
        costmap.show_doors({**ALL_OPEN, MIDDLE: doors["middle"]})
    costmap.update()
    return WayFinder(floor(), costmap)


def test_a_way_is_as_long_as_it_is() -> None:
    """
    Along the corridor a straight line, though the library's path may zigzag.
    """
    way = finder().find((1.0, 1.2), (13.0, 1.7))
    assert way is not None
    assert way.length_m == pytest.approx(math.hypot(12.0, 0.5), rel=0.01)
    assert way.at(0.0)[:2] == (1.0, 1.2)
    assert way.at(way.length_m)[:2] == pytest.approx((13.0, 1.7))
    x, y, heading = way.at(way.length_m / 2)
    assert (x, y) == pytest.approx((7.0, 1.45), abs=0.4)
    assert heading == pytest.approx(0.0, abs=0.3)


def test_a_way_tells_the_doors_that_it_goes_through() -> None:
    way = finder().find(IN_LEFT, IN_MIDDLE)
    assert way is not None
    assert [crossing.door for crossing in way.crossings(floor())] == [LEFT, MIDDLE]
    first, second = way.crossings(floor())
    assert first.place == pytest.approx((2.0, 2.4), abs=0.5)
    assert 0 < first.along_m < second.along_m < way.length_m


def test_no_way_through_a_door_that_the_map_has_shut() -> None:
    assert finder(middle=True).find(CORRIDOR, IN_MIDDLE) is not None
    assert finder(middle=False).find(CORRIDOR, IN_MIDDLE) is None
    assert finder(middle=False).find(CORRIDOR, IN_LEFT) is not None


@pytest.mark.parametrize("goal", [(-3.0, 1.0), (5.0, 5.0), (0.05, 0.05)], ids=str)
def test_no_way_off_the_map_or_into_a_wall(goal: tuple[float, float]) -> None:
    assert finder().find(CORRIDOR, goal) is None


def test_a_robot_in_a_doorway_that_was_shut_gets_out() -> None:
    way = finder(middle=False).find((7.0, 2.4), CORRIDOR)
    assert way is not None
    assert way.at(way.length_m)[:2] == pytest.approx(CORRIDOR)


def test_a_straight_piece_is_never_dearer() -> None:
    """
    Two cells apart in a straight line, with a dear cell between: the detour stays.
    """
    weights = np.ones((3, 3), np.float32)
    weights[1, 1] = 9.0
    path = np.array([[1, 0], [0, 1], [1, 2]], np.int32)
    assert straightened(path, weights).tolist() == path.tolist()
    weights[1, 1] = 1.0
    assert straightened(path, weights).tolist() == [[1, 0], [1, 2]]


def test_a_way_of_one_point_ends_where_it_begins() -> None:
    way = Way(np.array([[1.0, 2.0]]))
    assert way.length_m == 0.0
    assert way.at(0.0)[:2] == (1.0, 2.0)
    assert way.crossings(floor()) == []
