"""What the robot believes: its error's spread and memory, and frames that compose to it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from patrol_sim.laser_drive import TRACK_HZ, Track
from patrol_sim.laser_pose import DRIFT_M, MAP_HZ, PoseError, composed, inverse, localised

METRES = 4000


def straight() -> Track:
    """Return a long way along x."""
    x = np.arange(0, METRES, 0.02)
    return Track(np.arange(len(x)) / TRACK_HZ, np.stack([x, 0 * x, 0 * x], axis=-1))


def test_error_has_the_spread_that_was_asked_for() -> None:
    """Over a thousand drifts: standard deviations along x, y, and of the heading."""
    where = localised(straight(), PoseError(0.1, 2.0), seed=1)

    off = where.believed - straight().poses

    assert off.std(axis=0) == pytest.approx([0.1, 0.1, math.radians(2)], rel=0.12)
    assert off.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.015)


def test_error_is_forgotten_along_the_way() -> None:
    """After the drift's length the correlation is 1/e; over a few centimetres it is nearly one."""
    off = localised(straight(), PoseError(0.1, 2.0), seed=2).believed[:, 1]

    def correlation(metres: float) -> float:
        back = round(metres / 0.02)
        return float(np.corrcoef(off[:-back], off[back:])[0, 1])

    assert correlation(0.1) > 0.95
    assert correlation(DRIFT_M) == pytest.approx(1 / math.e, abs=0.1)


def test_robot_that_stands_keeps_its_error() -> None:
    """Who does not move does not drift."""
    still = Track(np.arange(500) / TRACK_HZ, np.tile([1.0, 2, 0.5], (500, 1)))

    believed = localised(still, PoseError(0.1, 2), seed=1).believed

    assert (believed == believed[0]).all()
    assert believed[0].tolist() != [1.0, 2, 0.5]


def test_jumps_are_told() -> None:
    """Where it localises anew the error is another one at once; those moments are known."""
    where = localised(straight(), PoseError(0.2, 4, jumps_per_min=0.5), seed=1)
    off = where.believed[:: TRACK_HZ // MAP_HZ, 1]
    steps = np.abs(np.diff(off))

    assert len(where.jumps_s) > 20
    at = np.round(np.array(where.jumps_s) * MAP_HZ).astype(int) - 1
    assert np.median(steps[at]) > 3 * np.median(np.delete(steps, at))
    assert steps[at].max() > 0.3


def test_another_error_is_the_same_walk_scaled() -> None:
    """Errors of two sizes differ in size only: their effects can be compared."""
    small, large = (localised(straight(), PoseError(sd, 1.0), seed=4) for sd in (0.05, 0.1))
    truth = straight().poses

    assert (large.believed - truth)[:, :2] == pytest.approx(2 * (small.believed - truth)[:, :2])
    assert (large.odometry == small.odometry).all()


def test_frames_compose_to_what_is_believed() -> None:
    """map -> odom and odom -> base give the believed base; odometry starts at zero, and drifts."""
    t = np.arange(0, 60, 1 / TRACK_HZ)
    track = Track(t, np.stack([3 * np.cos(t / 5), 3 * np.sin(t / 5), t / 5 + math.pi / 2], axis=-1))

    where = localised(track, PoseError(0.05, 1), seed=1)

    assert composed(where.map_to_odom(), where.odometry) == pytest.approx(where.believed)
    assert where.odometry[0].tolist() == [0, 0, 0]
    gone = composed(inverse(track.poses[:1]), track.poses[-1:])[0]
    off = np.abs(where.odometry[-1] - gone)
    assert 0 < off[0] < 1.0


def test_inverse_undoes() -> None:
    """A pose in its own frame is nothing."""
    poses = np.array([[1.0, 2.0, 0.7], [-3.0, 0.1, -2.0]])

    assert composed(poses, inverse(poses)) == pytest.approx(np.zeros((2, 3)))
