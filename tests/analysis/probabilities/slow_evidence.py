"""What events say of a door, word for word in plain Python: what the columns are held against."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
)

DAY_NS = 86_400 * 10**9
SECOND_NS = 10**9
OPEN, CLOSED = DoorState.OPEN, DoorState.CLOSED


class Word(NamedTuple):
    time_ns: int
    number: int
    event: object


class Stretch(NamedTuple):
    start_ns: int
    end_ns: int
    is_open: bool


class Sighting(NamedTuple):
    seen_ns: int
    llr: float
    accuracies: tuple[float, float]
    reads_open: bool
    visit: int


@dataclass
class Pass:
    visit: int
    first_ns: int
    last_ns: int
    llrs: list[float] = field(default_factory=list)


@dataclass
class SlowEvidence:
    """Goes through the words of one door up to a time, one after the other."""

    stretches: list[Stretch] = field(default_factory=list)
    sightings: list[Sighting] = field(default_factory=list)
    visits: int = 0
    _held: DoorState | None = None
    _was_added: bool = False
    _since_ns: int = 0
    _agreed_ns: int = 0
    _passes: dict[tuple[float, float], Pass] = field(default_factory=dict)

    def read(self, words: Sequence[Word], door_id: int, until_ns: int) -> SlowEvidence:
        about = sorted(w for w in words if w.event.door_id == door_id and w.time_ns <= until_ns)
        is_there = False
        for time_ns, _, event in about:
            is_there = is_there or isinstance(event, DoorAdded)
            if not is_there:
                continue
            self._lapse(time_ns)
            if isinstance(event, DoorRemoved):
                self._set(None, time_ns)
                return self
            if isinstance(event, DoorAdded) or (
                isinstance(event, DoorUpdated) and event.changed & Changed.STATE
            ):
                self._set(event.state, time_ns)
                self._was_added = isinstance(event, DoorAdded)
            elif isinstance(event, DoorPassed) and event.passed:
                self._see(time_ns, OPEN, (1.0, 1.0))
            elif isinstance(event, DoorObserved) and event.state in (OPEN, CLOSED):
                self._see(time_ns, event.state, (event.accuracy_open, event.accuracy_closed))
            elif isinstance(event, DoorObserved):
                self._set(None, time_ns)
        self._lapse(until_ns)
        if self._held:
            self.stretches.append(Stretch(self._since_ns, until_ns, self._held is OPEN))
        return self

    def _lapse(self, now_ns: int) -> None:
        if self._held and now_ns - self._agreed_ns > 30 * DAY_NS:
            self._end(self._agreed_ns + 30 * DAY_NS)

    def _end(self, end_ns: int) -> None:
        if self._held and end_ns > self._since_ns:
            self.stretches.append(Stretch(self._since_ns, end_ns, self._held is OPEN))
        self._held = None

    def _set(self, state: DoorState | None, time_ns: int) -> None:
        self._end(time_ns)
        self._passes.clear()
        if state in (OPEN, CLOSED):
            self._held, self._since_ns, self._agreed_ns = state, time_ns, time_ns

    def _see(self, time_ns: int, state: DoorState, accuracies: tuple[float, float]) -> None:
        if self._held is state and not self._was_added:
            self._agreed_ns = time_ns
            return
        self._end(time_ns)
        if accuracies == (1.0, 1.0):
            self._passes.clear()
        now = self._passes.get(accuracies)
        if (
            now is None
            or accuracies == (1.0, 1.0)
            or time_ns - now.last_ns >= 60 * SECOND_NS
            or time_ns - now.first_ns > 300 * SECOND_NS
        ):
            now = self._passes[accuracies] = Pass(self.visits, time_ns, time_ns)
            self.visits += 1
        before = sum(now.llrs) / len(now.llrs) if now.llrs else 0.0
        now.last_ns = time_ns
        now.llrs.append(llr(state is OPEN, *accuracies))
        added = sum(now.llrs) / len(now.llrs) - before
        self.sightings.append(Sighting(time_ns, added, accuracies, state is OPEN, now.visit))


def llr(reads_open: bool, accuracy_open: float, accuracy_closed: float) -> float:
    a, b = min(accuracy_open, 0.999), min(accuracy_closed, 0.999)
    return math.log(a / (1 - b)) if reads_open else math.log((1 - a) / b)


def joined_up(stretches: Sequence[Stretch]) -> list[tuple[int, int, bool]]:
    """Return stretches, touching ones of one state joined."""
    joined: list[tuple[int, int, bool]] = []
    for start, end, is_open in stretches:
        if joined and joined[-1][1:] == (start, is_open):
            joined[-1] = (joined[-1][0], end, is_open)
        else:
            joined.append((start, end, is_open))
    return joined


def stretches_of(evidence: DoorEvidence) -> list[Stretch]:
    columns = (evidence.start_ns, evidence.end_ns, evidence.is_open)
    return [Stretch(*row) for row in zip(*(c.tolist() for c in columns), strict=True)]


def sightings_of(evidence: DoorEvidence) -> list[Sighting]:
    columns = (evidence.seen_ns, evidence.llr, evidence.accuracy_open, evidence.accuracy_closed,
               evidence.reads_open, evidence.visit)  # fmt: skip
    rows = zip(*(c.tolist() for c in columns), strict=True)
    return [Sighting(t, x, (a, b), r, v) for t, x, a, b, r, v in rows]


def are_in_order(evidence: DoorEvidence) -> bool:
    stretches = stretches_of(evidence)
    return all(s.end_ns <= n.start_ns for s, n in pairwise(stretches)) and all(
        s.start_ns < s.end_ns or s.start_ns == evidence.until_ns for s in stretches
    )
