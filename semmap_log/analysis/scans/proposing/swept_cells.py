"""Which cells of a level beams went through, and in which they ended.

Of many scans only those count that show something new: enough to draw walls and to judge gaps.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import cos, floor, hypot, inf, log2, pi, sin

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.visit import PlacedScan
from semmap_log.errors import FormatError

Floats = NDArray[np.float64]
Counts = NDArray[np.int32]

CELL_M = 0.05
FARTHEST_M = 10.0
"""Beams count so far: farther away they lie wide apart, and a turn's error moves them much."""
STEP_M = 0.1
"""Between two places of a beam that are looked at."""
SHORT_M = 0.15
"""A beam counts as going through cells up to so far before its end."""
MOST_CELLS = 60_000_000
AT_ONCE = 2_000_000
"""Places of beams."""
WALL_HITS, WALL_SHARE = 2, 0.25
"""Cells in which so many beams ended, and such a share of those that came there, are walls."""


@dataclass(frozen=True, slots=True, eq=False)
class SweptCells:
    """Counts of a level's cells, row 0 at the lowest y."""

    x: float
    """Of the lower left corner, m, frame `map`."""
    y: float
    ended: Counts
    """(rows, columns) beams that ended in a cell."""
    passed: Counts
    """(rows, columns) beams that went through."""

    @classmethod
    def of(cls, scans: Sequence[PlacedScan]) -> SweptCells:
        """Return the cells that scans of one level swept; a beam without a return sweeps none.

        No return proves nothing: dark and mirror-like things return nothing either.

        Raises:
            FormatError: The scans lie too far apart for one map.
        """
        starts, ends = _beams(scans)
        if not len(starts):
            return cls(0.0, 0.0, np.zeros((1, 1), np.int32), np.zeros((1, 1), np.int32))
        low = np.floor(np.minimum(starts.min(0), ends.min(0)) / CELL_M - 1) * CELL_M
        high = np.maximum(starts.max(0), ends.max(0))
        columns, rows = (np.ceil((high - low) / CELL_M).astype(int) + 2).tolist()
        if rows * columns > MOST_CELLS:
            raise FormatError(
                "scans",
                f"scans over {columns * CELL_M:,.0f} m x {rows * CELL_M:,.0f} m: too large a map",
            )
        size = rows * columns
        places = _flat(ends, low, columns)
        ended = np.bincount(places, minlength=size)
        passed = np.zeros(size, np.int64)
        reach = np.maximum(np.hypot(*(ends - starts).T) - SHORT_M, 0.0)
        order = np.argsort(reach, kind="stable")
        block = max(1, int(AT_ONCE * STEP_M / FARTHEST_M))
        for first in range(0, len(order), block):
            some = order[first : first + block]
            passed += np.bincount(
                _flat(_on_the_way(starts[some], ends[some], reach[some]), low, columns),
                minlength=size,
            )
        shape = rows, columns
        return cls(
            float(low[0]), float(low[1]),
            ended.reshape(shape).astype(np.int32), passed.reshape(shape).astype(np.int32),
        )  # fmt: skip

    @property
    def walls(self) -> NDArray[np.bool_]:
        """Return the cells in which beams end, each time; what stood there once is none."""
        share = self.ended >= WALL_SHARE * (self.ended + self.passed)
        return (self.ended >= WALL_HITS) & share

    def centres(self, cells: NDArray[np.bool_]) -> Floats:
        """Return where the middles of cells lie: (n, 2) m."""
        rows, columns = np.nonzero(cells)
        return np.stack([self.x + (columns + 0.5) * CELL_M, self.y + (rows + 0.5) * CELL_M], axis=1)

    def around(self, middle: tuple[float, float], reach: float) -> tuple[Counts, Floats, Floats]:
        """Return how many beams ended in each cell of a square, and the cells' x and y, m."""
        first, past = (
            [int((at + sign * reach - low) // CELL_M) + (sign > 0) for at, low in
             zip(middle, (self.x, self.y), strict=True)]
            for sign in (-1, 1)
        )  # fmt: skip
        rows = np.arange(max(first[1], 0), min(max(past[1], 0), self.ended.shape[0]))
        columns = np.arange(max(first[0], 0), min(max(past[0], 0), self.ended.shape[1]))
        x, y = np.meshgrid(self.x + (columns + 0.5) * CELL_M, self.y + (rows + 0.5) * CELL_M)
        return self.ended[np.ix_(rows, columns)], x, y

    def at(self, cells: NDArray[np.bool_], x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Return a property of the cells at places; outside of the map it is False."""
        columns = np.floor((x - self.x) / CELL_M).astype(int)
        rows = np.floor((y - self.y) / CELL_M).astype(int)
        height, width = cells.shape
        is_in = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        found: NDArray[np.bool_] = (
            is_in & cells[np.where(is_in, rows, 0), np.where(is_in, columns, 0)]
        )
        return found


def ends_of(scan: PlacedScan) -> Floats:
    """Return where the beams end that came back from near enough: (n, 2) m."""
    return _beam(scan)[1]


def _beams(scans: Sequence[PlacedScan]) -> tuple[Floats, Floats]:
    """Return where the beams that came back begin and end, (n, 2) each; far ones are left out."""
    starts, ends = zip(*map(_beam, scans), strict=True)
    return np.concatenate(starts), np.concatenate(ends)


def _beam(scan: PlacedScan) -> tuple[Floats, Floats]:
    with np.errstate(invalid="ignore"):
        kept = (scan.ranges > 0) & (scan.ranges <= min(scan.max_range, FARTHEST_M))
    start, bearings = scan.origins[kept], scan.bearings[kept]
    end = start + scan.ranges[kept, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    good = np.isfinite(start).all(1) & np.isfinite(end).all(1)
    return start[good], end[good]


def _flat(places: Floats, low: Floats, columns: int) -> NDArray[np.int64]:
    cells = ((places - low) / CELL_M).astype(np.int64)
    return cells[:, 1] * columns + cells[:, 0]


def _on_the_way(starts: Floats, ends: Floats, reach: Floats) -> Floats:
    """Return places that beams go through, (n, 2) m: each beam up to its reach."""
    far = np.arange(0, reach.max(initial=0.0), STEP_M)
    length = np.hypot(*(ends - starts).T)
    way = (ends - starts) / np.maximum(length, 1e-9)[:, None]
    beam, step = np.nonzero(far[None, :] < reach[:, None])
    places: Floats = starts[beam] + way[beam] * far[step, None]
    return places


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
