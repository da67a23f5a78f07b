"""What all visits to a door tell together, counted visit by visit: however many there are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import isfinite, nan, sqrt

from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId, DoorState

LEAST_LOOKS = 2.0
"""Of a visit: fewer do not tell where a leaf is; they met its frame, or by chance another thing."""
NEARLY_ALL, MANY_MORE = 0.75, 2.5
"""Of the looks at a door: where as many end near its line, it is shut. Where many more do, these
ended well before it: at somebody, or at a leaf that stands toward the robot."""

MOST_AJAR = 0.5
"""P(ajar) from which on a leaf is not where its line is, wherever that is drawn."""


@dataclass(slots=True)
class Mean:
    """Of some numbers; of those that are NaN nothing."""

    count: int = 0
    _mean: float = 0.0
    _squares: float = 0.0

    def add(self, value: float) -> None:
        """Take a number."""
        if isfinite(value):
            self.count += 1
            step = value - self._mean
            self._mean += step / self.count
            self._squares += step * (value - self._mean)

    @property
    def value(self) -> float:
        """Their mean; NaN: there are none."""
        return self._mean if self.count else nan

    @property
    def error(self) -> float:
        """Standard error of the mean; NaN: of fewer than two."""
        if self.count < 2:
            return nan
        return sqrt(self._squares / (self.count - 1) / self.count)


@dataclass(slots=True)
class DoorFigures:
    """The figures of a door, over its visits."""

    door_id: DoorId
    visits: int = 0
    open: int = 0
    """Visits whose beams say OPEN."""
    closed: int = 0
    undecided: int = 0
    passed: int = 0
    """Visits that say that the robot drove through."""
    contradictions: int = 0
    """Visits that say CLOSED while it did."""
    accuracy: Mean = field(default_factory=Mean)
    """That is said of those that are decided by beams."""
    opening: Mean = field(default_factory=Mean)
    """The clear share of the width, 0..1, where beams saw anything of it."""
    behind_m: Mean = field(default_factory=Mean)
    """Where beams ended that ended near the line, behind (+) or before (-) it, as the robot sees
    it: in visits to a leaf that may be shut, wherever its line is drawn."""
    left_m: Mean = field(default_factory=Mean)
    """The same to the left (+) or right (-) of the line, where a visit tells from which side."""
    sides: set[int] = field(default_factory=set)
    """From where it was seen: 1 the left, -1 the right."""
    reasons: Counter[str] = field(default_factory=Counter)
    """Why visits are undecided."""
    _closed_at: tuple[int, int] = (0, -1)
    _passed_at: tuple[int, int] = (0, -1)
    """The last visit that says so: its first and last scan, ns."""

    def add(self, visit: Visit) -> None:
        """Take a visit to this door, in the order in which they ended."""
        self.visits += 1
        when = (visit.first_ns, visit.last_ns)
        if visit.passed:
            self.passed += 1
            self._passed_at = when
            self.contradictions += _overlap(when, self._closed_at)
            return
        self._count(visit)
        if visit.state is DoorState.CLOSED:
            self._closed_at = when
            self.contradictions += _overlap(when, self._passed_at)
        self.opening.add(visit.opening)
        if isfinite(visit.behind_m) and _may_be_shut(visit):
            self._place(visit)

    def _place(self, visit: Visit) -> None:
        """Take where beams ended."""
        self.behind_m.add(visit.behind_m)
        if visit.side:
            self.sides.add(visit.side)
            self.left_m.add(-visit.side * visit.behind_m)

    def _count(self, visit: Visit) -> None:
        if is_undecided(visit):
            self.undecided += 1
            self.reasons[visit.why or "not enough was seen"] += 1
            return
        self.accuracy.add(visit.accuracy)
        self.open += visit.state is DoorState.OPEN
        self.closed += visit.state is DoorState.CLOSED

    @property
    def decided(self) -> int:
        """Visits that say OPEN or CLOSED, or that the robot drove through."""
        return self.open + self.closed + self.passed

    @property
    def why(self) -> str:
        """The commonest reason of those that are undecided; empty: there are none."""
        return max(self.reasons, key=lambda why: (self.reasons[why], why), default="")


def door_figures(visits: Iterable[Visit]) -> list[DoorFigures]:
    """Return the figures of each door that was visited, ids ascending."""
    found: dict[DoorId, DoorFigures] = {}
    for visit in sorted(visits, key=lambda each: each.last_ns):
        found.setdefault(visit.door_id, DoorFigures(visit.door_id)).add(visit)
    return [found[door_id] for door_id in sorted(found)]


def is_undecided(visit: Visit) -> bool:
    """Tell whether a visit says neither OPEN nor CLOSED."""
    return visit.state not in (DoorState.OPEN, DoorState.CLOSED)


def _may_be_shut(visit: Visit) -> bool:
    """Tell whether nearly all beams ended near the line, and the door is not open or ajar."""
    stands = visit.state is DoorState.OPEN or visit.ajar >= MOST_AJAR
    met = NEARLY_ALL * visit.looks <= visit.near <= MANY_MORE * visit.looks
    return not stands and met and visit.looks >= LEAST_LOOKS


def _overlap(one: tuple[int, int], other: tuple[int, int]) -> bool:
    return one[0] <= other[1] and other[0] <= one[1]
