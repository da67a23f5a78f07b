"""How likely a door that is closed is opened within the hour, by hour of the week; or the reverse.

Not how often it changes: openings come in bursts, and who waits at a closed door waits through the
long closings more often than through the short ones. Where the state is known, each half hour
counts as a trial: did the door change before the next? Visits count through the modes that explain
them (`looks`); both together show in which mode each hour is (`hour_modes`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.chain import hour_modes
from semmap_log.analysis.probabilities.chain.hour_modes import likely_modes
from semmap_log.analysis.probabilities.chain.looks import LOOK_NS, HourLooks, held_at, looks
from semmap_log.analysis.probabilities.evidence.coverage import WEEK
from semmap_log.analysis.probabilities.evidence.day_tables import HALF_LIFE_D
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import INTERVAL, NORMAL_REACH
from semmap_log.core.lazily import computed_once
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import DAY_NS, HOUR_NS

Reals = NDArray[np.float64]
Times = NDArray[np.int64]

LEARNT_FROM_D = 182
"""Rates are learnt from the last half year."""
ROUNDS = 3
"""Iterations in which an hour is explained by the hours before and after it."""
DRAWS = 16
"""So often days are resampled, to see how far a wait rests on a few of them."""
TOGETHER = 1 / 3
"""The correlation of the uncertainty of single hours; found on simulated doors."""


class Passages:
    """How soon doors in the other state pass to this one."""

    def __init__(self, told: Reals, days: Days, mode_per_h: Reals) -> None:
        """Take the observations.

        Args:
            told: (days, 24, modes): log-likelihood of what was seen in each hour.
            days: The days of its rows.
            mode_per_h: (modes,): passages per hour in each.
        """
        self._told = told
        self._days = days
        self._mode_per_h = mode_per_h
        self._likely = likely_modes(days.by_week(told, days.old))

    @computed_once
    def per_h(self) -> Reals:
        """(7, 24), Monday first: the hazard, passages per hour of doors not passed yet."""
        return self._within_the_hour(self._likely)

    def interval(self, wait: Callable[[Reals], float]) -> tuple[float, float]:
        """Return the ends of a 90 % interval of what follows from the rates.

        By the Bayesian bootstrap of days (D. Rubin, Ann. Stat. 9, 1981), and by what the hours
        leave open.

        Args:
            wait: Of rates, (7, 24): more than 0, and the less the higher they are.
        """
        here = wait(self.per_h)
        drawn = np.log([wait(per_h) / here for per_h in self._drawn])
        least, most = (
            wait(self._quantile(end)) for end in ((1 + INTERVAL) / 2, (1 - INTERVAL) / 2)
        )
        own = np.log(most / least) / 2
        reach = float(np.hypot(NORMAL_REACH * np.sqrt((drawn**2).mean()), TOGETHER * own))
        return here * float(np.exp(-reach)), here * float(np.exp(reach))

    @computed_once
    def _drawn(self) -> list[Reals]:
        """`per_h` of resampled days."""
        weights = np.random.default_rng(0).exponential(size=(DRAWS, len(self._days.old)))
        weights *= self._days.old / weights.mean(1, keepdims=True)
        told = (self._days.by_week(self._told, weight) for weight in weights)
        return [self._within_the_hour(likely_modes(of_week)) for of_week in told]

    def _within_the_hour(self, likely: Reals) -> Reals:
        """Return (7, 24): rates that give the expected number of passages after an hour."""
        return np.asarray(-np.log(likely @ np.exp(-self._mode_per_h)))

    def _quantile(self, part: float) -> Reals:
        """Return (7, 24): quantiles of the rates."""
        order = np.argsort(self._mode_per_h, kind="stable")
        likely = self._likely[..., order].reshape(-1, len(order))
        below = np.cumsum(likely, axis=1) - likely / 2
        log_rate = np.log(self._mode_per_h[order])
        return np.exp([np.interp(part, each, log_rate) for each in below]).reshape(WEEK)


def first_passages(evidence: DoorEvidence, clock: LocalClock, *, until_open: bool) -> Passages:
    """Return how soon a door passes to a state from the other one.

    Args:
        evidence: Of a door, up to when it counts.
        clock: Whose hours.
        until_open: Passages to open; False: to closed.
    """
    share = hour_modes.SHARE if until_open else 1 - hour_modes.SHARE
    mode_per_h = share * hour_modes.PER_H
    days = Days.of(evidence, clock)
    known = days.sums(*_known(evidence, clock, days, until_open=until_open))
    told = known[..., :1] * np.log(mode_per_h) - known[..., 1:] * mode_per_h
    if evidence.is_visit.any():
        told = _with_visits(told, days, evidence, clock)
    return Passages(told, days, mode_per_h)


class Days(NamedTuple):
    """Days from which rates are learnt: the last half year."""

    first: int
    old: Reals
    """(days,): the weight of each."""

    @classmethod
    def of(cls, evidence: DoorEvidence, clock: LocalClock) -> Days:
        """Return those of what is known of a door."""
        ends_ns = np.array([evidence.first_ns, evidence.until_ns])
        first, last = (clock.hour_of(ends_ns) // 24).tolist()
        first = max(first, last - LEARNT_FROM_D)
        return cls(first, 0.5 ** (np.arange(last - first, -1, -1) / HALF_LIFE_D))

    def sums(self, hour: Times, told: Reals) -> Reals:
        """Return (days, 24, k): the values of each hour, (n, k), added up."""
        place = hour - self.first * 24
        inside = place >= 0
        found = np.zeros((len(self.old) * 24, told.shape[1]))
        np.add.at(found, place[inside], told[inside])
        return found.reshape(-1, 24, told.shape[1])

    def by_week(self, told: Reals, weight: Reals) -> Reals:
        """Return (7, 24, k): the weighted sum of days, (days, 24, k) and (days,)."""
        weekday = (self.first + np.arange(len(self.old))) % WEEK[0]
        parts = ((weight[weekday == day], told[weekday == day]) for day in range(WEEK[0]))
        return np.stack([np.tensordot(*part, 1) for part in parts])


def _known(
    evidence: DoorEvidence, clock: LocalClock, days: Days, *, until_open: bool
) -> tuple[Times, Reals]:
    """Return hours, and for a half hour each, (n, 2): whether the door passed; hours waited."""
    if not len(evidence.start_ns):
        return np.zeros(0, np.int64), np.zeros((0, 2))
    start_ns = int(evidence.start_ns[0])
    day_ns = int(clock.midnights_ns(np.array([days.first - 1]))[0])  # the day before: to be sure
    start_ns += max(0, (day_ns - start_ns) // LOOK_NS) * LOOK_NS
    from_ns = np.arange(start_ns, int(evidence.end_ns[-1]) - LOOK_NS, LOOK_NS)
    (held, is_open), (then, _) = (held_at(evidence, ns) for ns in (from_ns, from_ns + LOOK_NS))
    begins = evidence.start_ns[evidence.is_open == until_open]
    next_ns = np.append(begins, np.iinfo(np.int64).max)[np.searchsorted(begins, from_ns, "right")]
    waits = held & then & (is_open != until_open)
    passed_h = np.minimum(next_ns[waits] - from_ns[waits], LOOK_NS) / HOUR_NS
    comes = next_ns[waits] <= from_ns[waits] + LOOK_NS
    return clock.hour_of(from_ns[waits]), np.stack([comes, passed_h], axis=1)


def _with_visits(told: Reals, days: Days, evidence: DoorEvidence, clock: LocalClock) -> Reals:
    """Return (days, 24, modes): the log-likelihoods given, plus those from visits."""
    none = slice(0)
    alone = replace(
        evidence, start_ns=evidence.start_ns[none], end_ns=evidence.end_ns[none],
        is_open=evidence.is_open[none], holds_on=False,
    )  # fmt: skip
    last_ns = int(evidence.seen_ns[-1])
    seen = looks(alone, clock, last_ns, blind_from_ns=last_ns - LEARNT_FROM_D * DAY_NS)
    hours = HourLooks(seen, clock)
    weekday, hour = hours.hour // 24 % WEEK[0], hours.hour % 24
    likely = None
    for _ in range(ROUNDS + 1):
        both = told + days.sums(hours.hour, hours.explained(likely))
        likely = likely_modes(days.by_week(both, days.old))[weekday, hour]
    return both
