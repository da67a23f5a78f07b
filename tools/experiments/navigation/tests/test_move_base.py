"""A robot before doors that are not as it thinks: stopping, trying, going round, giving up."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from navigation.door_shares import DoorShares
from navigation.move_base import Drive
from navigation.runs import read_run, second_of
from navigation.tests.world_of_three_rooms import (
    ALL_OPEN,
    CORRIDOR,
    IN_LEFT,
    IN_MIDDLE,
    IN_RIGHT,
    LEFT,
    MIDDLE,
    RIGHT,
    Scene,
)
from navigation.ways import Crossing
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved

pytest.importorskip("pyastar2d", reason="not installed: pip install 'semmap-log[experiment]'")

SHUT = {**ALL_OPEN, MIDDLE: False}
FAR = (1.0, 1.2)
"""At the other end of the corridor."""


def gone(scene: Scene, goal: tuple[float, float]) -> Drive:
    with scene.recorder:
        return scene.move_base.go(goal)


@pytest.mark.parametrize("setup", ["no_map", "map", "no_map_star", "map_star", "smart", "belief"])
def test_every_setup_reaches_what_is_open(tmp_path: Path, setup: str) -> None:
    """
    In the time that the way takes at 0.7 m/s.
    """
    scene = Scene(tmp_path, setup, ALL_OPEN)
    drive = gone(scene, IN_LEFT)

    assert drive.reached
    assert scene.robot.place == IN_LEFT
    shortest_m = math.dist(CORRIDOR, (2.25, 2.4)) + math.dist((2.25, 2.4), IN_LEFT)
    assert shortest_m < drive.path_m < 1.15 * shortest_m
    assert scene.robot.now_s == pytest.approx(drive.path_m / 0.7)
    assert drive.planned_s == pytest.approx(drive.drove_s)
    assert drive.waited_s == 0


def test_without_knowing_it_drives_to_the_shut_door_and_gives_up(tmp_path: Path) -> None:
    """
    It stops 1.5 m before the door, and gives up after 15 s and two turns.
    """
    scene = Scene(tmp_path, "no_map_star", SHUT, start=FAR)
    drive = gone(scene, IN_MIDDLE)

    assert not drive.reached
    assert (drive.plans, drive.blocked) == (2, 1)
    assert 1.0 < math.dist(scene.robot.place, (7.0, 2.4)) < 1.5 + 0.35
    assert scene.robot.place[1] < 2.4 - 0.5
    assert drive.waited_s == pytest.approx(15 + 2 * 6.28)
    assert scene.robot.now_s == pytest.approx(drive.drove_s + drive.waited_s)
    assert drive.drove_s > 5


def test_a_way_that_is_blocked_where_the_robot_stands_was_planned_all_the_same(
    tmp_path: Path,
) -> None:
    """
    Before a shut door that it does not know, it tries for 15 s and turns twice, without a step:
    more than the 18 s of a goal to which there is no way, and its records say why.
    """
    scene = Scene(tmp_path, "no_map_star", SHUT, start=(7.0, 1.6))
    drive = gone(scene, IN_MIDDLE)

    assert not drive.reached
    assert (drive.plans, drive.blocked, drive.path_m) == (1, 1, 0.0)
    assert drive.planned_s is not None
    assert scene.robot.now_s == drive.waited_s == pytest.approx(15 + 2 * 6.28)


@pytest.mark.parametrize("setup", ["map", "map_star", "smart"])
def test_a_door_that_the_map_has_shut_is_not_driven_to(tmp_path: Path, setup: str) -> None:
    """
    It is given up in less than 20 seconds, without a step.
    """
    scene = Scene(tmp_path, setup, SHUT, start=FAR)
    drive = gone(scene, IN_MIDDLE)

    assert not drive.reached
    assert drive.planned_s is None
    assert (drive.plans, drive.blocked, drive.path_m) == (0, 0, 0.0)
    assert 17 < scene.robot.now_s < 20


def test_the_obstacle_layer_remembers_a_shut_door(tmp_path: Path) -> None:
    """
    The first time it drives there, the second time it does not.
    """
    scene = Scene(tmp_path, "no_map", SHUT, start=FAR)
    with scene.recorder:
        first = scene.move_base.go(IN_MIDDLE)
        second = scene.move_base.go(IN_MIDDLE)
    assert first.path_m > 3
    assert not second.reached
    assert second.path_m == 0


def test_recovery_may_forget_the_door_elsewhere(tmp_path: Path) -> None:
    """
    With `recovery_clears` the robot, at the far end, drives to the shut door once more.
    """
    for clears in (False, True):
        scene = Scene(tmp_path / str(clears), "no_map", SHUT, recovery_clears=clears, sense_m=3.0)
        with scene.recorder:
            scene.move_base.go(IN_MIDDLE)
            scene.move_base.go((1.0, 0.8))
            again = scene.move_base.go(IN_MIDDLE)
        assert (again.path_m > 3) == clears
        assert not again.reached


def test_a_map_that_is_wrong_is_put_right_where_the_sensor_is_near(tmp_path: Path) -> None:
    """
    With 3 m it learns before it stops; with 1 m, less than 1.5 m, it never does.
    """
    for near_m, knows in ((3.0, True), (1.0, False)):
        scene = Scene(
            tmp_path / str(near_m), "map_star", SHUT, known=ALL_OPEN, near_m=near_m, start=FAR
        )
        with scene.recorder:
            scene.move_base.go(IN_MIDDLE)
            again = scene.move_base.go(IN_MIDDLE)
        assert (again.planned_s is None) == knows


@pytest.mark.parametrize("setup", ["map", "map_star", "smart"])
def test_what_the_robot_knows_is_what_its_log_says(tmp_path: Path, setup: str) -> None:
    """
    After a drive through doors that toggled meanwhile.
    """
    toggles = [[MIDDLE], [LEFT], [MIDDLE], [RIGHT]]
    scene = Scene(tmp_path, setup, SHUT, *toggles, every_s=7.0, start=FAR)
    with scene.recorder:
        for goal in (IN_MIDDLE, IN_LEFT, IN_RIGHT):
            scene.move_base.go(goal)
    run = read_run(scene.recorder.folder)
    doors = run.belief.replay().doors
    assert {d: state.state.name == "OPEN" for d, state in doors.items()} == scene.robot._known
    assert scene.robot._known != SHUT

    learnt = DoorShares([LEFT, MIDDLE, RIGHT])
    for entry in run.belief.history(kinds=(DoorAdded, DoorObserved)):
        is_open = entry.event.state is DoorState.OPEN
        learnt.saw(second_of(entry.happened_ns), entry.event.door_id, is_open=is_open)
    for door in ALL_OPEN:
        assert learnt.p_open(500.0, door) == scene.robot.shares.p_open(500.0, door)


def test_a_door_that_opens_while_it_waits_lets_it_pass(tmp_path: Path) -> None:
    scene = Scene(tmp_path, "no_map_star", SHUT, [MIDDLE], every_s=18.0, start=FAR)
    drive = gone(scene, IN_MIDDLE)

    assert drive.reached
    assert drive.blocked == 1
    assert 18.0 < scene.robot.now_s < 35


def test_a_door_that_shuts_on_the_way_stops_it(tmp_path: Path) -> None:
    scene = Scene(tmp_path, "map_star", ALL_OPEN, [MIDDLE], every_s=3.0, start=FAR)
    drive = gone(scene, IN_MIDDLE)

    assert not drive.reached
    assert drive.blocked == 1
    assert drive.waited_s == pytest.approx(5 + 2 * 6.28)  # it knows: there is no way


def test_smart_doors_are_known_at_once(tmp_path: Path) -> None:
    """
    A door far away shuts; the robot knows when it plans next.
    """
    scene = Scene(tmp_path, "smart", ALL_OPEN, [MIDDLE], every_s=3.0, start=FAR)
    with scene.recorder:
        scene.robot.wait(4.0)
        drive = scene.move_base.go(IN_MIDDLE)
    assert drive.planned_s is None


def test_a_belief_reckons_with_what_was_long_ago(tmp_path: Path) -> None:
    """
    A door seen shut just now is not tried; days later it is.
    """
    scene = Scene(tmp_path, "belief", SHUT, start=FAR)
    with scene.recorder:
        assert scene.move_base.plan(IN_MIDDLE) is None
        scene.robot.world.advance(3 * 86_400.0)
        assert scene.move_base.plan(IN_MIDDLE) is not None


def test_a_door_that_it_stands_before_is_not_doubted(tmp_path: Path) -> None:
    """
    Locked in for five hours beside a shut door, it does not come to think that it may be open.
    """
    scene = Scene(tmp_path, "belief", SHUT, start=(7.0, 3.2))
    with scene.recorder:
        for _ in range(300):
            scene.robot.wait(60.0)
        assert scene.move_base.plan(CORRIDOR) is None


def test_a_robot_on_whom_a_door_closes_goes_on(tmp_path: Path) -> None:
    """
    It stands in the doorway as the door shuts.
    """
    scene = Scene(tmp_path, "map_star", ALL_OPEN, [MIDDLE], every_s=1.0, start=(7.0, 2.4))
    with scene.recorder:
        scene.robot.wait(1.0)
        assert scene.move_base.go(CORRIDOR).reached
        assert scene.move_base.go(IN_RIGHT).reached


def test_a_goal_without_room_is_given_up_where_it_is(tmp_path: Path) -> None:
    """
    0.3 m from a wall: with a margin of 0.1 m beside the radius of 0.25 m there is too little room.
    """
    near_wall, apart = (7.0, 0.35), (7.0, 0.75)
    scene = Scene(tmp_path, "no_map_star", ALL_OPEN, start=FAR, margin_m=0.1)
    with scene.recorder:
        assert not (drive := scene.move_base.go(near_wall)).reached
        assert drive.path_m > 5
        assert drive.waited_s == pytest.approx(15 + 2 * 6.28)
        assert scene.move_base.go(apart).reached
    usual = Scene(tmp_path / "usual", "no_map_star", ALL_OPEN, start=FAR)
    with usual.recorder:
        assert usual.move_base.go(near_wall).reached


def test_a_door_behind_a_wall_does_not_stop_it(tmp_path: Path) -> None:
    """
    Though it lies near on the way: the wall at x = 5 stands between.
    """
    scene = Scene(tmp_path, "no_map_star", SHUT, start=(4.6, 5.0))
    with scene.recorder:
        for x, is_blocked in ((5.4, False), (4.0, True)):
            crossing = Crossing(1.0, MIDDLE, (x, 5.0))
            assert scene.move_base._is_blocked([crossing], 0.0) == is_blocked


def test_doors_are_told_as_they_change(tmp_path: Path) -> None:
    """
    At the time of the iteration, however long the step was.
    """
    heard: list[tuple[float, DoorId, bool]] = []
    scene = Scene(tmp_path, "no_map_star", ALL_OPEN, [], [MIDDLE], [MIDDLE], every_s=10.0)
    scene.world.tell(lambda *told: heard.append(told))
    with scene.recorder:
        scene.world.advance(9.5)
        assert heard == []
        scene.world.advance(100.0)
    assert heard == [(20.0, MIDDLE, False), (30.0, MIDDLE, True)]
    assert scene.world.now_s == 109.5
