"""Transforms between two moments, against matrices; clocks that jump; frames that lead nowhere."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.interop.topics.transforms import (
    MOST_FRAMES,
    LinkHistory,
    LinkPose,
    TransformTree,
    angle_between,
    between,
)
from tests.interop.topics.laser_room import moved, quaternion, turned
from tests.interop.topics.robots import S

_ANGLES = st.floats(-3.1, 3.1)
_TURNS = st.tuples(_ANGLES, _ANGLES, _ANGLES)
_SHARES = st.floats(0, 1)
KEEP = 10 * S


def _matrix(angles: tuple[float, float, float]) -> Any:
    return turned("z", angles[0]) @ turned("y", angles[1]) @ turned("x", angles[2])


def _matrix_of(q: Any) -> Any:
    """The matrix of a quaternion, column by column."""
    x, y, z, w = (float(part) for part in q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def _share_of(a: Any, b: Any, share: float) -> Any:
    """A share of the turn from a to b: the matrix' axis is kept, its angle shared (Rodrigues)."""
    step = a[:3, :3].T @ b[:3, :3]
    angle = math.acos(max(-1.0, min(1.0, (np.trace(step) - 1) / 2)))
    if angle < 1e-6:
        return a[:3, :3]
    k = (step - step.T) / (2 * math.sin(angle))
    part = share * angle
    return a[:3, :3] @ (np.eye(3) + math.sin(part) * k + (1 - math.cos(part)) * k @ k)


@given(_TURNS, _TURNS, _SHARES, st.booleans())
def test_a_turn_between_two_is_on_the_way_at_a_constant_rate(
    first: Any, second: Any, share: float, is_negated: bool
) -> None:
    """The short way, also where the one quaternion is written as its negative."""
    a, b = _matrix(first), _matrix(second)
    angle = math.acos(max(-1.0, min(1.0, (np.trace(a[:3, :3].T @ b[:3, :3]) - 1) / 2)))
    if angle > math.pi - 0.01:
        return  # either way is as short
    one, other = quaternion(a), quaternion(b)
    other = tuple(-part for part in other) if is_negated else other  # type: ignore[assignment]

    found = between(one, other, share)

    np.testing.assert_allclose(_share_of(a, b, share), _matrix_of(found), atol=1e-5)
    assert pytest.approx(angle, abs=1e-5) == float(angle_between(one, other))


def _pose(x: float, theta: float = 0.0) -> LinkPose:
    return LinkPose((x, 0.0, 0.0), quaternion(turned("z", theta)))


def _history(*stamps_s: float, holds: bool = False) -> LinkHistory:
    history = LinkHistory(KEEP, holds)
    for stamp_s in stamps_s:
        history.add(round(stamp_s * S), _pose(stamp_s))
    return history


@given(st.lists(st.floats(0, 9), min_size=2, max_size=20), st.data())
def test_a_link_is_between_its_neighbours_whatever_order_they_came_in(
    stamps_s: list[float], data: st.DataObject
) -> None:
    """Its x is its time here, so that every moment has one right answer."""
    history = _history(*stamps_s)
    times = data.draw(st.lists(st.floats(min(stamps_s), max(stamps_s)), min_size=1))

    found = history.at(np.array([round(each * S) for each in times], np.int64))

    np.testing.assert_allclose(times, found.shift[0], atol=1e-8)


def test_what_is_told_again_counts_as_it_was_told_last() -> None:
    """And is no second moment."""
    history = _history(1.0, 2.0)
    history.add(2 * S, _pose(7.0))

    assert [1 * S, 2 * S] == history.stamps
    assert 7.0 == float(history.at(np.array([2 * S], np.int64)).shift[0][0])


def test_a_link_that_holds_is_what_it_was_told_last() -> None:
    """Nothing lies between two of its poses, and the last one goes on."""
    history = _history(1.0, 2.0, holds=True)

    found = history.at(np.array([S, 2 * S - 1, 2 * S, 60 * S], np.int64))

    assert [1.0, 1.0, 2.0, 2.0] == found.shift[0].tolist()


def test_ten_seconds_are_kept_and_the_pose_where_they_begin() -> None:
    """However long it runs."""
    history = _history(*(i / 10 for i in range(3000)))

    assert 102 >= len(history.stamps) == len(history.poses)
    assert history.stamps[0] <= history.stamps[-1] - KEEP


def test_one_stamp_from_the_future_is_left_out() -> None:
    """Nor does it push out what is there, as it would if time went on from it."""
    history = _history(1.0, 2.0)

    strays = [history.add(round(s * S), _pose(s)) for s in (5000.0, 3.0, -900.0, 4.0)]

    assert [None, 5000 * S, None, -900 * S] == strays
    assert [1, 2, 3, 4] == [stamp // S for stamp in history.stamps]


def test_a_clock_that_was_set_is_followed() -> None:
    """Two stamps that agree with each other, and with nothing before: the rest is forgotten."""
    history = _history(5000.0, 5001.0)

    strays = [history.add(round(s * S), _pose(s)) for s in (3.0, 3.1, 3.2)]

    assert [None, None, None] == strays
    assert [3.0, 3.1, 3.2] == [stamp / S for stamp in history.stamps]


def _tree(*links: tuple[str, str], keep_ns: int = KEEP) -> TransformTree:
    tree = TransformTree(keep_ns)
    for parent, child in links:
        _take(tree, parent, child, 1.0)
    return tree


def _take(tree: TransformTree, parent: str, child: str, at_s: float, **how: Any) -> None:
    zero, turn = SimpleNamespace(x=at_s, y=0.0, z=0.0), SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    stamp = SimpleNamespace(sec=int(at_s), nanosec=round(at_s % 1 * S))
    made = SimpleNamespace(
        child_frame_id=child, header=SimpleNamespace(frame_id=parent, stamp=stamp),
        transform=SimpleNamespace(translation=zero, rotation=turn),
    )  # fmt: skip
    tree.take(made, round(at_s * S), is_static=how.get("is_static", False))


def test_why_no_frames_lead_to_the_map_is_told_by_their_names() -> None:
    """One that nobody sends, one above which nothing is, and a circle."""
    tree = _tree(("odom", "base_link"), ("base_link", "laser"), ("a", "b"), ("b", "a"))

    assert None is tree.chain("map", "laser") is tree.chain("map", "a")
    assert "laser on base_link on odom, which has no parent" == tree.no_way("map", "laser")
    assert "a loop: a on b" == tree.no_way("map", "a")
    assert "horn is in no transform" == tree.no_way("map", "horn")
    assert ("odom", "a") == (tree.root("laser"), tree.root("a"))


def test_a_frame_that_gets_another_parent_begins_anew() -> None:
    """Between its place in the one and in the other there is nothing."""
    tree = _tree(("odom", "base_link"))
    _take(tree, "cart", "base_link", 1.1)

    ((frame, history),) = tree.moving(("base_link",))

    assert ("base_link", "cart", [round(1.1 * S)]) == (
        frame, tree.parent("base_link"), history.stamps,
    )  # fmt: skip
    assert "base_link stands in cart, and stood in odom" == tree.stray


def test_only_the_latest_is_known_where_nothing_is_kept() -> None:
    """As poses of the robot need it, which are asked for as they come."""
    tree = _tree(("map", "base_link"), keep_ns=0)
    _take(tree, "map", "base_link", 500.0)

    ((_, history),) = tree.moving(("base_link",))

    assert ([], 0, 500.0) == (history.stamps, tree.strays, tree.pose(("base_link",))[0])


def test_static_frames_hold_at_all_times() -> None:
    """Also before they came."""
    tree = _tree(("map", "odom"))
    _take(tree, "odom", "laser", 7.0, is_static=True)

    x, _, _ = tree.at(("laser", "odom"), np.array([1 * S], np.int64)).shift

    assert [8.0] == x.tolist()
    assert np.allclose(moved(8.0, 0.0)[:2, 3], [x[0], 0.0])


def test_of_transforms_that_come_faster_than_any_wheel_some_are_kept() -> None:
    """However many come, and in whatever order; the last one always, if it comes at the end."""
    history = LinkHistory(KEEP)
    for i in [*range(0, 50_000, 2), *range(1, 50_000, 2)]:
        history.add(S + i * 1000, LinkPose((i / 50_000, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))

    assert 40 < len(history.stamps) <= 2 * 50 + 2
    assert S + 49_999_000 == history.stamps[-1]
    assert sorted(history.stamps) == history.stamps
    x, _, _ = history.at(np.array([S + 20_000_500], np.int64)).shift
    assert [pytest.approx(0.4, abs=1e-3)] == x.tolist()


def test_frames_of_things_that_were_seen_once_are_forgotten() -> None:
    """A node that gives each thing it sees a frame does not fill the memory."""
    tree = _tree(("odom", "base_link"))
    _take(tree, "base_link", "laser", 0.0, is_static=True)
    for i in range(3 * MOST_FRAMES):
        _take(tree, "map", f"thing_{i}", i / 10)
        if i % 10 == 0:
            _take(tree, "odom", "base_link", i / 10)

    assert tree.chain("odom", "laser") == ("laser", "base_link")
    assert not tree.has("thing_0")
    assert tree.has(f"thing_{3 * MOST_FRAMES - 1}")
    assert 0 == tree.strays


def test_more_frames_at_once_than_can_be_are_not_taken() -> None:
    """And are told."""
    tree = _tree(("odom", "base_link"))
    for i in range(MOST_FRAMES + 7):
        _take(tree, "map", f"thing_{i}", 1.0 + i / 10**6)

    assert (8, tree.has(f"thing_{MOST_FRAMES + 6}")) == (tree.strays, False)
    assert f"thing_{MOST_FRAMES + 6}: more than 5,000 frames" == tree.stray
    assert tree.chain("odom", "base_link") is not None
