"""Which goal is next, by the ways that the robot would take."""

from __future__ import annotations

import math
from itertools import permutations
from pathlib import Path

import pytest

from navigation.door_shares import DoorShares
from navigation.goal_orders import FAIL_S, order_of, walking_on
from navigation.goals import Goal
from navigation.tests.world_of_three_rooms import (
    ALL_OPEN,
    IN_LEFT,
    IN_MIDDLE,
    IN_RIGHT,
    LEFT,
    MIDDLE,
    Scene,
)
from navigation.ways import Way
from semmap_log.core.model.doors import DoorId

pytest.importorskip("pyastar2d", reason="not installed: pip install 'semmap-log[experiment]'")

GOALS = [
    Goal(1, IN_LEFT, "free"),
    Goal(2, IN_MIDDLE, "free"),
    Goal(3, IN_RIGHT, "free"),
    Goal(4, (5.0, 5.0), "occupied"),
]

PLACES = [goal.place for goal in GOALS[:3]]


def chosen(scene: Scene, order: str) -> list[int]:
    left, found = list(GOALS), []
    with scene.recorder:
        choosing = order_of(order, scene.robot, scene.move_base, 4)
        while left:
            found.append(choosing.choose(left))
            left.remove(found[-1])
    return [goal.number for goal in found]


def test_as_given(tmp_path: Path) -> None:
    assert chosen(Scene(tmp_path, "map_star", ALL_OPEN), "given") == [1, 2, 3, 4]


def test_the_nearest_first_by_the_way(tmp_path: Path) -> None:
    """
    From the left end of the corridor; what is no place to be is sent at once.
    """
    assert chosen(Scene(tmp_path, "nearest_first", ALL_OPEN, start=(6.0, 1.2)), "nearest") == [
        4, 2, 1, 3,
    ]  # fmt: skip
    scene = Scene(tmp_path / "r", "nearest_first", ALL_OPEN, start=(13.0, 1.2))
    assert chosen(scene, "nearest")[:2] == [4, 3]


def test_what_is_nearest_by_air_behind_a_wall_is_not_the_nearest(tmp_path: Path) -> None:
    """
    Nor what is hardly farther by air than the way to the nearest is long.
    """
    behind, nearest = Goal(1, (4.45, 5.0), "free"), Goal(2, IN_MIDDLE, "free")
    scene = Scene(tmp_path, "nearest_first", ALL_OPEN, start=(6.0, 1.2))
    with scene.recorder:
        way = scene.move_base.plan(IN_MIDDLE)
        assert way is not None
        by_air_m = [math.dist(goal.place, (6.0, 1.2)) for goal in (nearest, behind)]
        assert by_air_m[0] < by_air_m[1] < way.length_m
        order = order_of("nearest", scene.robot, scene.move_base, 2)
        assert order.choose([behind, nearest]) is nearest


def test_what_no_way_leads_to_is_given_up_at_once(tmp_path: Path) -> None:
    """
    Else such goals would fill the window: here the room is shut, and the last is no place to be.
    """
    for order in ("patrol", "nearest"):
        scene = Scene(tmp_path / order, "patrol", {**ALL_OPEN, MIDDLE: False}, start=(6.0, 1.2))
        assert chosen(scene, order) == [2, 4, 1, 3]


def test_the_order_is_the_best_of_all_by_hand(tmp_path: Path) -> None:
    """
    Of each order of the goals: P of the doors on the way from here, the times between them on
    foot, and what a shut door costs; the robot begins with the best one's first.
    """
    scene = Scene(tmp_path, "patrol", ALL_OPEN, start=(6.0, 1.2))
    with scene.recorder:
        for hour in range(1, 40):
            scene.robot.shares.saw(3600.0 * hour, MIDDLE, is_open=hour % 4 == 0)
            scene.robot.shares.saw(3600.0 * hour, LEFT, is_open=True)
        scene.robot.world.advance(100 * 3600.0)
        chosen = order_of("patrol", scene.robot, scene.move_base, 3).choose(GOALS[:3])
        ways = [scene.move_base.plan(goal.place) for goal in GOALS[:3]]
        p = [p_of(scene, way) for way in ways]
        from_here_s = [way.length_m / 0.7 for way in ways if way is not None]
        legs_s = walking_on(scene.robot.floor).between(PLACES, PLACES) / 0.7

    def cost(order: tuple[int, ...]) -> float:
        now_s = total = 0.0
        for place, stop in enumerate(order):
            now_s += legs_s[order[place - 1], stop] if place else from_here_s[stop]
            total += p[stop] * now_s
            now_s += (1 - p[stop]) * FAIL_S
        return total

    assert 0.15 < p[1] < 0.5 < p[0] - 0.4
    assert chosen is GOALS[min(permutations(range(3)), key=cost)[0]]
    assert chosen is not GOALS[1], "the nearest, but behind the door that is rarely open"


def p_of(scene: Scene, way: Way | None) -> float:
    """Return P of the one door on a way to a room, when one comes to it."""
    assert way is not None
    (crossing,) = way.crossings(scene.robot.floor)
    at_s = scene.robot.now_s + crossing.along_m / 0.7
    return scene.robot.shares.p_open(at_s, crossing.door)


def test_goals_on_the_way_come_first_though_another_is_nearer(tmp_path: Path) -> None:
    """
    What tells an order of all from one goal at a time: one that is nearest, on the other side,
    waits for two that lie together.
    """
    goals = [
        Goal(1, (5.4, 1.2), "free"),
        Goal(2, (9.2, 1.2), "free"),
        Goal(3, (9.6, 1.2), "free"),
        Goal(4, (10.0, 1.2), "free"),
    ]
    for order, first in (("nearest", 1), ("patrol", 2)):
        scene = Scene(tmp_path / order, "patrol", ALL_OPEN, start=(7.2, 1.2))
        with scene.recorder:
            assert order_of(order, scene.robot, scene.move_base, 4).choose(goals).number == first


def test_ways_between_goals_lead_through_no_shut_door(tmp_path: Path) -> None:
    """
    Two rooms with a door between them are far from each other, once it is known to be shut.
    """
    scene = Scene(tmp_path, "patrol", {**ALL_OPEN, MIDDLE: False}, start=(6.0, 1.2))
    with scene.recorder:
        order = order_of("patrol", scene.robot, scene.move_base, 4)
        ways = [scene.move_base.plan(place) for place in (IN_LEFT, IN_RIGHT)]
        assert scene.robot.shut == {MIDDLE}
        task = order.task([IN_LEFT, IN_RIGHT], ways)  # type: ignore[attr-defined]
        p = [p_of(scene, way) for way in ways]
        assert min(p) > 0.9
        assert task.p_passes[:, 0] == pytest.approx(p)
        between = walking_on(scene.robot.floor).between([IN_LEFT], [IN_RIGHT], {MIDDLE})
        assert task.leg_s[0, 1] == pytest.approx(between[0, 0] / 0.7)
        through = order.task([IN_LEFT, IN_MIDDLE], ways)  # type: ignore[attr-defined]
        assert through.leg_s[0, 1] == pytest.approx(sum(through.from_start_s))


def test_shares_forget_what_was_seen_at_the_rate_that_doors_change() -> None:
    """
    Just seen: sure; long ago: the share of looks. Doors that never differ are remembered longer.
    """
    door, other = DoorId(1), DoorId(2)
    calm, wild = DoorShares([door, other]), DoorShares([door, other])
    for look in range(60):
        calm.saw(600.0 * look, door, is_open=True)
        wild.saw(600.0 * look, door, is_open=look % 2 == 0)
    assert calm.rate_s < wild.rate_s / 10
    last_s = 600.0 * 59
    assert calm.p_open(last_s, door) == 0.98
    assert wild.p_open(last_s, door) == 0.02
    assert wild.p_open(last_s + 1e6, door) == pytest.approx(31 / 62)
    assert calm.p_open(0.0, other) == 0.5


def test_looks_that_saw_the_same_one_after_the_other_are_one() -> None:
    """
    An hour before a shut door, each minute: one look, and it is fresh.
    """
    door = DoorId(1)
    shares, plain = DoorShares([door]), DoorShares([door])
    shares.saw(0.0, door, is_open=True)
    plain.saw(0.0, door, is_open=True)
    for minute in range(60, 121):
        shares.saw(60.0 * minute, door, is_open=False)
    plain.saw(3600.0, door, is_open=False)
    assert shares.p_open(7200.0, door) == 0.02
    assert shares.p_open(7200.0 + 1e7, door) == pytest.approx(plain.p_open(1e7, door))
    assert shares.rate_s == plain.rate_s


def test_rates_are_learnt_from_pairs_of_looks() -> None:
    """
    Doors that differ after an hour in one of four pairs: (1 - exp(-r h)) / 2 = 1/4.
    """
    shares = DoorShares([LEFT])
    is_open = True
    for look in range(400):
        is_open ^= look % 4 == 0
        shares.saw(3600.0 * look, LEFT, is_open=is_open)
    assert shares.rate_s * 3600 == pytest.approx(math.log(2), rel=0.35)
