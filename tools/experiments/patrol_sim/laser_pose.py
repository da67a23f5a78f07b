"""Where the robot believes to be: odometry that drifts, and a localisation that errs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from patrol_sim.laser_drive import TRACK_HZ, Track
from patrol_sim.laser_surfaces import Floats

MAP_HZ = 10
"""It localises so often; in between it trusts its odometry."""
DRIFT_M = 4.0
"""The localisation's error is another one after so many metres."""
TURN_AS_M = 0.5
"""A turn by one radian is worth so many metres of that."""
ODOM_SCALE, ODOM_SLIP = 0.01, 0.02
"""Errors of odometry: of lengths, all the way alike; of each turn."""


@dataclass(frozen=True, slots=True)
class PoseError:
    """How far a localisation is off."""

    sd_xy: float = 0.05
    """m, along each axis."""
    sd_theta_deg: float = 1.0
    jumps_per_min: float = 0.0
    """How often it localises anew: its error is another one at once."""


@dataclass(frozen=True, slots=True)
class Localisation:
    """What a robot knows of its own way, (n, 3) x, y, theta at the times of its track."""

    times_s: Floats
    believed: Floats
    """Base in frame `map`."""
    odometry: Floats
    """Base in frame `odom`."""
    jumps_s: tuple[float, ...]

    def believed_at(self, times_s: Floats) -> Floats:
        """Return (k, 3) where it believed to be."""
        return _interpolated(times_s, self.times_s, self.believed)

    def map_to_odom(self) -> Floats:
        """Return (n, 3) the pose of frame `odom` in frame `map`, which a localisation publishes."""
        return composed(self.believed, inverse(self.odometry))


def localised(track: Track, error: PoseError, *, seed: int) -> Localisation:
    """Return what the robot believes on its way: another one for each seed."""
    drift, jump, slip = (np.random.default_rng([seed, part]) for part in (20, 21, 22))
    sd = np.array([error.sd_xy, error.sd_xy, math.radians(error.sd_theta_deg)])
    every = TRACK_HZ // MAP_HZ
    knots_s, knots = track.times_s[::every], track.poses[::every]
    steps = np.diff(knots, axis=0)
    gone_m = np.hypot(steps[:, 0], steps[:, 1]) + TURN_AS_M * np.abs(steps[:, 2])
    keeps = np.exp(-gone_m / DRIFT_M)
    jumps = jump.random(len(steps)) < error.jumps_per_min / 60 / MAP_HZ
    keeps[jumps] = 0.0
    # An Ornstein-Uhlenbeck process along the way: the same spread everywhere.
    new = np.sqrt(1 - keeps**2)[:, None] * drift.standard_normal((len(steps), 3))
    errors = np.empty_like(knots)
    errors[0] = drift.standard_normal(3)
    for k in range(len(steps)):
        errors[k + 1] = keeps[k] * errors[k] + new[k]
    between = np.stack([np.interp(track.times_s, knots_s, e) for e in (errors * sd).T], axis=-1)
    return Localisation(
        track.times_s, track.poses + between, _odometry(track, slip),
        tuple(knots_s[1:][jumps].tolist()),
    )  # fmt: skip


def composed(outer: Floats, inner: Floats) -> Floats:
    """Return (n, 3) the poses `inner`, given in the frames whose poses are `outer`."""
    c, s = np.cos(outer[:, 2]), np.sin(outer[:, 2])
    x = outer[:, 0] + c * inner[:, 0] - s * inner[:, 1]
    y = outer[:, 1] + s * inner[:, 0] + c * inner[:, 1]
    return np.stack([x, y, outer[:, 2] + inner[:, 2]], axis=-1)


def inverse(poses: Floats) -> Floats:
    """Return (n, 3) the poses of the outer frame in the inner ones."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = -c * poses[:, 0] - s * poses[:, 1]
    y = s * poses[:, 0] - c * poses[:, 1]
    return np.stack([x, y, -poses[:, 2]], axis=-1)


def _odometry(track: Track, rng: np.random.Generator) -> Floats:
    """Return where wheels and gyroscope say that it is, from (0, 0, 0) on."""
    steps = np.diff(track.poses, axis=0)
    middle = (track.poses[1:, 2] + track.poses[:-1, 2]) / 2
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    aside = -steps[:, 0] * np.sin(middle) + steps[:, 1] * np.cos(middle)
    scale = 1 + rng.normal(0, ODOM_SCALE)
    turns = steps[:, 2] * (1 + rng.normal(0, ODOM_SLIP, len(steps)))
    turns = turns + rng.normal(0, 2e-5, len(steps))
    theta = np.concatenate([[0.0], np.cumsum(turns)])
    halfway = (theta[1:] + theta[:-1]) / 2
    x = np.cumsum(scale * (ahead * np.cos(halfway) - aside * np.sin(halfway)))
    y = np.cumsum(scale * (ahead * np.sin(halfway) + aside * np.cos(halfway)))
    return np.stack([np.concatenate([[0.0], x]), np.concatenate([[0.0], y]), theta], axis=-1)


def _interpolated(at_s: Floats, times_s: Floats, rows: Floats) -> Floats:
    return np.stack([np.interp(at_s, times_s, column) for column in rows.T], axis=-1)
