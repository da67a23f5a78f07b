"""Which beams look at which door, and how, in the door's frame.

Doors are found by place, so that the cost depends only on the doors in reach.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.visit import FARTHEST, DoorPlaces, ScanModel, ScanStack

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]


OVER = 0.7
"""Of the width: how far before the line a leaf that is ajar reaches."""


@dataclass(frozen=True, slots=True, eq=False)
class DoorBeams:
    """Beams towards the lines of doors: `m` of them, in the frame of their door.

    The door's line goes from (0, 0) to (width, 0); all lengths in metres.
    """

    sight: Rows
    """(m,) ascending: which sight (a scan and a door) each belongs to."""
    x: Floats
    y: Floats
    """(m,) where the beam begins."""
    ux: Floats
    uy: Floats
    """(m,) its direction, of length 1."""
    range: Floats
    """(m,) inf: nothing came back."""
    max_range: Floats
    plane: Floats
    """(m,) how far it is to the door's line."""
    width: Floats
    sd: Floats
    """(m,) of the line's place, seen from the laser: localisation and drawing."""
    reaches: NDArray[np.bool_]
    """(m,) it did not end well before the line."""

    def only(self, chosen: NDArray[np.bool_] | Rows) -> DoorBeams:
        """Return the chosen beams."""
        return DoorBeams(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @property
    def where(self) -> Floats:
        """(m,) where along the door's line each crosses it, m."""
        return self.x + self.plane * self.ux

    @property
    def came_back(self) -> NDArray[np.bool_]:
        """(m,) whether a range was measured."""
        return np.isfinite(self.range)

    @property
    def behind(self) -> Floats:
        """(m,) how far beyond the line each ended, m, square to it; inf: it did not come back."""
        return (self.range - self.plane) * np.abs(self.uy)


@dataclass(frozen=True, slots=True, eq=False)
class Sights:
    """A scan and a door each: `p` of them, and the beams that belong to them."""

    scan: Rows
    door: Rows
    beams: DoorBeams
    """Through the door's line."""
    looks: Floats
    """(p,) how many looks one of them is worth."""
    hidden: Floats
    """(p,) how many beams towards the line ended well before it."""
    beside: DoorBeams
    """To the wall at both ends of the line."""
    side_looks: Floats
    """(p,)"""
    over: DoorBeams
    """The beams to that wall that cross the floor where a leaf swung towards the laser would stand;
    they are worth as many looks as `beside`."""


@dataclass(frozen=True, slots=True, eq=False)
class _Near:
    """Scans and doors, and where the laser is in the door's frame; a row each."""

    scan: Rows
    door: Rows
    lines: Floats
    x: Floats
    y: Floats


def sights_of(stack: ScanStack, lines: Floats, pairs: Pairs, model: ScanModel) -> Sights:
    """Return what scans see of doors; `lines` (d, 4): x, y, theta, width of every door.

    Of the beams that cross the line within its margins, those are used that are not too flat, and
    that ended at the line, beyond it, or where a leaf may stand. What ended before that (a person,
    a corner, another wall) says nothing about the door.
    """
    near = _in_sight(stack, lines, pairs, model)
    width = near.lines[:, 3]
    inner = np.full(len(width), model.margin), width - model.margin
    crossing = _towards(stack, near, [inner], model.beams)
    beams = _beams(stack, near, crossing, model)
    inside = (beams.where > 0) & (beams.where < beams.width)
    hidden = np.bincount(beams.sight[inside & ~beams.reaches], minlength=len(width))
    beams = beams.only(inside & (beams.reaches | _swept(beams)))
    outer = [
        (np.full(len(width), -model.beside), np.full(len(width), -model.margin)),
        (width + model.margin, width + model.beside),
    ]
    walls = _towards(stack, near, outer, model.side_beams)
    beside = _beams(stack, near, walls, model)
    over = beside.only(_is_over(beside) & (beside.reaches | _swept(beside)))
    beside = beside.only(beside.reaches & beside.came_back)
    return Sights(
        near.scan,
        near.door,
        beams,
        crossing.looks(width, model),
        hidden.astype(np.float64),
        beside,
        walls.looks(2 * (model.beside - model.margin), model),
        over,
    )


def _in_sight(stack: ScanStack, lines: Floats, pairs: Pairs, model: ScanModel) -> _Near:
    """Return those pairs of which the laser does not stand in the door's line."""
    scan, door = pairs
    x, y = _in_frame(stack.places[scan], lines[door])
    far = np.hypot(x - 0.5 * lines[door, 3], y)
    keep = (np.abs(y) > model.least_off) & (np.abs(y) > 0.2 * far)
    scan, door, x, y = (column[keep] for column in (scan, door, x, y))
    return _Near(scan, door, lines[door], x, y)


def _swept(beams: DoorBeams) -> NDArray[np.bool_]:
    """Return (m,) whether a beam ended where a leaf of the door can stand."""
    ended = np.where(beams.came_back, beams.range, 0)
    x, y = beams.x + ended * beams.ux, beams.y + ended * beams.uy
    from_hinge = np.minimum(np.hypot(x, y), np.hypot(x - beams.width, y))
    return beams.came_back & (from_hinge < beams.width + 0.1)


def _is_over(beams: DoorBeams) -> NDArray[np.bool_]:
    """Return (m,) whether a beam next to a door crosses the floor that its leaf sweeps."""
    before = beams.where - OVER * beams.width * beams.ux / np.abs(beams.uy)
    return (before > 0) & (before < beams.width)


def _in_frame(points: Floats, lines: Floats) -> tuple[Floats, Floats]:
    """Return x and y of points (n, 2) in the frame of a line each."""
    dx, dy = points[:, 0] - lines[:, 0], points[:, 1] - lines[:, 1]
    cos, sin = np.cos(lines[:, 2]), np.sin(lines[:, 2])
    return cos * dx + sin * dy, cos * dy - sin * dx


@dataclass(frozen=True, slots=True, eq=False)
class _Chosen:
    """Beams by their rows in the stack."""

    sight: Rows
    row: Rows
    number: Floats
    """(p,) how many beams of the scan go there."""
    chosen: Floats
    """(p,) how many of them were taken."""

    def looks(self, length: Floats | float, model: ScanModel) -> Floats:
        """Return (p,) what a taken beam is worth: near beams look at the same thing."""
        worth = np.minimum(np.minimum(self.number, length / model.cell), model.looks_a_scan)
        return np.asarray(worth / np.maximum(self.chosen, 1))


def _towards(
    stack: ScanStack, near: _Near, between: list[tuple[Floats, Floats]], most: int
) -> _Chosen:
    """Return evenly spaced beams to between two places on each line, at `most` of each stretch."""
    parts = [_evenly(stack, near, *ends, most) for ends in between]
    sight = np.concatenate([part.sight for part in parts])
    order = np.argsort(sight, kind="stable")
    row = np.concatenate([part.row for part in parts])
    number, chosen = (sum(getattr(p, name) for p in parts) for name in ("number", "chosen"))
    return _Chosen(sight[order], row[order], np.asarray(number), np.asarray(chosen))


def _evenly(stack: ScanStack, near: _Near, start: Floats, end: Floats, most: int) -> _Chosen:
    """Return evenly spaced beams to between `start` and `end` (p,) m on each line.

    A scan of a whole turn begins and ends in the same direction: what lies there is looked at by
    beams at both of its ends.
    """
    one, other = (np.arctan2(-near.y, at - near.x) for at in (start, end))
    extent = np.where(start < end, np.abs(other - one), -1.0)
    first = stack.bearings[stack.begins[near.scan]]
    since = np.remainder(np.minimum(one, other) + near.lines[:, 2] - first, 2 * np.pi)
    low, count = stack.between(near.scan, since, extent)
    also_low, also_count = stack.between(near.scan, since - 2 * np.pi, extent)
    number = count + also_count
    chosen = np.minimum(number, most)
    sight = np.repeat(np.arange(len(chosen)), chosen)
    at = np.arange(len(sight)) - np.repeat(np.cumsum(chosen) - chosen, chosen)
    apart = (number - 1) / np.maximum(chosen - 1, 1)
    nth = np.rint(at * apart[sight]).astype(np.intp)
    late = nth >= count[sight]
    row = np.where(late, also_low[sight] + nth - count[sight], low[sight] + nth)
    return _Chosen(sight, row, number.astype(np.float64), chosen.astype(np.float64))


def _beams(stack: ScanStack, near: _Near, chosen: _Chosen, model: ScanModel) -> DoorBeams:
    """Return chosen beams in their door's frame; those that were measured and are not too flat."""
    sight, row = chosen.sight, chosen.row
    lines, scan = near.lines[sight], near.scan[sight]
    x, y = _in_frame(stack.origins[row], lines)
    bearing = stack.bearings[row] - lines[:, 2]
    ux, uy = np.cos(bearing), np.sin(bearing)
    ranges = stack.ranges[row]
    plane = -y / np.where(np.abs(uy) < 1e-6, 1e-6, uy)
    sd = np.sqrt(stack.sd_xy[scan] ** 2 + model.sd_door**2 + (stack.sd_theta[scan] * plane) ** 2)
    reaches = ranges > plane - np.maximum(model.tolerance, 2 * sd)
    use = (plane > 0) & (plane < 4 * model.reach) & ~np.isnan(ranges)
    use &= np.abs(uy) > np.sin(model.flattest)
    max_range, width = stack.max_range[scan], lines[:, 3]
    return DoorBeams(sight, x, y, ux, uy, ranges, max_range, plane, width, sd, reaches).only(use)


Pairs = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Rows of points and of doors, which belong together."""


class DoorGrid:
    """The doors of a moment, by level and square of the floor."""

    def __init__(self, doors: DoorPlaces, *, reach: float) -> None:
        self._reach = reach
        lines = doors.lines.reshape(-1, 4)
        # a door without a place, or with an absurd one, is met nowhere
        usable = (np.abs(lines) < FARTHEST).all(1) & (lines[:, 3] > 0)
        x, y, theta, width = np.where(usable[:, None], lines, 0).T
        self.middles = np.stack(
            [x + 0.5 * width * np.cos(theta), y + 0.5 * width * np.sin(theta)], axis=1
        )
        """(d, 2) m"""
        self._squares = self._by_square(doors.levels, usable)

    def _by_square(
        self, levels: NDArray[np.int64], usable: NDArray[np.bool_]
    ) -> dict[tuple[int, int, int], NDArray[np.intp]]:
        """Return the doors in each square and its eight neighbours."""
        near = defaultdict(list)
        for row in np.flatnonzero(usable).tolist():
            column, line = self._square(self.middles[row : row + 1])[0].tolist()
            for dx in (-1, 0, 1):
                for dy in (-1, 0, 1):
                    near[int(levels[row]), column + dx, line + dy].append(row)
        return {square: np.array(rows, np.intp) for square, rows in near.items()}

    def _square(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.floor(points / self._reach).astype(np.int64)

    def near(self, levels: NDArray[np.int64], points: NDArray[np.float64]) -> Pairs:
        """Return the pairs of a point (n, 2) and a door's middle within reach, on one level."""
        found: list[Pairs] = []
        keys = np.column_stack([levels, self._square(points)])
        squares, place = np.unique(keys, axis=0, return_inverse=True)
        for i, square in enumerate(squares.tolist()):
            doors = self._squares.get(tuple(square))
            if doors is None:
                continue
            rows = np.flatnonzero(place.ravel() == i)
            apart = points[rows, None] - self.middles[None, doors]
            at, door = np.nonzero((apart**2).sum(-1) < self._reach**2)
            found.append((rows[at], doors[door]))
        if not found:
            return np.empty(0, np.intp), np.empty(0, np.intp)
        points_of, doors_of = (np.concatenate(parts) for parts in zip(*found, strict=True))
        order = np.lexsort((doors_of, points_of))
        return points_of[order], doors_of[order]
