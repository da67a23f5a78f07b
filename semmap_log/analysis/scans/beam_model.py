"""How likely each range is, for a stand of the leaf and a small shift of the robot from its place.

The beam model is the mixture of laser localisation (hit, short, lost, stray: Thrun, Burgard and
Fox, "Probabilistic Robotics", 6.3), where the leaf is hit, or else the room beyond the door. The
hit's noise is Student's, not normal: its scale is not known well either, since the pose drifts
within a visit. Per beam, with d the distance to the leaf or else to the line:

    met:   hit ((1 - g) T(r; d, s) + g B(r - line)) + short / line [r < d] + stray / max
    free:  hit B(r - line) + short / line [r < line] + stray / max

B(x) = exp(-x / room) / room is the depth of what lies beyond, hit = (1 - short - stray) (1 - lost),
g the chance that a beam passes the leaf. A beam that did not come back says as little as its range
is long: p(lost | free) = lost + (1 - lost) exp(-(max - line) / room).

The flatter a beam meets a leaf, the less is known of the leaf's distance, and of whether a beam
near its end meets it: the error of the pose counts across the leaf. Near its ends p is a mean of
both.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.door_beams import DoorBeams
from semmap_log.analysis.scans.leaves import Leaves, shifted, shifted_planes
from semmap_log.analysis.scans.visit import ScanModel

Floats = NDArray[np.float64]
Table = NDArray[np.float32]

FREEDOM = 3.0
"""Of the noise's distribution: (1 + z^2 / 3)^-2, times its height over the spread."""
HEIGHT = 2 / (pi * sqrt(FREEDOM))
LEAST_RANGE = 0.05
"""m; a leaf nearer than that is inside the laser's housing, not before it."""
LEAST_SINE = 1e-4
"""Of the angle between a beam and a leaf: flatter ones count as that flat."""


def log_likelihoods(beams: DoorBeams, leaves: Leaves, glass: Floats, model: ScanModel) -> Table:
    """Return (m, s, h): log p(range | shift of the laser, stand of the leaves) of each beam.

    `glass` (m,): P(the beam passes a leaf). Beams run fastest in memory: there are most of them.
    """
    table = _likelihoods(beams, leaves, _View.of(beams, glass, model), model)
    return np.asarray(np.log(table, out=table).transpose(2, 1, 0))


def log_ratios(beams: DoorBeams, leaves: Leaves, glass: Floats, model: ScanModel) -> Table:
    """Return (m, s, h): how much better each stand of the leaves explains a beam than none does.

    This includes beams next to the door, which cross its leaf if it is swung towards the laser;
    for what they show of the wall see `wall_log_likelihoods`.
    """
    view = _View.of(beams, glass, model, wall_there=model.wall_there)
    table = _likelihoods(beams, leaves, view, model)
    table /= view.free
    return np.asarray(np.log(table, out=table).transpose(2, 1, 0))


def _likelihoods(beams: DoorBeams, leaves: Leaves, view: _View, model: ScanModel) -> Table:
    """Return (h, s, m): p(range | shift of the laser, stand of the leaves)."""
    table = np.empty((len(leaves.clear), *view.free.shape), np.float32)
    table[: len(table) - len(leaves.both)] = view.free
    nearest = np.full((), np.inf, np.float32)
    for k, count in enumerate(leaves.with_leaf):
        leaf = _LeafView.of(beams, leaves, count, k, model)
        far = leaf.far(view)
        met = leaf.share_met(view)
        met *= (far > view.blind) & (far < view.wall_at)
        if k:
            met *= far < nearest[:count]
        chance = _chance(far, leaf, view)
        if not k and len(leaves.both):
            both, before, behind = leaves.both.T
            hides = (met[behind] >= 0.5) & (far[behind] < far[before])
            walled, ends = np.where(hides, 0, met[before]), chance[before]
        _lay(table[:count], met, chance)
        if k + 1 < len(leaves.with_leaf):
            nearest = np.where(met >= 0.5, far, np.float32(np.inf))
    if len(leaves.both):
        table[both] = table[behind]
        _lay(table[both[0] :], walled, ends)
    return table


def _lay(table: Table, met: Table, chance: Table) -> None:
    """Add a leaf to rows of the table: a share `met` of each beam ends on it.

    It overwrites `chance`.
    """
    chance -= table
    chance *= met
    table += chance


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """The part of the mixture that is independent of the leaves; (s, m), or (m,) without shifts.

    Distances are in metres beyond where the beam ended.
    """

    x: Table
    y: Table
    """Where the beam begins, m."""
    ended: Table
    """(m,) m; where a lost beam would have ended."""
    blind: Table
    """(m,) nothing nearer than that is met."""
    wall_at: Table
    """The wall's distance, if the shift puts the beam next to the door; inf: it does not."""
    before: Table
    """A leaf nearer than that looks like a person."""
    free: Table
    """p, if no leaf is met."""
    peak: Table
    """(m,) p at the very place of a leaf, through the noise alone, times the noise's scale."""
    ends_short: Table
    """p, if the leaf is beyond where the beam ended, apart from the noise."""
    ends_beyond: Table
    """The same, if the leaf is nearer."""
    persuades: np.float32
    """By how much such a leaf counts less."""

    @classmethod
    def of(
        cls, beams: DoorBeams, glass: Floats, model: ScanModel, *, wall_there: float = 1.0
    ) -> _View:
        lost = ~beams.came_back
        ended = np.where(lost, beams.max_range, beams.range)
        spread = _spread(beams, np.abs(beams.uy), model)
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
        peak = hit * (1 - glass) * HEIGHT * sqrt(FREEDOM)
        noise = peak * scale * (1 + (past * scale) ** 2) ** -2
        behind = hit * depth
        stopped = wall_there * noise + (1 - wall_there) * behind
        free = np.where(wall, stopped, behind) + np.where(past < 0, short, 0) + stray
        gone = np.where(wall, model.lost, model.lost + (1 - model.lost) * tail)
        off_leaf = model.lost + glass * (gone - model.lost)
        return cls(
            x=_single(x),
            y=_single(y),
            ended=_single(ended),
            blind=_single(LEAST_RANGE - ended),
            wall_at=_single(np.where(wall & (wall_there == 1), -past, np.inf)),
            before=_single(-past - model.before),
            free=_single(np.where(lost, gone, free)),
            peak=_single(np.where(lost, 0, peak)),
            ends_short=_single(np.where(lost, off_leaf, short + stray)),
            ends_beyond=_single(np.where(lost, off_leaf, hit * glass * depth + stray)),
            persuades=np.float32(model.persuades),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _LeafView:
    """The `k`-th leaf of each hypothesis before the beams: all is linear in where a beam begins.

    How far a leaf is, and where a beam crosses it, is known the worse the flatter the beam meets
    it: an error across the leaf counts many times along it.
    """

    far_by_x: Table
    far_by_y: Table
    far_at: Table
    """(h, 1, m) m: how far a beam goes to the leaf."""
    scale: Table
    """(h, 1, m) noise scales in a metre."""
    along_by_x: Table
    along_by_y: Table
    along_at: Table
    """(h, 1, m) where it crosses the leaf, from its middle; the ends are blurred over 1."""
    half: Table
    """(h, 1, m) so far from its middle the leaf is met by no beam."""

    @classmethod
    def of(
        cls, beams: DoorBeams, leaves: Leaves, count: int, k: int, model: ScanModel
    ) -> _LeafView:
        turn = leaves.turns[:count, k, None]
        ex, ey = np.cos(turn), np.sin(turn)
        ux, uy, width = _single(beams.ux), _single(beams.uy), _single(beams.width)
        ax, ay = (leaves.starts[:count, k, i, None] * width for i in (0, 1))
        length = leaves.lengths[:count, k, None] * width
        sine = ux * ey - uy * ex
        sine = np.where(np.abs(sine) < LEAST_SINE, np.float32(LEAST_SINE), sine)
        flat = np.abs(sine)
        inverse = 1 / sine
        blurred = np.maximum(np.float32(model.blurred), _single(0.5 * beams.sd) / flat)
        part = 0.5 / blurred
        share = inverse * part
        middle = 0.5 * length * part
        columns = (
            -ey * inverse,
            ex * inverse,
            (ax * ey - ay * ex) * inverse,
            1 / (sqrt(FREEDOM) * _spread(beams, flat, model)),
            -uy * share,
            ux * share,
            (ax * uy - ay * ux) * share - middle,
            0.5 + middle,
        )
        return cls(*(np.asarray(values[:, None], np.float32) for values in columns))

    def far(self, view: _View) -> Table:
        """Return (h, s, m) how far beyond where a beam ended the leaf is, m."""
        found = view.x * self.far_by_x
        found += view.y * self.far_by_y
        found += self.far_at - view.ended
        return found

    def share_met(self, view: _View) -> Table:
        """Return (h, s, m) P(a beam meets the leaf)."""
        found = view.x * self.along_by_x
        found += view.y * self.along_by_y
        found += self.along_at
        np.subtract(self.half, np.abs(found, out=found), out=found)
        return np.clip(found, 0, 1, out=found)


def _chance(far: Table, leaf: _LeafView, view: _View) -> Table:
    """Return (h, s, m) p of the ranges, were a leaf met at `far`."""
    chance = far * leaf.scale
    chance *= chance
    chance += 1
    chance *= chance
    np.divide(view.peak * leaf.scale, chance, out=chance)
    np.multiply(chance, view.persuades, out=chance, where=far < view.before)
    chance += np.where(far > 0, view.ends_short, view.ends_beyond)
    return chance


def wall_log_likelihoods(beams: DoorBeams, model: ScanModel) -> Floats:
    """Return (m, s + 1): log p(range | shift) of beams next to a door, if the wall is in its line.

    The last column is that of a wall that is anywhere else near it.
    """
    past = beams.range[:, None] - shifted_planes(beams)
    spread = _spread(beams, np.abs(beams.uy), model)[:, None].astype(np.float64)
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


def _spread(beams: DoorBeams, sine: Floats | Table, model: ScanModel) -> Table:
    """Return the noise of a range, m, of beams that meet something at an angle of that `sine`.

    Half of the pose's error drifts within a visit.
    """
    across = _single(0.5 * beams.sd)
    return np.asarray(np.hypot(np.float32(model.sd_range), across / sine), np.float32)


def _single(values: Floats) -> Table:
    return np.ascontiguousarray(values, np.float32)
