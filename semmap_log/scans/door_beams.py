"""Which beams look at which door, and how, in the door's frame."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from semmap_log.scans.door_grid import Pairs
from semmap_log.scans.scan_model import ScanModel
from semmap_log.scans.scan_stack import ScanStack

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class DoorBeams:
    """Beams that cross the lines of doors: `m` of them, in the frame of their door.

    The door's line goes from (0, 0) to (width, 0); all lengths in metres.
    """

    pair: NDArray[np.intp]
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

    def only(self, chosen: NDArray[np.bool_]) -> DoorBeams:
        """Return the chosen beams."""
        return DoorBeams(*(getattr(self, field.name)[chosen] for field in fields(self)))


@dataclass(frozen=True, slots=True, eq=False)
class Sights:
    """A scan and a door each; `p` of them, and the beams that belong to them."""

    scan: NDArray[np.intp]
    door: NDArray[np.intp]
    number: Floats
    """(p,) how many beams of the scan cross the line."""
    beams: DoorBeams


def sights_of(stack: ScanStack, lines: Floats, pairs: Pairs, model: ScanModel) -> Sights:
    """Return what scans see of doors; `lines` (d, 4): x, y, theta, width of every door.

    A beam is used that crosses the line within its margins, neither too flat nor ended well
    before: what stands there says nothing about the door.
    """
    scan, door = pairs
    x, y, yaw = _in_frame(stack.places[scan], lines[door])
    width = lines[door, 3]
    off = np.abs(y)
    far = np.hypot(x - 0.5 * width, y)
    keep = (off > model.least_off) & (off > 0.2 * far)
    scan, door, x, y, yaw, width = (a[keep] for a in (scan, door, x, y, yaw, width))
    index, number = _crossing(stack, scan, x, y, yaw, width, model)
    pair = np.repeat(np.arange(len(scan)), index.shape[1])
    index = index.ravel()
    there = index >= 0
    pair, index = pair[there], index[there]
    beams = _beams(stack, pair, index, scan, lines[door], model)
    return Sights(scan, door, number, beams)


def _in_frame(points: Floats, lines: Floats) -> tuple[Floats, Floats, Floats]:
    """Return points (n, 2) in the frame of a line each, and how far the frame is turned."""
    dx, dy = points[:, 0] - lines[:, 0], points[:, 1] - lines[:, 1]
    cos, sin = np.cos(lines[:, 2]), np.sin(lines[:, 2])
    return cos * dx + sin * dy, cos * dy - sin * dx, lines[:, 2]


def _crossing(
    stack: ScanStack,
    scan: NDArray[np.intp],
    x: Floats,
    y: Floats,
    yaw: Floats,
    width: Floats,
    model: ScanModel,
) -> tuple[NDArray[np.intp], Floats]:
    """Return (p, beams) rows of evenly spaced beams towards each line, -1: none; and their number.

    A scan of a whole turn begins and ends in the same direction: a line there is looked at by
    beams at both of its ends.
    """
    one = np.arctan2(-y, model.margin - x)
    other = np.arctan2(-y, width - model.margin - x)
    extent = np.abs(other - one)
    first = np.minimum(one, other) + yaw
    base = stack.bearings[stack.begins[scan]]
    start = np.remainder(first - base, 2 * np.pi)
    behind = [_rows_between(stack, scan, start + turn, extent) for turn in (0.0, -2 * np.pi)]
    (low, count), (also_low, also_count) = behind
    total = count + also_count
    some = np.minimum(total, model.beams)
    at = np.arange(model.beams)
    spread = np.rint((total - 1)[:, None] * at / np.maximum(some - 1, 1)[:, None]).astype(np.intp)
    late = spread >= count[:, None]
    rows = np.where(late, also_low[:, None] + spread - count[:, None], low[:, None] + spread)
    return np.where(at < some[:, None], rows, -1), total.astype(np.float64)


def _rows_between(
    stack: ScanStack, scan: NDArray[np.intp], start: Floats, extent: Floats
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first beam at `start` or later from each scan's first beam, and how many follow.

    All scans are searched at once: their bearings stand one behind the other, each set apart from
    the one before.
    """
    lengths = np.diff(stack.begins)
    since = stack.bearings - np.repeat(stack.bearings[stack.begins[:-1]], lengths)
    apart = float(since.max(initial=0.0)) + 8 * np.pi
    keys = since + apart * np.repeat(np.arange(len(lengths)), lengths)
    end = np.minimum(start + extent, apart - 4 * np.pi)
    low = np.searchsorted(keys, apart * scan + np.maximum(start, -np.pi), side="left")
    high = np.searchsorted(keys, apart * scan + np.maximum(end, -np.pi), side="right")
    return low, np.maximum(high - low, 0)


def _beams(
    stack: ScanStack,
    pair: NDArray[np.intp],
    index: NDArray[np.intp],
    scan: NDArray[np.intp],
    lines: Floats,
    model: ScanModel,
) -> DoorBeams:
    """Return the beams of these rows that say something, in their door's frame."""
    width = lines[pair, 3]
    x, y, yaw = _in_frame(stack.origins[index], lines[pair])
    bearing = stack.bearings[index] - yaw
    ux, uy = np.cos(bearing), np.sin(bearing)
    ranges, at = stack.ranges[index], scan[pair]
    plane = -y / np.where(np.abs(uy) < 1e-6, 1e-6, uy)
    where = x + plane * ux
    sd = np.sqrt(stack.sd_xy[at] ** 2 + model.sd_door**2 + (stack.sd_theta[at] * plane) ** 2)
    use = (plane > 0) & (np.abs(uy) > np.sin(model.flattest)) & (where > 0) & (where < width)
    use &= ranges > plane - np.maximum(model.tolerance, 2 * sd)
    return DoorBeams(
        *(a[use] for a in (pair, x, y, ux, uy, ranges, stack.max_range[at], plane, width, sd))
    )
