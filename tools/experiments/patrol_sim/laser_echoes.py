"""What comes back to a laser: from walls, legs and glass, mirrored, and mixed.

Each beam is a cone: its two edges are cast, and where they meet different things the echo is mixed.
Glass lets through, mirrors and only sometimes answers, by its dirt and by the angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol_sim.laser_casting import NOTHING, Hits, cast, cast_all
from patrol_sim.laser_people import LEG_M
from patrol_sim.laser_surfaces import Floats, Lines, Surface

MIX_FROM_M = 0.04
"""Edges of a beam that end so far apart are two echoes."""
PULSE_M = 0.6
"""Echoes nearer to each other than this are taken for one in between, by many sensors."""
DIRT_M = 0.03
"""A pane is equally dirty over that length."""
MIRRORED_M = 9.0
"""What is farther than that from a pane is not looked for in it."""


@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """Rays on the map."""

    origins: Floats
    """(b, 2) m."""
    bearings: Floats
    """(b,) rad."""

    @property
    def to(self) -> Floats:
        """(b, 2) their directions."""
        return np.stack([np.cos(self.bearings), np.sin(self.bearings)], axis=-1)

    def backwards(self) -> Beams:
        """Return the last beam first."""
        return Beams(self.origins[::-1], self.bearings[::-1])

    def edges(self, width: float) -> Beams:
        """Return both edges of each beam, one after the other; they are so wide, rad."""
        bearings = np.repeat(self.bearings, 2) + np.tile(
            [-width / 2, width / 2], len(self.bearings)
        )
        ascending = np.maximum.accumulate(bearings)  # however fast the robot turns
        return Beams(np.repeat(self.origins, 2, axis=0), ascending)


@dataclass(frozen=True, slots=True, eq=False)
class Echoes:
    """What beams meet; changed in place while nearer things are found."""

    ranges: Floats
    """(b,) m; inf: nothing."""
    surface: NDArray[np.int8]
    cosine: Floats
    """Of the incidence: 1 straight on, 0 grazing."""


def echoes_of(
    beams: Beams, lines: Lines, legs: Floats, most_m: float, rng: np.random.Generator
) -> Echoes:
    """Return what each beam meets; bearings ascend."""
    is_glass = lines.surface == Surface.GLASS
    solid, glass = lines[~is_glass], lines[is_glass]
    hits = cast(beams.origins, beams.bearings, solid.ends, most_m=most_m)
    surface = np.zeros(len(hits.ranges), np.int8)
    met = hits.line != NOTHING
    surface[met] = solid.surface[hits.line[met]]
    echoes = Echoes(hits.ranges, surface, hits.cosine)
    for leg in legs:
        _stand_before(beams, leg, echoes)
    if len(glass):
        panes = cast(beams.origins, beams.bearings, glass.ends, most_m=most_m)
        mirrored = _answer(panes, echoes, rng)
        if len(mirrored):
            _throw(beams, mirrored, panes, (solid, glass), echoes)
    return echoes


def merged(edges: Echoes, rng: np.random.Generator) -> Echoes:
    """Return one echo a beam out of those of its two edges."""
    ranges, cosine = edges.ranges.reshape(-1, 2), edges.cosine.reshape(-1, 2)
    surface = edges.surface.reshape(-1, 2)
    weight = rng.random(len(ranges))
    with np.errstate(invalid="ignore"):
        gap = np.abs(ranges[:, 0] - ranges[:, 1])
        between = weight * ranges[:, 0] + (1 - weight) * ranges[:, 1]
    row, one = np.arange(len(ranges)), (weight >= 0.5).astype(int)
    same = ~(gap > MIX_FROM_M) & np.isfinite(ranges).all(axis=1)
    mixed = np.where(gap < PULSE_M, between, ranges[row, one])
    return Echoes(np.where(same, ranges.mean(axis=1), mixed), surface[row, one], cosine[row, one])


def _stand_before(beams: Beams, leg: Floats, echoes: Echoes) -> None:
    """Let a leg stand in the way."""
    away, to = leg - beams.origins, beams.to
    along = (away * to).sum(axis=1)
    aside = away[:, 1] * to[:, 0] - away[:, 0] * to[:, 1]
    deep = np.sqrt(np.maximum(LEG_M**2 - aside**2, 0))
    near = along - deep
    met = (np.abs(aside) < LEG_M) & (near > 0) & (near < echoes.ranges)
    echoes.ranges[met], echoes.surface[met] = near[met], Surface.CLOTH
    echoes.cosine[met] = deep[met] / LEG_M


def _answer(panes: Hits, echoes: Echoes, rng: np.random.Generator) -> NDArray[np.int64]:
    """Let panes answer where they do; return which beams they mirror instead."""
    first = np.flatnonzero(panes.ranges < echoes.ranges)
    tilt = np.arccos(np.clip(panes.cosine[first], 0, 1))
    answers = 0.07 + 0.75 * np.exp(-((tilt / math.radians(14)) ** 2))
    mirrors = 0.05 + 0.6 * (tilt / (math.pi / 2)) ** 4
    spot = panes.line[first] * 7919 + (panes.along_m[first] / DIRT_M).astype(np.int64)
    dirt = np.mod(np.sin(spot * 12.9898) * 43758.5453, 1.0)
    luck = np.where(rng.random(len(first)) < 0.7, dirt, rng.random(len(first)))
    answered = first[luck < answers]
    echoes.ranges[answered] = panes.ranges[answered]
    echoes.surface[answered] = Surface.GLASS
    echoes.cosine[answered] = panes.cosine[answered]
    mirrored: NDArray[np.int64] = first[(luck >= answers) & (luck < answers + mirrors)]
    return mirrored


def _throw(
    beams: Beams, which: NDArray[np.int64], panes: Hits, lines: tuple[Lines, Lines], echoes: Echoes
) -> None:
    """Let beams go on from their panes to where these throw them; `lines`: solid, glass."""
    solid, glass = lines
    ranges, pane = panes.ranges, glass.ends[panes.line[which]]
    from_ = beams.origins[which] + ranges[which, None] * beams.to[which]
    turn = np.arctan2(pane[:, 3] - pane[:, 1], pane[:, 2] - pane[:, 0])
    middles = solid.ends.reshape(-1, 2, 2).mean(axis=1)
    near = solid[np.abs(middles - from_.mean(axis=0)).max(axis=1) < MIRRORED_M]
    hits = cast_all(from_, 2 * turn - beams.bearings[which], near.ends, most_m=MIRRORED_M)
    echoes.ranges[which] = ranges[which] + hits.ranges
    echoes.cosine[which] = hits.cosine
    echoes.surface[which] = Surface.SHINY
