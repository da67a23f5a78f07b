"""Poses, TF, floor plans and rounds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.core.model.events import Event, FloorMap, PatrolFinished, PatrolStarted, RobotPose
from semmap_log.errors import CommandError
from semmap_log.interop.topics.topic_reader import Known
from semmap_log.interop.topics.topic_rules import (
    ReadFloorMap,
    ReadPatrol,
    ReadPose,
    ReadTransforms,
    RosMapping,
)
from tests.interop.topics.robots import START, Listener, Robot, S

ROBOT = Robot()


def _poses() -> Listener:
    return Listener({"/p": ReadPose()})


def _pose_of(events: list[Event]) -> tuple[float, float, float]:
    (pose,) = events
    assert isinstance(pose, RobotPose)
    return pose.x, pose.y, pose.theta


def test_a_pose_is_kept_once_the_robot_has_moved() -> None:
    """By a quarter of a metre, or by 15 degrees, from the last one that was kept."""
    listener = _poses()
    turned = math.radians(15.1)

    kept = [
        (x, theta)
        for x, theta in [(0.0, 0.0), (0.2, 0.0), (0.26, 0.0), (0.3, turned / 2), (0.3, turned),
                         (0.54, turned), (0.3, turned - math.tau)]
        if listener.hear("/p", ROBOT.pose(x, 0.0, theta))
    ]  # fmt: skip

    assert [(0.0, 0.0), (0.26, 0.0), (0.3, turned)] == kept


@pytest.mark.parametrize("version", [1, 2])
def test_a_pose_has_its_place_and_its_deviations(version: Any) -> None:
    """From the covariance: the square roots of the variances; all zeros say nothing."""
    robot = Robot(version)
    listener = Listener({"/p": ReadPose()}, version=version)

    (first,) = listener.hear("/p", robot.pose(1, 2, 3, at_ns=START, variances=(0.04, 0.09)), 1)
    (second,) = listener.hear("/p", robot.pose(9, 2, 3, variances=(0.0, 0.0)), 2)

    assert isinstance(first, RobotPose)
    assert isinstance(second, RobotPose)
    assert (1, 2, START) == (first.x, first.y, first.happened_ns)
    np.testing.assert_allclose([3, 0.2, 0.3], [first.theta, first.sd_xy, first.sd_theta])
    assert math.isnan(second.sd_xy)
    assert math.isnan(second.sd_theta)


@pytest.mark.parametrize("frame", ["odom", "", "Map"])
def test_a_pose_in_another_frame_is_never_one_in_the_map(frame: str) -> None:
    """It is told; with a slash, as old ROS 1 writes it, the frame is the same."""
    listener = _poses()

    assert [] == listener.hear("/p", ROBOT.pose(1, 2, 3, frame=frame))
    assert "in another frame than map" in listener.told[0]
    assert 1 == len(listener.hear("/p", ROBOT.pose(1, 2, 3, frame="/map")))


def test_a_pose_that_cannot_be_is_told() -> None:
    """NaN, infinity, an orientation that was never set."""
    listener = _poses()
    name, _ = ROBOT.pose(0, 0, 0)
    unset = ROBOT.new(name, header=ROBOT.header(0, "map"), pose=ROBOT._pose(1, 2, 0))
    unset.pose.orientation.w = 0.0

    assert [] == listener.hear("/p", ROBOT.pose(math.nan, 0, 0))
    assert [] == listener.hear("/p", ROBOT.pose(0, math.inf, 0))
    assert [] == listener.hear("/p", (name, ROBOT.encoded(name, unset)))
    assert 3 == len(listener.complaints)


_ANGLES = st.floats(-3, 3)
_PLACES = st.floats(-50, 50)
_LINKS = st.tuples(_PLACES, _PLACES, _ANGLES)


@given(_LINKS, _LINKS, _LINKS)
def test_a_chain_of_transforms_is_the_product_of_its_matrices(
    first: tuple[float, float, float],
    second: tuple[float, float, float],
    third: tuple[float, float, float],
) -> None:
    """map -> odom -> base_footprint -> base_link, in any order of arrival."""
    listener = Listener({"/tf": ReadTransforms(), "/tf_static": ReadTransforms()})
    listener.hear("/tf_static", ROBOT.transforms(("base_footprint", "base_link", *third)))
    listener.hear("/tf", ROBOT.transforms(("odom", "base_footprint", *second)))

    pose = _pose_of(listener.hear("/tf", ROBOT.transforms(("map", "odom", *first)), 1))

    product = _matrix(*first) @ _matrix(*second) @ _matrix(*third)
    np.testing.assert_allclose([pose[0], pose[1]], product[:2, 2], atol=1e-9)
    np.testing.assert_allclose([math.cos(pose[2]), math.sin(pose[2])], product[:2, 0], atol=1e-9)


def _matrix(x: float, y: float, theta: float) -> Any:
    cos, sin = math.cos(theta), math.sin(theta)
    return np.array([[cos, -sin, x], [sin, cos, y], [0, 0, 1]])


def test_transforms_that_do_not_reach_the_map_make_no_pose() -> None:
    """A gap, a circle, frames of others, and a link that nobody sends any more."""
    listener = Listener({"/tf": ReadTransforms()})

    said = [
        listener.hear("/tf", ROBOT.transforms(("odom", "base_link", 1, 2, 0))),
        listener.hear("/tf", ROBOT.transforms(("base_link", "odom", 1, 2, 0))),
        listener.hear("/tf", ROBOT.transforms(("map", "odom", 1, 2, 0)), 1),
        listener.hear("/tf", ROBOT.transforms(("map", "cup", 7, 7, 0)), 2),
        listener.hear("/tf", ROBOT.transforms(("odom", "base_link", 9, 9, 0)), 60),
    ]

    assert [0, 0, 1, 0, 0] == [len(events) for events in said]
    assert ["/tf: transforms that are not of the same time; no pose: 59.0 s"] == listener.told


def test_frames_have_the_names_of_the_mapping() -> None:
    """A robot whose frames are called otherwise."""
    mapping = RosMapping(map_frame="earth", robot_frame="tug/base")
    listener = Listener({"/tf": ReadTransforms()}, Known(), mapping)

    events = listener.hear("/tf", ROBOT.transforms(("earth", "tug/base", 1, 2, 0)))

    assert (1, 2, 0) == _pose_of(events)


def test_a_floor_plan_is_kept_once_for_each_content() -> None:
    """Said again, also after a restart, it is no event; another is; so is going back."""
    cells = np.array([[0, 100, -1], [0, 0, 100]], np.int8)
    listener = Listener({"/map": ReadFloorMap()})

    (drawn,) = listener.hear("/map", ROBOT.grid(cells), 1)
    again = listener.hear("/map", ROBOT.grid(cells), 2)
    restarted = Listener({"/map": ReadFloorMap()}, listener.known).hear("/map", ROBOT.grid(cells))
    other = listener.hear("/map", ROBOT.grid(-cells), 3)
    back = listener.hear("/map", ROBOT.grid(cells), 4)

    assert isinstance(drawn, FloorMap)
    np.testing.assert_array_equal(cells, drawn.cells)
    assert (-1.0, 2.0, START + S) == (drawn.origin_x, drawn.origin_y, drawn.happened_ns)
    assert math.isclose(0.1, drawn.origin_theta)
    assert [0, 0, 1, 1] == [len(events) for events in (again, restarted, other, back)]


def test_a_grid_that_cannot_be_is_told() -> None:
    """Another frame, other sizes than it says, no resolution."""
    cells = np.zeros((2, 3), np.int8)
    listener = Listener({"/map": ReadFloorMap()})

    assert [] == listener.hear("/map", ROBOT.grid(cells, frame="odom"))
    assert [] == listener.hear("/map", ROBOT.grid(cells, width=4))
    assert [] == listener.hear("/map", ROBOT.grid(cells, resolution=0.0))
    assert 3 == len(listener.complaints)


def _rounds(listener: Listener, *messages: tuple[str, bytes]) -> list[tuple[str, int]]:
    return [
        (type(event).__name__.removeprefix("Patrol"), event.patrol)
        for second, message in enumerate(messages)
        for event in listener.hear("/r", message, second)
        if isinstance(event, (PatrolStarted, PatrolFinished))
    ]


@pytest.mark.parametrize(("version", "runs", "ends"), [(1, 1, 3), (2, 2, 4), (1, 1, 4), (2, 2, 6)])
def test_a_goal_that_runs_is_a_round(version: Any, runs: int, ends: int) -> None:
    """Of an action's status, which comes again and again: one that begins, however it ends."""
    robot = Robot(version)
    listener = Listener({"/r": ReadPatrol()}, version=version)

    said = _rounds(
        listener,
        robot.action_status(),
        robot.action_status((1, runs)),
        robot.action_status((1, runs)),
        robot.action_status((1, ends)),
        robot.action_status((1, ends), (2, runs)),
        robot.action_status((1, ends), (2, ends), (3, runs)),
        robot.action_status(),
    )

    assert [("Started", 1), ("Finished", 1), ("Started", 2), ("Finished", 2), ("Started", 3),
            ("Finished", 3)] == said  # fmt: skip


def test_words_and_flags_mark_rounds() -> None:
    """A start while a round is under way ends it; an end without a round is none."""
    listener = Listener({"/r": ReadPatrol(name="evening")})

    said = _rounds(
        listener,
        ROBOT.said("String", "finish"),
        ROBOT.said("String", "start"),
        ROBOT.said("Bool", True),
        ROBOT.said("Bool", False),
        ROBOT.said("String", "hello"),
        ROBOT.said("UInt8", 1),
    )

    assert [("Started", 1), ("Finished", 1), ("Started", 2), ("Finished", 2)] == said
    assert 2 == len(listener.complaints)
    assert "evening" == listener.made("/r", ROBOT.said("String", "start")).reason


def test_rounds_go_on_counting_where_the_log_stands() -> None:
    """The next round is one more than the last of the log."""
    known = Known()
    known.apply(PatrolStarted(patrol=41, happened_ns=START))

    said = _rounds(Listener({"/r": ReadPatrol()}, known), ROBOT.said("String", "start"))

    assert [("Finished", 41), ("Started", 42)] == said


@pytest.mark.parametrize("level", ["65001", "9" * 5000, "-1", "attic"])
def test_a_floor_plan_of_a_level_that_cannot_be_is_told_at_once(level: str) -> None:
    """Not at each message."""
    with pytest.raises(CommandError, match=r"/map: no level .* a mapping file says it: level"):
        Listener({"/map": ReadFloorMap(level)})
