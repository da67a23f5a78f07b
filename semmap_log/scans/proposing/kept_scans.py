"""Of many scans those that were made from other places: enough to draw walls and to judge gaps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from math import cos, hypot, inf, sin

import numpy as np

from semmap_log.scans.placed_scan import PlacedScan

MOVED_M, TURNED_RAD, LATER_NS = 0.15, 0.17, 2 * 10**9
"""A scan is kept once its laser has moved, or turned so far, or so much later."""
MOST_BEAMS = 720
"""Of a scan are kept, evenly spaced."""


@dataclass(slots=True)
class KeptScans:
    """Scans of any number of lasers, thinned out."""

    scans: list[PlacedScan] = field(default_factory=list)
    taken: int = 0
    """Scans that came."""
    _last: dict[tuple[str, str, int], tuple[int, float, float, float]] = field(default_factory=dict)

    def take(self, scans: Iterable[PlacedScan]) -> None:
        """Keep those that show something new."""
        for scan in scans:
            self.taken += 1
            if len(scan.ranges) and self._is_new(scan):
                self.scans.append(_thinned(scan))

    def _is_new(self, scan: PlacedScan) -> bool:
        key = (scan.robot, scan.laser, scan.level)
        (x, y), bearing = scan.origins[0].tolist(), float(scan.bearings[0])
        then_ns, then_x, then_y, then = self._last.get(key, (0, inf, inf, 0.0))
        turned = hypot(cos(bearing) - cos(then), sin(bearing) - sin(then))
        moved = hypot(x - then_x, y - then_y)
        is_new = (
            moved >= MOVED_M or turned >= TURNED_RAD or not 0 <= scan.stamp_ns - then_ns < LATER_NS
        )
        if is_new:
            self._last[key] = (scan.stamp_ns, x, y, bearing)
        return is_new


def _thinned(scan: PlacedScan) -> PlacedScan:
    step = -(-len(scan.ranges) // MOST_BEAMS)
    return replace(
        scan,
        origins=np.array(scan.origins[::step]),
        bearings=np.array(scan.bearings[::step]),
        ranges=np.array(scan.ranges[::step]),
    )
