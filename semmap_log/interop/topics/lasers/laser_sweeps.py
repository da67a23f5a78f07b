"""What a sensor_msgs/LaserScan measured, in the laser's own frame; or why it cannot be used."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.interop.topics.transforms import stamp_ns

MOST_BEAMS = 4096
"""Of more, every second, third … is taken: 0.1 degrees apart, four of them share a centimetre."""
LONGEST_S = 1.0
"""A scan that takes longer is none of a laser that turns; or its `time_increment` is wrong."""
ANGLES_OFF = 0.02
"""By how much `angle_max` may differ from where the last beam points, rad; or 2.5 increments."""
UNLIMITED_M = 100.0
"""`range_max` of a laser that tells none (infinity)."""


@dataclass(frozen=True, slots=True)
class Unusable:
    """Why a scan is dropped."""

    kind: str
    """Without values."""
    example: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """The beams of one scan; all arrays (b,)."""

    frame: str
    stamp_ns: int
    """Of the first beam."""
    angles: NDArray[np.float64]
    """Around the laser's z, rad; they rise or fall."""
    after_ns: NDArray[np.int64]
    """How long after the stamp each was measured."""
    ranges: NDArray[np.float64]
    """m; inf: it did not come back; NaN: it says nothing."""
    max_range: float


def sweep_of(message: Any) -> Sweep | Unusable:
    """Return the beams of a LaserScan."""
    ranges = np.asarray(message.ranges, np.float64)
    problem = _problem(message, len(ranges))
    if problem is not None:
        return problem
    every = -(-len(ranges) // MOST_BEAMS)
    numbers = np.arange(0, len(ranges), every)
    most = min(float(message.range_max), UNLIMITED_M)
    return Sweep(
        frame=str(message.header.frame_id).removeprefix("/"),
        stamp_ns=stamp_ns(message.header.stamp),
        angles=float(message.angle_min) + float(message.angle_increment) * numbers.astype(float),
        after_ns=np.rint(float(message.time_increment) * 1e9 * numbers).astype(np.int64),
        ranges=meant(ranges[numbers], float(message.range_min), most),
        max_range=most,
    )


def meant(ranges: NDArray[np.float64], least: float, most: float) -> NDArray[np.float64]:
    """Return ranges, inf where a beam did not come back, NaN where it says nothing.

    Zero, infinity and what is beyond the laser's range are beams that did not come back: drivers
    have different words for it. NaN, minus infinity, negative ones, and what is nearer than the
    laser can measure (its own housing) say nothing.
    """
    with np.errstate(invalid="ignore"):
        lost = (ranges == 0) | (ranges > most)
        bad = np.isnan(ranges) | (ranges < max(least, 0.0))
    return np.where(lost, np.inf, np.where(bad, np.nan, ranges))


def _problem(message: Any, beams: int) -> Unusable | None:
    """Return what is wrong with the form of a scan; None: nothing."""
    first, last, step = (
        float(getattr(message, name)) for name in ("angle_min", "angle_max", "angle_increment")
    )
    after_s = float(message.time_increment) * beams
    if beams < 2:
        return Unusable("a scan without beams", f"{beams} ranges")
    if not all(map(math.isfinite, (first, last, step, after_s))):
        return Unusable("a scan whose angles or times are not finite", f"{first} .. {last}")
    if step == 0 or abs(step) >= math.pi:
        return Unusable("a scan whose angle_increment cannot be", f"{step:g}")
    span = step * (beams - 1)
    if abs(span) > math.tau + 2 * abs(step):
        return Unusable("a scan of more than a whole turn", f"{beams:,} beams of {step:g} rad")
    if abs(first + span - last) > max(2.5 * abs(step), ANGLES_OFF):
        told = f"{beams:,} ranges end at {first + span:.3f}, angle_max {last:.3f}"
        return Unusable("a scan whose ranges and angles disagree", told)
    if abs(after_s) > LONGEST_S:
        return Unusable(f"a scan that takes more than {LONGEST_S:g} s", f"{after_s:.1f} s")
    if not float(message.range_max) > 0:
        return Unusable("a scan whose range_max is not above 0", f"{message.range_max:g}")
    return None
