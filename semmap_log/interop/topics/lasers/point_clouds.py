"""A sensor_msgs/PointCloud2, cut at a band of heights, as the beams of a planar laser."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.interop.topics.lasers.laser_sweeps import Unusable
from semmap_log.interop.topics.transforms import stamp_ns

MOST_POINTS = 4_000_000
BEAMS = 720
"""Half a degree each: the nearest point in it counts."""
LEAST_RANGE_M = 0.2
"""Nearer points are the robot itself."""
MAX_RANGE_M = 100.0
_FLOATS = {7: "f4", 8: "f8"}
"""sensor_msgs/PointField: FLOAT32, FLOAT64."""


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """The points of one cloud that are finite."""

    frame: str
    stamp_ns: int
    points: NDArray[np.float64]
    """(n, 3) m, in the sensor's frame."""


def cloud_of(message: Any) -> Cloud | Unusable:
    """Return the points of a PointCloud2."""
    rows, columns = int(message.height), int(message.width)
    count, size = rows * columns, int(message.point_step)
    if not 0 < count <= MOST_POINTS:
        return Unusable("a cloud of no or too many points", f"{count:,}")
    fields = {str(field.name): field for field in message.fields}
    if not all(name in fields and int(fields[name].datatype) in _FLOATS for name in "xyz"):
        return Unusable("a cloud without x, y, z as floats", ", ".join(sorted(fields)))
    order = ">" if message.is_bigendian else "<"
    formats = [order + _FLOATS[int(fields[name].datatype)] for name in "xyz"]
    offsets = [int(fields[name].offset) for name in "xyz"]
    ends = [at + np.dtype(form).itemsize for at, form in zip(offsets, formats, strict=True)]
    row_size, data = int(message.row_step), np.ascontiguousarray(message.data, np.uint8)
    if (
        max(ends) > size
        or row_size < columns * size
        or data.size < row_size * (rows - 1) + (columns * size)
    ):
        return Unusable("a cloud whose sizes disagree", f"{data.size:,} bytes for {count:,} points")
    dtype = np.dtype({"names": list("xyz"), "formats": formats, "offsets": offsets,
                      "itemsize": size})  # fmt: skip
    # The last row may lack what fills the others: nothing is made as long as it says that it is.
    row_strides = (min(row_size, data.size), 1)
    packed = np.lib.stride_tricks.as_strided(data, (rows, columns * size), row_strides)
    found = np.ascontiguousarray(packed).reshape(-1).view(dtype)
    points = np.stack([found[name].astype(np.float64) for name in "xyz"], axis=1)
    return Cloud(
        frame=str(message.header.frame_id).removeprefix("/"),
        stamp_ns=stamp_ns(message.header.stamp),
        points=points[np.isfinite(points).all(1)],
    )


def cut(
    points: NDArray[np.float64], origin: NDArray[np.float64], heights: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return bearings and ranges (b,) of the nearest points of a band, as seen from an origin.

    Args:
        points: (n, 3) m, z up from the floor.
        origin: (3,) where the sensor is.
        heights: The band, m.

    Returns:
        The middles of equal parts of a turn, rad; NaN where no point of the band lies: nothing may
        be there, or something of another height.
    """
    low, high = heights
    band = points[(points[:, 2] >= low) & (points[:, 2] <= high)]
    dx, dy = (band[:, :2] - origin[:2]).T
    away = np.hypot(dx, dy)
    keep = (away >= LEAST_RANGE_M) & (away <= MAX_RANGE_M)
    away, angle = away[keep], np.arctan2(dy[keep], dx[keep])
    part = np.floor((angle + math.pi) / math.tau * BEAMS).astype(np.int64) % BEAMS
    nearest = np.full(BEAMS, np.inf)
    np.minimum.at(nearest, part, away)
    bearings = (np.arange(BEAMS) + 0.5) / BEAMS * math.tau - math.pi
    return bearings, np.where(np.isinf(nearest), np.nan, nearest)
