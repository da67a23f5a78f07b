"""The robot's track with few points."""

from __future__ import annotations

import math
import random
from itertools import accumulate

import numpy as np
import pytest

from semmap_log.views.report import page_events
from semmap_log.views.report.page_events import POSE, track_of
from semmap_log.views.zone_times import MS_NS, Span

BEGIN_MS = 1_700_000_000_000
SPAN = Span(BEGIN_MS, BEGIN_MS + 10**9)


def walk(seed: int, steps: int) -> np.ndarray:
    """A robot that wanders, at up to a metre a second."""
    rng = random.Random(seed)
    poses = np.zeros(steps, POSE)
    x = y = heading = 0.0
    ns = BEGIN_MS * MS_NS
    for i in range(steps):
        poses[i] = (ns, 1, x, y, 0)
        heading += rng.gauss(0, 0.3)
        x, y = x + 0.5 * math.cos(heading), y + 0.5 * math.sin(heading)
        ns += rng.randrange(500, 3000) * MS_NS
    return poses


def where(run: list[int], ms: int) -> tuple[float, float]:
    """Where the page draws the robot, as its script does."""
    t, x, y = (list(accumulate(run[first::3])) for first in (1, 2, 3))
    return (float(np.interp(ms, np.array(t) * 100, np.array(x) / 10)),
            float(np.interp(ms, np.array(t) * 100, np.array(y) / 10)))  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_no_pose_lies_farther_off_than_said(seed: int) -> None:
    """At the time of each pose the robot is drawn near it."""
    poses = walk(seed, 400)

    track = track_of(poses, SPAN)

    (run,) = track.runs
    assert len(run) < 3 * len(poses)
    for pose in poses:
        drawn = where(run, int(pose["folds_ns"]) // MS_NS - BEGIN_MS)
        assert math.dist(drawn, (pose["x"], pose["y"])) <= track.within_m


def test_a_straight_way_takes_two_points() -> None:
    """However many poses it had."""
    poses = np.zeros(100, POSE)
    poses["folds_ns"] = BEGIN_MS * MS_NS + np.arange(100) * 10**9
    poses["x"] = np.arange(100) * 0.5

    assert [[0, 0, 0, 0, 990, 495, 0]] == track_of(poses, SPAN).runs


def test_a_long_silence_and_another_level_begin_anew() -> None:
    """Nobody knows which way it went."""
    poses = np.zeros(4, POSE)
    poses["folds_ns"] = BEGIN_MS * MS_NS + np.array([0, 1, 700, 701]) * 10**9
    poses["level"] = [1, 1, 1, 2]

    assert [1, 1, 2] == [run[0] for run in track_of(poses, SPAN).runs]


def test_of_too_many_points_the_tolerance_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    """The track says by how much."""
    monkeypatch.setattr(page_events, "MOST_POINTS", 20)
    poses = walk(1, 400)

    track = track_of(poses, SPAN)

    assert len(track.runs[0]) <= 1 + 3 * 20
    assert track.within_m > page_events.TOLERANCE_M + page_events.ROUNDING_M


def test_no_poses_no_track() -> None:
    """A log without a robot has none."""
    assert [] == track_of(np.zeros(0, POSE), SPAN).runs


def test_two_robots_have_a_track_each() -> None:
    """Their poses come by turns; nobody drove from one robot to the other."""
    poses = np.zeros(40, POSE)
    poses["folds_ns"] = (BEGIN_MS + 1000 * np.arange(40)) * MS_NS
    poses["robot"] = np.arange(40) % 2
    poses["x"] = np.where(poses["robot"] == 1, 90.0, 0.0)

    track = track_of(poses, SPAN)

    assert [0, 1] == track.robots
    assert [0, 900] == [run[2] for run in track.runs]
    assert all({0} == set(run[5::3]) for run in track.runs)


def test_nobody_drives_from_one_plan_to_another() -> None:
    """A level that was mapped anew between two poses a second apart."""
    poses = np.zeros(4, POSE)
    poses["folds_ns"] = BEGIN_MS * MS_NS + np.arange(4) * 10**9
    poses["x"] = [0, 1, 50, 51]

    runs = track_of(poses, SPAN, {0: [BEGIN_MS * MS_NS + 2 * 10**9]}).runs

    assert [[0, 0, 0, 0, 10, 10, 0], [0, 20, 500, 0, 10, 10, 0]] == runs
