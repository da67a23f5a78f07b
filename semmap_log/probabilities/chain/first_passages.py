"""How likely a door that is closed is opened within the hour, by hour of the week; or the reverse.

Not how often it changes: openings come in bursts, and who waits at a closed door waits through the
long closings more often than through the short ones. Where the state is known, each half hour is
asked whether the door was in the other state before the next; what happened between two visits is
expected of the chain that explains them (`rates`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.common.late_dataclass import dataclass
from semmap_log.domain.moments import DAY_NS
from semmap_log.probabilities.chain.between_looks import happened
from semmap_log.probabilities.chain.markov_chain import Rates, passage
from semmap_log.probabilities.chain.nodes import LOOK_NS, held_at, looks
from semmap_log.probabilities.chain.rates import rates_by_bin
from semmap_log.probabilities.evidence.coverage import WEEK
from semmap_log.probabilities.evidence.evidence import DoorEvidence
from semmap_log.probabilities.forecast import NORMAL_REACH
from semmap_log.probabilities.local_clock import HOUR_S, WORKING_DAYS, LocalClock

Reals = NDArray[np.float64]
Times = NDArray[np.int64]

HALF_LIFE_D = 56.0
START_PER_H = 0.25
"""A door of which nothing is known."""
CHANGES = 0.2
"""So many changes the hour of the coarser table counts, where a finer one has evidence of its
own."""
MOST_WAITED_H = 24.0
"""But never more hours than that."""
_LEAST_FACTOR = 0.02
LEARNT_FROM_D = 182
"""What visits tell is learnt from the last half year."""
LOOK_H = LOOK_NS / (HOUR_S * 10**9)


@dataclass(frozen=True, slots=True)
class Passages:
    """How soon doors in the other state pass to this one."""

    per_h: Reals
    """(7, 24), Monday first: how many an hour, of those that have not yet."""
    count: float
    """On how many days there were some, old ones discounted: those of a day hang together."""
    is_seen_between: bool
    """False: visits lie so far apart that the door may change any number of times between two, so
    that a wait may be as short as one likes."""

    @property
    def bounds(self) -> tuple[float, float]:
        """By which factors `per_h` is too high, or too low, at the ends of a 90 % interval.

        Those of a Poisson count, by Wilson and Hilferty's cube root (Proc. Natl. Acad. Sci. 17,
        1931).
        """
        n = self.count + CHANGES
        part, reach = 1 / (9 * n), NORMAL_REACH / (3 * np.sqrt(n))
        least, most = (max(1 - part + side * reach, 0.0) ** 3 for side in (-1, 1))
        return float(max(least, _LEAST_FACTOR)), float(most) if self.is_seen_between else np.inf


def first_passages(evidence: DoorEvidence, clock: LocalClock, *, until_open: bool) -> Passages:
    """Return how soon a door passes to a state from the other one.

    Args:
        evidence: Of a door, up to when it counts.
        clock: Whose hours.
        until_open: Passages to open; False: to closed.
    """
    days = _Days.of(evidence, clock)
    changes, waited_h = days.sums(*_known(evidence, clock, until_open=until_open))
    mixes = False
    if evidence.is_visit.any():
        visited = _Visited(evidence, clock, days)
        between = visited.passages(until_open=until_open)
        mixes = visited.fastest_per_s * HOUR_S * LOOK_H > 1 and not len(evidence.start_ns)
        changes, waited_h = changes + between[0], waited_h + between[1]
    on_days = (days.old * np.minimum(changes.reshape(-1, 24).sum(1), 1.0)).sum()
    return Passages(
        _shrunk(days.by_week(changes), days.by_week(waited_h)), float(on_days), not mixes
    )


class _Days(NamedTuple):
    """The days of what is known of a door."""

    first: int
    old: Reals
    """(days,): how much each still counts."""

    @classmethod
    def of(cls, evidence: DoorEvidence, clock: LocalClock) -> _Days:
        ends_ns = np.array([evidence.first_ns, evidence.until_ns])
        first, last = (clock.hour_of(ends_ns) // 24).tolist()
        return cls(first, 0.5 ** (np.arange(last - first, -1, -1) / HALF_LIFE_D))

    @property
    def such_hours(self) -> NDArray[np.intp]:
        """(days x 24,): which of the 48 hours of working days and weekends each is."""
        weekday = (self.first + np.arange(len(self.old))) % WEEK[0]
        return ((weekday >= WORKING_DAYS)[:, None] * 24 + np.arange(24)).ravel().astype(np.intp)

    def sums(self, hour: Times, *columns: Reals) -> list[Reals]:
        """Return (days x 24,) each: what belongs to each hour, added up."""
        place = hour - self.first * 24
        size = 24 * len(self.old)
        return [np.bincount(place, column, size).astype(np.float64) for column in columns]

    def by_week(self, of_hours: Reals) -> Reals:
        """Return (7, 24): the sums of (days x 24,), old ones discounted."""
        found = np.zeros(WEEK)
        weekday = (self.first + np.arange(len(self.old))) % WEEK[0]
        np.add.at(found, weekday, self.old[:, None] * of_hours.reshape(-1, 24))
        return found


def _known(
    evidence: DoorEvidence, clock: LocalClock, *, until_open: bool
) -> tuple[NDArray[np.int64], Reals, Reals]:
    """Return hours, passages and hours waited, where the state is known for a half hour."""
    if not len(evidence.start_ns):
        return np.zeros(0, np.int64), np.zeros(0), np.zeros(0)
    from_ns = np.arange(int(evidence.start_ns[0]), int(evidence.end_ns[-1]) - LOOK_NS, LOOK_NS)
    (held, is_open), (then, _) = (held_at(evidence, ns) for ns in (from_ns, from_ns + LOOK_NS))
    begins = evidence.start_ns[evidence.is_open == until_open]
    next_ns = np.append(begins, np.iinfo(np.int64).max)[np.searchsorted(begins, from_ns, "right")]
    waits = held & then & (is_open != until_open)
    passed_h = np.minimum(next_ns[waits] - from_ns[waits], LOOK_NS) / (HOUR_S * 10**9)
    comes = next_ns[waits] <= from_ns[waits] + LOOK_NS
    return clock.hour_of(from_ns[waits]), comes.astype(np.float64), passed_h


class _Visited:
    """What happened between visits, as far as they tell."""

    def __init__(self, evidence: DoorEvidence, clock: LocalClock, days: _Days) -> None:
        none = slice(0)
        alone = replace(
            evidence, start_ns=evidence.start_ns[none], end_ns=evidence.end_ns[none],
            is_open=evidence.is_open[none], holds_on=False,
        )  # fmt: skip
        last_ns = int(evidence.seen_ns[-1])
        seen = looks(alone, clock, last_ns, blind=True).since(last_ns - LEARNT_FROM_D * DAY_NS)
        hour = np.maximum.accumulate(clock.hour_of(seen.times_ns)) - days.first * 24
        nodes, such = seen.nodes(hour.astype(np.intp)), days.such_hours
        rates = rates_by_bin(nodes.with_bins(such[nodes.bin]), 2 * 24)
        self.fastest_per_s = float(rates.relaxation.max())
        by_hour = Rates(rates.opening[such], rates.closing[such])
        self._happened = happened(nodes, by_hour, passage(nodes, by_hour), len(such))

    def passages(self, *, until_open: bool) -> tuple[Reals, Reals]:
        """Return passages, and hours waited for them, to expect; (days x 24,) each."""
        openings, closings, closed_s, open_s = self._happened
        changed, waited_s = (openings, closed_s) if until_open else (closings, open_s)
        return changed, waited_s / HOUR_S


def _shrunk(changes: Reals, waited_h: Reals) -> Reals:
    """Return (7, 24) rates: hours of a weekday, shrunk to such days', to any day's, and to all."""
    overall = (changes.sum() + CHANGES) / (waited_h.sum() + CHANGES / START_PER_H)
    of_any = _toward(changes.sum(0), waited_h.sum(0), np.full(24, overall))
    found = np.empty(WEEK)
    for days in (slice(WORKING_DAYS), slice(WORKING_DAYS, None)):
        such = _toward(changes[days].sum(0), waited_h[days].sum(0), of_any)
        found[days] = _toward(changes[days], waited_h[days], such)
    return found


def _toward(changes: Reals, waited_h: Reals, coarser: Reals) -> Reals:
    weight_h = np.minimum(CHANGES / coarser, MOST_WAITED_H)
    return (changes + weight_h * coarser) / (waited_h + weight_h)
