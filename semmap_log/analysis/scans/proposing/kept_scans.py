"""Of many scans those that show something new: enough to draw walls and to judge gaps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from math import cos, floor, hypot, inf, log2, pi, sin

import numpy as np

from semmap_log.analysis.scans.placed_scan import PlacedScan

MOVED_M, TURNED_RAD, LATER_NS = 0.15, 0.17, 2 * 10**9
"""A scan is looked at once its laser has moved, or turned so far, or so much later."""
MOST_BEAMS = 720
"""Of a scan are kept, evenly spaced."""
STRETCH_NS = 10 * 10**9
"""Scans of so long a time are kept or dropped together: a drive through a door is many scans."""
PLACE_M, TURNS = 0.5, 8
"""Places so far apart, and so many headings, are views of their own."""
FEW = 8
"""Of a view so many scans are kept, and as many more each time that twice as many came: doors that
open in the last hour of a day are seen, too, and memory does not grow with the day."""
NEW = 0.5
"""A stretch is kept if so large a share of its scans is of views that few scans show."""

View = tuple[str, str, int, int, int, int]


@dataclass(slots=True)
class KeptScans:
    """Scans of any number of lasers, thinned out."""

    taken: int = 0
    """Scans that came."""
    _scans: list[PlacedScan] = field(default_factory=list)
    _stretch: list[PlacedScan] = field(default_factory=list)
    """The scans of the last `STRETCH_NS`: not yet kept."""
    _last: dict[tuple[str, str, int], tuple[int, float, float, float]] = field(default_factory=dict)
    _came: Counter[View] = field(default_factory=Counter)
    _kept: Counter[View] = field(default_factory=Counter)

    @property
    def scans(self) -> list[PlacedScan]:
        """Those that are kept, as they came."""
        self._end_stretch()
        return self._scans

    def take(self, scans: Iterable[PlacedScan]) -> None:
        """Keep those that show something new."""
        for scan in scans:
            self.taken += 1
            if not (len(scan.ranges) and self._is_new(scan)):
                continue
            if self._stretch and not (0 <= scan.stamp_ns - self._stretch[0].stamp_ns < STRETCH_NS):
                self._end_stretch()
            self._stretch.append(_thinned(scan))

    def _end_stretch(self) -> None:
        """Keep the scans of this stretch, or drop them all."""
        views = [_view(scan) for scan in self._stretch]
        self._came.update(views)
        new = sum(self._kept[view] < _most(self._came[view]) for view in views)
        if new >= NEW * len(views):
            self._kept.update(views)
            self._scans += self._stretch
        self._stretch = []

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


def _view(scan: PlacedScan) -> View:
    (x, y), bearing = scan.origins[0].tolist(), float(scan.bearings[0])
    turn = floor(bearing % (2 * pi) / (2 * pi) * TURNS)
    return scan.robot, scan.laser, scan.level, floor(x / PLACE_M), floor(y / PLACE_M), turn


def _most(came: int) -> float:
    """Return how many scans of a view are kept, of so many that came."""
    return FEW * (1 + max(0.0, log2(came / FEW)))


def _thinned(scan: PlacedScan) -> PlacedScan:
    step = -(-len(scan.ranges) // MOST_BEAMS)
    return replace(
        scan,
        origins=np.array(scan.origins[::step]),
        bearings=np.array(scan.bearings[::step]),
        ranges=np.array(scan.ranges[::step]),
    )
