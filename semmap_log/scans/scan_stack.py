"""Scans of one laser, one behind the other, as arrays over all their beams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.scans.placed_scan import PlacedScan
from semmap_log.scans.scan_model import ScanModel

LEAST_RANGE = 0.02
"""m; what is nearer was not measured."""


@dataclass(frozen=True, slots=True, eq=False)
class ScanStack:
    """`t` scans of `n` beams in all; within a scan the bearings ascend."""

    stamps_ns: NDArray[np.int64]
    """(t,)"""
    levels: NDArray[np.int64]
    """(t,)"""
    places: NDArray[np.float64]
    """(t, 2) of the laser in the middle of its turn, m."""
    sd_xy: NDArray[np.float64]
    sd_theta: NDArray[np.float64]
    """(t,) as told, else the model's; m, rad."""
    max_range: NDArray[np.float64]
    """(t,) m"""
    begins: NDArray[np.intp]
    """(t + 1,) the beams of scan i are begins[i] to begins[i + 1]."""
    origins: NDArray[np.float64]
    """(n, 2) m"""
    bearings: NDArray[np.float64]
    """(n,) rad"""
    ranges: NDArray[np.float64]
    """(n,) m; inf: nothing came back; NaN: says nothing."""

    @classmethod
    def of(cls, scans: Sequence[PlacedScan], model: ScanModel) -> ScanStack:
        """Return scans that have no `misfit` as arrays."""
        turned = [slice(None, None, 1 if _ascends(scan.bearings) else -1) for scan in scans]
        beams = list(zip(scans, turned, strict=True))
        counts = [len(scan.bearings) for scan in scans]
        return cls(
            np.array([scan.stamp_ns for scan in scans], np.int64),
            np.array([scan.level for scan in scans], np.int64),
            np.array([scan.origins[len(scan.origins) // 2] for scan in scans], np.float64),
            _told([scan.sd_xy for scan in scans], model.sd_xy, model.least_sd_xy),
            _told([scan.sd_theta for scan in scans], model.sd_theta, model.least_sd_theta),
            np.array([scan.max_range for scan in scans], np.float64),
            np.concatenate([[0], np.cumsum(counts)]).astype(np.intp),
            np.concatenate([scan.origins[way] for scan, way in beams]),
            np.concatenate([scan.bearings[way] for scan, way in beams]),
            np.concatenate([_cleaned(scan)[way] for scan, way in beams]),
        )


def misfit(scan: PlacedScan) -> str:
    """Return why a scan cannot be used; empty if it can."""
    beams = len(scan.bearings)
    if not beams:
        return "no beams"
    if len(scan.ranges) != beams or scan.origins.shape != (beams, 2):
        return "ranges, bearings and origins differ in number"
    if not (np.isfinite(scan.origins).all() and np.isfinite(scan.bearings).all()):
        return "a place or a bearing is not finite"
    steps = np.diff(scan.bearings)
    if not ((steps > 0).all() or (steps < 0).all()):
        return "bearings are not in order"
    if not scan.max_range > 0:
        return "no largest range"
    return ""


def _ascends(bearings: NDArray[np.float64]) -> bool:
    return bool(bearings[-1] >= bearings[0])


def _cleaned(scan: PlacedScan) -> NDArray[np.float64]:
    """Return the ranges; inf beyond the largest, NaN where nothing was measured."""
    ranges = np.where(scan.ranges >= scan.max_range, np.inf, scan.ranges)
    return np.where(ranges > LEAST_RANGE, ranges, np.nan)


def _told(values: Sequence[float], default: float, least: float) -> NDArray[np.float64]:
    """Return standard deviations, none below the least; the default where none is told."""
    told = np.array(values, np.float64)
    return np.maximum(np.where(np.isfinite(told) & (told >= 0), told, default), least)
