"""A spinning laser: how it is built and mounted, and the ranges that it reports."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from patrol_sim.laser_echoes import Beams, Echoes, echoes_of, merged
from patrol_sim.laser_surfaces import REFLECTIVITY, Floats, Lines, Surface

FAINT = 0.0009
"""Reflectivity x cosine / range^2 at which half of the echoes are lost."""
LOST = 0.001
"""Share of echoes that are lost anyway."""
STRAY = 0.002
"""Share of ranges that are nonsense: sunlight, another laser."""
NOISE_PER_M = 0.0012
NOISE_FACTOR = np.array([1.0, 1.0, 2.0, 1.6, 1.3, 2.0])
BIAS_M = np.array([0.0, 0.0, 0.012, -0.008, 0.004, 0.0])
"""Of each surface: dark ones answer late, shiny ones early."""


@dataclass(frozen=True, slots=True)
class Laser:
    """What is built in, and how it is mounted."""

    beams: int = 360
    field_deg: float = 270.0
    hz: float = 10.0
    spins: bool = True
    """Beams are measured one after the other; False: all at once."""
    range_min: float = 0.05
    range_max: float = 20.0
    sd_m: float = 0.008
    """Noise of a near, bright surface; it grows with the range."""
    step_m: float = 0.001
    """Ranges are whole multiples of it."""
    divergence_deg: float = 0.25
    x: float = 0.14
    y: float = 0.02
    z: float = 0.22
    yaw: float = 0.03
    """On the robot's base, m and rad."""
    upside_down: bool = False
    yaw_error_deg: float = 0.0
    """It is really mounted so far from what its transform says."""

    @property
    def angles(self) -> Floats:
        """(b,) rad, as a LaserScan has them: about the laser's own z axis."""
        half = math.radians(self.field_deg) / 2
        if self.field_deg >= 360:  # the last beam is not the first once more
            angles: Floats = -math.pi + math.tau / self.beams * np.arange(self.beams)
        else:
            angles = np.linspace(-half, half, self.beams)
        return angles

    @property
    def increment(self) -> float:
        """Between neighbouring beams, rad."""
        return float(self.angles[1] - self.angles[0])

    @property
    def time_increment_s(self) -> float:
        """Between neighbouring beams, s."""
        return self.increment / math.tau / self.hz if self.spins else 0.0

    def placed(self, base: Floats, *, as_told: bool) -> Beams:
        """Return its beams on the map.

        Args:
            base: (b, 3) the robot's pose when each is measured.
            as_told: By the transform that is published; False: as it is really mounted.
        """
        c, s = np.cos(base[:, 2]), np.sin(base[:, 2])
        origins = np.stack(
            [base[:, 0] + c * self.x - s * self.y, base[:, 1] + s * self.x + c * self.y], axis=-1
        )
        yaw = self.yaw + (0.0 if as_told else math.radians(self.yaw_error_deg))
        turned = -self.angles if self.upside_down else self.angles
        return Beams(origins, base[:, 2] + yaw + turned)


def measured(
    laser: Laser, beams: Beams, lines: Lines, legs: Floats, *, rng: np.random.Generator
) -> Floats:
    """Return the ranges of a scan, (b,) m; inf: no echo.

    Args:
        laser: What measures.
        beams: Ascending bearings, or descending ones of a laser that hangs upside down.
        lines: All that there is.
        legs: (n, 2) m: where people's legs are.
        rng: Where all chance comes from.
    """
    if beams.bearings[0] > beams.bearings[-1]:
        return measured(laser, beams.backwards(), lines, legs, rng=rng)[::-1]
    edges = beams.edges(math.radians(laser.divergence_deg))
    return _reported(laser, merged(echoes_of(edges, lines, legs, laser.range_max, rng), rng), rng)


def _reported(laser: Laser, echoes: Echoes, rng: np.random.Generator) -> Floats:
    """Return what the laser makes of its echoes: noise, losses, whole steps."""
    ranges, surface, cosine = echoes.ranges, echoes.surface, echoes.cosine
    near = np.where(np.isfinite(ranges), np.maximum(ranges, 0.1), 1.0)
    strength = REFLECTIVITY[surface] * np.maximum(cosine, 0.01) / near**2
    strength = np.where(surface == Surface.GLASS, 1.0, strength)  # its mirror image of the laser
    sd_m = (laser.sd_m + NOISE_PER_M * near) * NOISE_FACTOR[surface]
    sd_m = sd_m * (1 + 0.5 * np.minimum((1 - cosine) / np.maximum(cosine, 0.05), 3.0))
    noisy = ranges + BIAS_M[surface] + sd_m * rng.standard_normal(len(ranges))
    lost = rng.random(len(ranges)) < FAINT / (FAINT + strength) + LOST
    thrown = (surface == Surface.SHINY) & (rng.random(len(ranges)) < (1 - cosine) ** 3)
    stray = rng.random(len(ranges)) < STRAY
    noisy = np.where(stray, rng.uniform(0, laser.range_max, len(ranges)), noisy)
    noisy = np.round(noisy / laser.step_m) * laser.step_m
    gone = (lost | thrown) & ~stray
    within = (noisy >= laser.range_min) & (noisy <= laser.range_max)
    reported: Floats = np.where(~gone & within, noisy, math.inf)
    return reported
