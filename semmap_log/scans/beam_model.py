"""How likely each range is, were the leaf so and the robot a little beside its place.

The beam model is the mixture of laser localisation (hit, short, lost, stray: Thrun, Burgard and
Fox, "Probabilistic Robotics", 6.3), with the leaf, or else the room behind the door, as what is
hit. The hit's noise is Student's, not normal: its scale is not known well either, since the pose
drifts within a visit. Per beam, with d the distance to the leaf or else to the line:

    met:   hit ((1 - g) T(r; d, s) + g B(r - line)) + short / line [r < d] + stray / max
    free:  hit B(r - line) + short / line [r < line] + stray / max

B(x) = exp(-x / room) / room is the depth of what lies behind, hit = (1 - short - stray) (1 - lost),
g the chance that a beam passes the leaf. A beam that did not come back says as little as its range
is long: p(lost | free) = lost + (1 - lost) exp(-(max - line) / room).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from semmap_log.scans.door_beams import DoorBeams
from semmap_log.scans.leaves import Leaves
from semmap_log.scans.scan_model import ScanModel
from semmap_log.scans.shifts import shifted, shifted_planes

Floats = NDArray[np.float64]
Table = NDArray[np.float32]

FREEDOM = 3.0
"""Of the noise's distribution: (1 + z^2 / 3)^-2, times its height over the spread."""
HEIGHT = 2 / (pi * sqrt(FREEDOM))
LEAST_RANGE = 0.05
"""m; a leaf nearer than that is behind the laser's glass, not before it."""
LEAST_SINE = 1e-4
"""Of the angle between a beam and a leaf: flatter ones count as that flat."""

LEAST_LENGTH = 1e-3
"""Of a leaf, in widths: a row that has fewer leaves than others is never met at the rest."""


def log_likelihoods(beams: DoorBeams, leaves: Leaves, glass: Floats, model: ScanModel) -> Table:
    """Return (m, s, h): log p(range | shift of the laser, stand of the leaves) of each beam.

    `glass` (m,): P(the beam passes a leaf). Beams run fastest in memory: there are most of them.
    """
    view = _View.of(beams, glass, model)
    table = np.repeat(view.free[None], len(leaves.clear), axis=0)
    nearest = np.broadcast_to(view.wall_at, table.shape)
    for k in range(leaves.most):
        far, along = _met(beams, view, leaves, k)
        met = np.abs(along, out=along) <= 0.5
        met &= far > view.blind
        met &= far < nearest
        met &= (leaves.lengths[:, k] > 0)[:, None, None]
        np.copyto(table, _chance(far, view), where=met)
        if k + 1 < leaves.most:
            nearest = np.where(met, far, nearest)
    return np.asarray(np.log(table, out=table).transpose(2, 1, 0))


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """What of the mixture does not depend on the leaves; (s, m), or (m,) where shifts do not count.

    Distances are in noise scales beyond where the beam ended.
    """

    x: Table
    y: Table
    """Where the beam begins, m."""
    scale: Floats
    """(m,) noise scales in a metre."""
    ended: Floats
    """(m,) m; where a lost beam would have ended."""
    blind: Table
    """(m,) nearer than that nothing is met."""
    wall_at: Table
    """The wall: where the shift puts the beam beside the door; inf: it does not."""
    before: Table
    """A leaf nearer than that looks like anybody."""
    free: Table
    """p, if no leaf is met."""
    peak: Table
    """(m,) p at the very place of a leaf, through the noise alone."""
    ends_short: Table
    """p, if the leaf is beyond where the beam ended, beside the noise."""
    ends_beyond: Table
    """The same, if the leaf is nearer."""
    persuades: np.float32
    """By how much such a leaf counts less."""

    @classmethod
    def of(cls, beams: DoorBeams, glass: Floats, model: ScanModel) -> _View:
        lost = ~beams.came_back
        ended = np.where(lost, beams.max_range, beams.range)
        spread = _spread(beams, model)
        scale = 1 / (sqrt(FREEDOM) * spread)
        x, y = (column.T for column in shifted(beams))
        plane = shifted_planes(beams).T
        where = x + plane * beams.ux
        wall = (where < 0) | (where > beams.width)
        past = ended - plane
        hit = (1 - model.short - model.stray) * (1 - model.lost)
        stray = model.stray / beams.max_range
        short = model.short / np.maximum(plane, 0.1)
        tail = np.exp(-np.clip(past, 0, None) / model.room)
        depth = np.where(past > -LEAST_RANGE, tail / model.room, 0)
        peak = hit * (1 - glass) * HEIGHT / spread
        noise = peak * (1 + (past * scale) ** 2) ** -2
        free = np.where(wall, noise, hit * depth) + np.where(past < 0, short, 0) + stray
        gone = np.where(wall, model.lost, model.lost + (1 - model.lost) * tail)
        off_leaf = model.lost + glass * (gone - model.lost)
        return cls(
            x=_single(x),
            y=_single(y),
            scale=scale,
            ended=ended,
            blind=_single((LEAST_RANGE - ended) * scale),
            wall_at=_single(np.where(wall, -past * scale, np.inf)),
            before=_single((-past - model.before) * scale),
            free=_single(np.where(lost, gone, free)),
            peak=_single(np.where(lost, 0, peak)),
            ends_short=_single(np.where(lost, off_leaf, short + stray)),
            ends_beyond=_single(np.where(lost, off_leaf, hit * glass * depth + stray)),
            persuades=np.float32(model.persuades),
        )


def _chance(far: Table, view: _View) -> Table:
    """Return (h, s, m) p of the ranges, were a leaf met at `far`."""
    chance = far * far
    chance += 1
    chance *= chance
    np.reciprocal(chance, out=chance)
    chance *= view.peak
    np.multiply(chance, view.persuades, out=chance, where=far < view.before)
    chance += np.where(far > 0, view.ends_short, view.ends_beyond)
    return chance


def _met(beams: DoorBeams, view: _View, leaves: Leaves, k: int) -> tuple[Table, Table]:
    """Return (h, s, m) how far a leaf lies beyond where the beam ended, and where on it: -0.5..0.5.

    Both are linear in where the beam begins.
    """
    turn = leaves.turns[:, k, None].astype(np.float64)
    ex, ey = np.cos(turn), np.sin(turn)
    ux, uy = beams.ux, beams.uy
    ax, ay = (leaves.starts[:, k, i, None] * beams.width for i in (0, 1))
    sine = ux * ey - uy * ex
    sine = np.where(np.abs(sine) < LEAST_SINE, LEAST_SINE, sine)
    much = view.scale / sine
    ended = view.ended * view.scale
    far = _linear(view, -ey * much, ex * much, (ax * ey - ay * ex) * much - ended)
    length = np.maximum(leaves.lengths[:, k, None], LEAST_LENGTH) * beams.width
    share = 1 / (sine * length)
    return far, _linear(view, -uy * share, ux * share, (ax * uy - ay * ux) * share - 0.5)


def _linear(view: _View, by_x: Floats, by_y: Floats, fixed: Floats) -> Table:
    """Return (h, s, m): x by_x + y by_y + fixed, the factors (h, m)."""
    found = view.x * _single(by_x)[:, None]
    found += view.y * _single(by_y)[:, None]
    found += _single(fixed)[:, None]
    return found


def wall_log_likelihoods(beams: DoorBeams, model: ScanModel) -> Floats:
    """Return (m, s + 1): log p(range | shift) of beams beside a door, were the wall in its line.

    The last column is that of a wall that is anywhere else near it.
    """
    past = beams.range[:, None] - shifted_planes(beams)
    spread = _spread(beams, model)[:, None]
    hit = 1 - model.short - model.stray
    stray = model.stray / beams.max_range[:, None]
    short = model.short / np.maximum(beams.plane, 0.1)[:, None]

    def chance(past: Floats, spread: Floats) -> Floats:
        noise = np.exp(-0.5 * (past / spread) ** 2) / (spread * sqrt(2 * pi))
        depth = np.where(past > 0, np.exp(-np.clip(past, 0, None) / model.room) / model.room, 0)
        ends = model.wall_there * noise + (1 - model.wall_there) * depth
        return np.asarray(hit * ends + np.where(past < 0, short, 0) + stray)

    anywhere = chance(past[:, :1], np.full_like(spread, 0.4))
    return np.asarray(np.log(np.concatenate([chance(past, spread), anywhere], axis=1)))


def _spread(beams: DoorBeams, model: ScanModel) -> Floats:
    """Return (m,) the noise of a range, m: half of the pose's error drifts within a visit."""
    return np.asarray(np.hypot(model.sd_range, 0.5 * beams.sd / np.abs(beams.uy)))


def _single(values: Floats) -> Table:
    return np.ascontiguousarray(values, np.float32)
