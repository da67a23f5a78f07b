"""Scans of one laser, one behind the other, as arrays over all their beams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.placed_scan import PlacedScan
from semmap_log.analysis.scans.scan_model import ScanModel

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

LEAST_RANGE = 0.02
"""m; what is nearer was not measured."""
LARGEST_RANGE = 1000.0
"""m; a laser that tells of more means that it does not know."""
LARGEST_SD = 10.0
"""m, or rad: whoever tells of more does not know where the robot is."""
FARTHEST = 1e7
"""m from the map's origin; what is farther is no place on Earth."""


@dataclass(frozen=True, slots=True, eq=False)
class ScanStack:
    """`t` scans of `n` beams in all; within a scan the bearings ascend."""

    stamps_ns: NDArray[np.int64]
    """(t,)"""
    levels: NDArray[np.int64]
    """(t,)"""
    places: Floats
    """(t, 2) of the laser in the middle of its turn, m."""
    sd_xy: Floats
    sd_theta: Floats
    """(t,) as told, else the model's; m, rad."""
    max_range: Floats
    """(t,) m"""
    begins: Rows
    """(t + 1,) the beams of scan i are begins[i] to begins[i + 1]."""
    origins: Floats
    """(n, 2) m"""
    bearings: Floats
    """(n,) rad"""
    ranges: Floats
    """(n,) m; inf: nothing came back; NaN: says nothing."""
    keys: Floats
    """(n,) ascending: bearings since each scan's first beam, the scans `apart` from each other."""
    apart: float
    """rad"""

    @classmethod
    def of(cls, scans: Sequence[PlacedScan], model: ScanModel) -> ScanStack:
        """Return scans that have no `misfit` as arrays."""
        ways = [slice(None, None, 1 if _ascends(scan.bearings) else -1) for scan in scans]
        turned = list(zip(scans, ways, strict=True))
        counts = np.array([len(scan.bearings) for scan in scans], np.intp)
        begins = np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
        bearings = np.concatenate([scan.bearings[way] for scan, way in turned])
        since = bearings - np.repeat(bearings[begins[:-1]], counts)
        apart = float(since.max()) + 8 * np.pi
        return cls(
            stamps_ns=np.array([scan.stamp_ns for scan in scans], np.int64),
            levels=np.array([scan.level for scan in scans], np.int64),
            places=np.array([scan.origins[len(scan.origins) // 2] for scan in scans], np.float64),
            sd_xy=_told([scan.sd_xy for scan in scans], model.sd_xy, model.least_sd_xy),
            sd_theta=_told([scan.sd_theta for scan in scans], model.sd_theta, model.least_sd_theta),
            max_range=np.minimum([scan.max_range for scan in scans], LARGEST_RANGE),
            begins=begins,
            origins=np.concatenate([scan.origins[way] for scan, way in turned]),
            bearings=bearings,
            ranges=np.concatenate([_cleaned(scan)[way] for scan, way in turned]),
            keys=since + apart * np.repeat(np.arange(len(counts)), counts),
            apart=apart,
        )

    def between(self, scan: Rows, start: Floats, extent: Floats) -> tuple[Rows, Rows]:
        """Return the first beam from `start` on, rad since each scan's first, and how many follow.

        All scans are searched at once, since their keys stand one behind the other.
        """
        first = self.apart * scan + np.maximum(start, -np.pi)
        last = self.apart * scan + np.clip(start + extent, -np.pi, self.apart - 2 * np.pi)
        low = np.searchsorted(self.keys, first, side="left")
        high = np.searchsorted(self.keys, last, side="right")
        return low, np.maximum(high - low, 0)


def misfit(scan: PlacedScan) -> str:
    """Return why a scan cannot be used; empty if it can."""
    beams = len(scan.bearings)
    if not beams:
        return "no beams"
    if len(scan.ranges) != beams or scan.origins.shape != (beams, 2):
        return "ranges, bearings and origins differ in number"
    if not (np.isfinite(scan.origins).all() and np.isfinite(scan.bearings).all()):
        return "a place or a bearing is not finite"
    if np.abs(scan.origins).max() > FARTHEST or np.abs(scan.bearings).max() > FARTHEST:
        return "a place or a bearing is too large"
    steps = np.diff(scan.bearings)
    if not ((steps > 0).all() or (steps < 0).all()):
        return "bearings are not in order"
    if not scan.max_range > 0:
        return "no largest range"
    return ""


def _ascends(bearings: Floats) -> bool:
    return bool(bearings[-1] >= bearings[0])


def _cleaned(scan: PlacedScan) -> Floats:
    """Return the ranges; inf beyond the largest, NaN where nothing was measured."""
    largest = min(scan.max_range, LARGEST_RANGE)
    ranges = np.where(scan.ranges >= largest, np.inf, scan.ranges)
    return np.where(ranges > LEAST_RANGE, ranges, np.nan)


def _told(values: Sequence[float], default: float, least: float) -> Floats:
    """Return standard deviations, none below the least; the default where none is told."""
    told = np.array(values, np.float64)
    return np.clip(np.where(told >= 0, told, default), least, LARGEST_SD)
