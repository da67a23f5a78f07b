"""What all visits to a door show together, counted visit by visit, however many there are.

It reports what a laser saw of all doors, for a user to judge how far to trust it, and warns of
doors that need a look: for their line, their glass, or the robot's poses.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import isfinite, nan, sqrt

from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.texts import counted


@dataclass(frozen=True, slots=True)
class ScanReport:
    """The figures and warnings of each door."""

    doors: Sequence[DoorFigures]
    """Of those that were visited, ids ascending."""
    warnings: Sequence[DoorWarning]
    not_met: Sequence[DoorId]
    """Doors that have a place but were never visited."""
    labels: Mapping[DoorId, str]
    """The labels of doors that have a name."""
    summary: Sequence[str] = ()
    """What there was of scans."""
    oddities: Sequence[str] = ()
    """What is odd about the scans, apart from the doors."""

    def label(self, door_id: DoorId) -> str:
        """Return a door's label."""
        return self.labels.get(door_id) or str(door_id)

    def warnings_of(self, door_id: DoorId) -> list[DoorWarning]:
        """Return the warnings about a door."""
        return [warning for warning in self.warnings if warning.door_id == door_id]


def scan_report(
    visits: Iterable[Visit],
    *,
    labels: Mapping[DoorId, str],
    placed: Collection[DoorId],
    glass: Collection[DoorId] = (),
    summary: Sequence[str] = (),
    oddities: Sequence[str] = (),
) -> ScanReport:
    """Return the report of some visits.

    Args:
        visits: To any doors.
        labels: The doors' labels.
        placed: Doors that could have been met.
        glass: Doors that are known to be of glass.
        summary: A summary of the scans.
        oddities: What is odd about the scans.
    """
    doors = door_figures(visits)
    met = {door.door_id for door in doors}
    return ScanReport(
        doors=doors,
        warnings=door_warnings(doors, glass=glass),
        not_met=sorted(door_id for door_id in placed if door_id not in met),
        labels=labels,
        summary=summary,
        oddities=oddities,
    )


FEW = 5
"""Doors with fewer visits get no warnings about habits."""
LEAST_OFFSETS = 3
"""The least number of visits for a warning about an offset."""
OFF_M = 0.12
"""Less is a leaf in its recess, as drawings go."""
SURE = 3.0
"""Standard errors that an offset must be away from 0."""
MOSTLY = 0.5
MOVE_IT = "if its line is drawn there by mistake, move it with `update`"
GLASS_IT = "a shut glass door looks so; if it is one, annotate it (key glass, yes)"


class Concern(str, Enum):
    """What a warning is about."""

    contradiction = "contradiction"
    offset = "offset"
    undecided = "undecided"
    glass = "glass"


@dataclass(frozen=True, slots=True)
class DoorWarning:
    """A warning about a door, with its numbers."""

    door_id: DoorId
    concern: Concern
    text: str
    """Without the door: `beams end 0.22 m behind its line on average (12 visits)`."""

    def about(self, label: str) -> str:
        """Return the warning as a line of its own, with the door's label."""
        return f"door {label}: {self.text}"


def door_warnings(
    doors: Iterable[DoorFigures], *, glass: Container[DoorId] = ()
) -> list[DoorWarning]:
    """Return the warnings, door by door.

    Args:
        doors: The figures of each.
        glass: Doors that are known to be of glass.
    """
    found = []
    for door in doors:
        told = {
            Concern.contradiction: _contradiction(door),
            Concern.offset: _offset(door),
            Concern.undecided: _undecided(door),
            Concern.glass: "" if door.door_id in glass else _glass(door),
        }
        found += [
            DoorWarning(door.door_id, concern, text) for concern, text in told.items() if text
        ]
    return found


def _contradiction(door: DoorFigures) -> str:
    if not door.contradictions:
        return ""
    return (
        f"CLOSED while the robot drove through it ({counted(door.contradictions, 'visit')}): are "
        "its line and the poses right?"
    )


def _offset(door: DoorFigures) -> str:
    if door.behind_m.count < LEAST_OFFSETS:
        return ""
    # Seen from both sides a line that is drawn too far left has its leaf on the near and far side.
    if len(door.sides) > 1 and _is_off(door.left_m):
        mean, count = door.left_m.value, door.left_m.count
        side = "left" if mean > 0 else "right"
        return (
            f"beams end {abs(mean):.2f} m to the {side} of its line on average "
            f"({counted(count, 'visit')} from both sides); {MOVE_IT}"
        )
    if not _is_off(door.behind_m):
        return ""
    mean, count = door.behind_m.value, door.behind_m.count
    side = "behind" if mean > 0 else "before"
    return (
        f"beams end {abs(mean):.2f} m {side} its line on average ({counted(count, 'visit')}); "
        f"{MOVE_IT}"
    )


def _is_off(offsets: Mean) -> bool:
    """Return whether the mean offset is significant."""
    return abs(offsets.value) >= max(OFF_M, SURE * offsets.error)


def _undecided(door: DoorFigures) -> str:
    if door.visits < FEW or door.undecided <= MOSTLY * door.visits:
        return ""
    return f"{door.undecided} of {counted(door.visits, 'visit')} undecided, mostly: {door.why}"


def _glass(door: DoorFigures) -> str:
    """Return a question about a door that the laser may see through and nobody drives through."""
    if door.closed or door.passed or door.open < FEW:
        return ""
    visits = counted(door.open, "visit")
    return f"always open ({visits}), never driven through: glass? {GLASS_IT}"


LEAST_LOOKS = 2.0
"""Of a visit: fewer do not show where a leaf is; they met its frame, or something else."""
NEARLY_ALL, MANY_MORE = 0.75, 2.5
"""Of the looks at a door: where as many end near its line, it is shut. Where many more do, these
ended well before it: at somebody, or at a leaf that stands toward the robot."""

MOST_AJAR = 0.5
"""P(ajar) from which on a leaf is not where its line is, wherever that is drawn."""


@dataclass(slots=True)
class Mean:
    """The mean of some numbers, without NaN."""

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
    """Of the visits that are decided by beams."""
    opening: Mean = field(default_factory=Mean)
    """The clear share of the width, 0..1, where beams saw anything of it."""
    behind_m: Mean = field(default_factory=Mean)
    """Where beams near the line ended, beyond (+) or before (-) it, as the robot sees it: in visits
    to a leaf that may be shut, wherever its line is drawn."""
    left_m: Mean = field(default_factory=Mean)
    """The same to the left (+) or right (-) of the line, if the visit was from one side."""
    sides: set[int] = field(default_factory=set)
    """The sides it was seen from: 1 the left, -1 the right."""
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
    """Return whether a visit says neither OPEN nor CLOSED."""
    return visit.state not in (DoorState.OPEN, DoorState.CLOSED)


def _may_be_shut(visit: Visit) -> bool:
    """Return whether nearly all beams ended near the line of a door neither open nor ajar."""
    stands = visit.state is DoorState.OPEN or visit.ajar >= MOST_AJAR
    met = NEARLY_ALL * visit.looks <= visit.near <= MANY_MORE * visit.looks
    return not stands and met and visit.looks >= LEAST_LOOKS


def _overlap(one: tuple[int, int], other: tuple[int, int]) -> bool:
    return one[0] <= other[1] and other[0] <= one[1]
