"""A spinning laser: from what its beams meet to the ranges that it reports.

Each beam is a cone: its two edges are cast, and where they meet different things the echo is mixed.
What comes back depends on the surface, its distance and the angle; glass lets through, mirrors and
only sometimes answers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol_sim.laser_casting import NOTHING, Hits, cast, cast_all
from patrol_sim.laser_people import LEG_M
from patrol_sim.laser_surfaces import REFLECTIVITY, Floats, Lines, Surface

MIX_FROM_M = 0.04
"""Edges of a beam that end so far apart are two echoes."""
PULSE_M = 0.6
"""Echoes nearer to each other than this are taken for one in between, by many sensors."""
FAINT = 0.0009
"""Reflectivity x cosine / range^2 at which half of the echoes are lost."""
STRAY = 0.002
"""Share of ranges that are nonsense: sunlight, another laser."""
DIRT_M = 0.03
"""A pane is equally dirty over that length."""
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

    def placed(self, base: Floats, *, as_told: bool) -> tuple[Floats, Floats]:
        """Return where each beam starts, (b, 2) m, and points to, (b,) rad.

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
        return origins, base[:, 2] + yaw + turned


def measured(
    laser: Laser, origins: Floats, bearings: Floats, lines: Lines, legs: Floats,
    rng: np.random.Generator,
) -> Floats:  # fmt: skip
    """Return the ranges of a scan, (b,) m; inf: no echo.

    Args:
        laser: What measures.
        origins: (b, 2) m, of each beam.
        bearings: (b,) rad; descending for a laser that hangs upside down.
        lines: All that there is.
        legs: (n, 2) m: where people's legs are.
        rng: Where all chance comes from.
    """
    if bearings[0] > bearings[-1]:
        return measured(laser, origins[::-1], bearings[::-1], lines, legs, rng)[::-1]
    half = math.radians(laser.divergence_deg) / 2
    edges = np.repeat(bearings, 2) + np.tile([-half, half], len(bearings))
    edges = np.maximum.accumulate(edges)  # ascending, however fast the robot turns
    starts = np.repeat(origins, 2, axis=0)
    echo = _echoes(laser, starts, edges, lines, legs, rng)
    return _reported(laser, *_merged(*echo, rng), rng)


@dataclass(frozen=True, slots=True)
class _Echo:
    """What the edges of beams meet."""

    ranges: Floats
    surface: NDArray[np.int8]
    cosine: Floats


def _echoes(
    laser: Laser, origins: Floats, bearings: Floats, lines: Lines, legs: Floats,
    rng: np.random.Generator,
) -> tuple[Floats, NDArray[np.int8], Floats]:  # fmt: skip
    is_glass = lines.surface == Surface.GLASS
    solid, glass = lines[~is_glass], lines[is_glass]
    hits = cast(origins, bearings, solid.ends, most_m=laser.range_max)
    ranges, cosine = hits.ranges, hits.cosine
    surface = np.where(hits.line == NOTHING, Surface.PAINT, solid.surface[hits.line]).astype(np.int8) \
        if len(solid) else np.zeros(len(ranges), np.int8)  # fmt: skip
    _legs_before(origins, bearings, legs, (ranges, surface, cosine))
    if len(glass):
        panes = cast(origins, bearings, glass.ends, most_m=laser.range_max)
        _glass_before(origins, bearings, (solid, glass), panes, (ranges, surface, cosine), rng)
    return ranges, surface, cosine


def _legs_before(
    origins: Floats, bearings: Floats, legs: Floats,
    echo: tuple[Floats, NDArray[np.int8], Floats],
) -> None:  # fmt: skip
    """Let legs stand in the way of beams."""
    ranges, surface, cosine = echo
    for leg in legs:
        to = leg - origins
        along = to[:, 0] * np.cos(bearings) + to[:, 1] * np.sin(bearings)
        aside = to[:, 1] * np.cos(bearings) - to[:, 0] * np.sin(bearings)
        deep = np.sqrt(np.maximum(LEG_M**2 - aside**2, 0))
        met = (np.abs(aside) < LEG_M) & (along - deep > 0) & (along - deep < ranges)
        ranges[met], surface[met] = (along - deep)[met], Surface.CLOTH
        cosine[met] = deep[met] / LEG_M


def _glass_before(
    origins: Floats, bearings: Floats, lines: tuple[Lines, Lines], panes: Hits,
    echo: tuple[Floats, NDArray[np.int8], Floats], rng: np.random.Generator,
) -> None:  # fmt: skip
    """Let panes answer, mirror, or let through: by their dirt and by the angle."""
    ranges, surface, cosine = echo
    solid, glass = lines
    first = np.flatnonzero(panes.ranges < ranges)
    if not len(first):
        return
    tilt = np.arccos(np.clip(panes.cosine[first], 0, 1))
    answers = 0.07 + 0.75 * np.exp(-((tilt / math.radians(14)) ** 2))
    mirrors = 0.05 + 0.6 * (tilt / (math.pi / 2)) ** 4
    spot = panes.line[first] * 7919 + (panes.along_m[first] / DIRT_M).astype(np.int64)
    dirt = np.mod(np.sin(spot * 12.9898) * 43758.5453, 1.0)
    luck = np.where(rng.random(len(first)) < 0.7, dirt, rng.random(len(first)))
    answered = first[luck < answers]
    ranges[answered], surface[answered] = panes.ranges[answered], Surface.GLASS
    cosine[answered] = panes.cosine[answered]
    mirrored = first[(luck >= answers) & (luck < answers + mirrors)]
    if len(mirrored):
        _mirror(origins[mirrored], bearings[mirrored], solid, glass, mirrored, panes, echo)


def _mirror(
    origins: Floats, bearings: Floats, solid: Lines, glass: Lines, beams: NDArray[np.int64],
    panes: Hits, echo: tuple[Floats, NDArray[np.int8], Floats],
) -> None:  # fmt: skip
    """Let beams go on from a pane to where it throws them."""
    ranges, surface, cosine = echo
    to = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    from_ = origins + panes.ranges[beams, None] * to
    pane = glass.ends[panes.line[beams]]
    thrown = 2 * np.arctan2(pane[:, 3] - pane[:, 1], pane[:, 2] - pane[:, 0]) - bearings
    near = np.abs(solid.ends.reshape(-1, 2, 2).mean(axis=1) - from_.mean(axis=0)).max(axis=1) < 9
    hits = cast_all(from_, thrown, solid.ends[near], most_m=10.0)
    ranges[beams] = panes.ranges[beams] + hits.ranges
    cosine[beams] = hits.cosine
    surface[beams] = Surface.SHINY


def _merged(
    ranges: Floats, surface: NDArray[np.int8], cosine: Floats, rng: np.random.Generator
) -> tuple[Floats, NDArray[np.int8], Floats]:
    """Return one echo a beam out of those of its two edges."""
    r, c = ranges.reshape(-1, 2), cosine.reshape(-1, 2)
    s = surface.reshape(-1, 2)
    weight = rng.random(len(r))
    with np.errstate(invalid="ignore"):
        gap = np.abs(r[:, 0] - r[:, 1])
        between = weight * r[:, 0] + (1 - weight) * r[:, 1]
    one = np.where(weight < 0.5, 0, 1)
    row = np.arange(len(r))
    either = r[row, one]
    same = ~(gap > MIX_FROM_M) & np.isfinite(r).all(axis=1)
    merged = np.where(same, r.mean(axis=1), np.where(gap < PULSE_M, between, either))
    return merged, s[row, one], c[row, one]


def _reported(
    laser: Laser, ranges: Floats, surface: NDArray[np.int8], cosine: Floats,
    rng: np.random.Generator,
) -> Floats:  # fmt: skip
    """Return what the laser makes of its echoes: noise, losses, whole steps."""
    near = np.where(np.isfinite(ranges), np.maximum(ranges, 0.1), 1.0)
    strength = REFLECTIVITY[surface] * np.maximum(cosine, 0.01) / near**2
    strength = np.where(surface == Surface.GLASS, 1.0, strength)  # its mirror image of the laser
    sd_m = (laser.sd_m + 0.0012 * near) * NOISE_FACTOR[surface]
    sd_m = sd_m * (1 + 0.5 * np.minimum((1 - cosine) / np.maximum(cosine, 0.05), 3.0))
    noisy = ranges + BIAS_M[surface] + sd_m * rng.standard_normal(len(ranges))
    lost = rng.random(len(ranges)) < FAINT / (FAINT + strength) + 0.001
    thrown = (surface == Surface.SHINY) & (rng.random(len(ranges)) < (1 - cosine) ** 3)
    stray = rng.random(len(ranges)) < STRAY
    noisy = np.where(stray, rng.uniform(0, laser.range_max, len(ranges)), noisy)
    noisy = np.round(noisy / laser.step_m) * laser.step_m
    gone = (lost | thrown) & ~stray
    out: Floats = np.where(
        gone | ~(noisy >= laser.range_min) | (noisy > laser.range_max), math.inf, noisy
    )
    return out
