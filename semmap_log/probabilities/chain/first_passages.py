"""How likely a door that is closed is opened within the hour, by hour of the week; or the reverse.

Not how often it changes: openings come in bursts, and who waits at a closed door waits through the
long closings more often than through the short ones. Where the state is known, each half hour is
asked whether the door was in the other state before the next; what happened between two visits is
expected of the chain that explains them (`rates`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.common.late_dataclass import dataclass
from semmap_log.probabilities.chain.markov_chain import Rates, passage
from semmap_log.probabilities.chain.nodes import LOOK_NS, held_at, looks
from semmap_log.probabilities.chain.rates import happened
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


def first_passages(
    evidence: DoorEvidence, clock: LocalClock, rates: Rates, *, until_open: bool
) -> Passages:
    """Return how soon a door passes to a state from the other one.

    Args:
        evidence: Of a door, up to when it counts.
        clock: Whose hours.
        rates: (24,), by which the chain goes from visit to visit.
        until_open: Passages to open; False: to closed.
    """
    first_h, last_h = clock.hour_of(np.array([evidence.first_ns, evidence.until_ns])).tolist()
    first_day, days = first_h // 24, last_h // 24 - first_h // 24 + 1
    changes, waited_h = np.zeros(days * 24), np.zeros(days * 24)
    for bins, changed, waited in (
        _known(evidence, clock, until_open=until_open),
        _visited(evidence, clock, rates, until_open=until_open),
    ):
        changes += np.bincount(bins - first_day * 24, changed, days * 24)
        waited_h += np.bincount(bins - first_day * 24, waited, days * 24)
    old = 0.5 ** (np.arange(days - 1, -1, -1) / HALF_LIFE_D)[:, None]
    weekday = (first_day + np.arange(days)) % WEEK[0]
    sums = np.zeros((2, *WEEK))
    for part, of_hours in zip(sums, (changes, waited_h), strict=True):
        np.add.at(part, weekday, old * of_hours.reshape(-1, 24))
    on_days = (old[:, 0] * np.minimum(changes.reshape(-1, 24).sum(1), 1.0)).sum()
    mixes = rates.relaxation.max() * HOUR_S * LOOK_H > 1 and not len(evidence.start_ns)
    return Passages(_shrunk(*sums), float(on_days), not mixes)


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


def _visited(
    evidence: DoorEvidence, clock: LocalClock, rates: Rates, *, until_open: bool
) -> tuple[NDArray[np.int64], Reals, Reals]:
    """Return the same between visits, as far as they tell."""
    if not evidence.is_visit.any():
        return np.zeros(0, np.int64), np.zeros(0), np.zeros(0)
    none = slice(0)
    alone = replace(
        evidence, start_ns=evidence.start_ns[none], end_ns=evidence.end_ns[none],
        is_open=evidence.is_open[none], holds_on=False,
    )  # fmt: skip
    seen = looks(alone, clock, int(evidence.seen_ns[0]), int(evidence.seen_ns[-1]))
    hours = clock.hour_of(seen.times_ns)
    bins = hours - hours[0]
    by_hour = (hours[0] + np.arange(int(bins[-1]) + 1)) % 24
    of_hours = Rates(rates.opening[by_hour], rates.closing[by_hour])
    nodes = seen.nodes().with_bins(bins.astype(np.intp))
    found = happened(nodes, of_hours, passage(nodes, of_hours), len(by_hour))
    openings, closings, closed_s, open_s = found
    changed, waited_s = (openings, closed_s) if until_open else (closings, open_s)
    return hours[0] + np.arange(len(by_hour)), changed, waited_s / HOUR_S


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
