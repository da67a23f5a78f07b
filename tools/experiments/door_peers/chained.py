r"""A peer: persistence filters chained both ways, for doors that open again.

    python tools/experiments/eval_doors.py FOLDER \
        --peer chained="python tools/experiments/door_peers/chained.py"

The persistence filter (Rosen, Mason and Leonard, Towards Lifelong Feature-Based Mapping in
Semi-Static Environments, ICRA 2016) believes that what was seen persists, until readings or its
prior of how long such things last say otherwise; what has vanished never comes back. For doors two
of them are chained, as Perpetua (Saavedra-Ruiz, Nashed, Gauthier and Paull, IROS 2025) does: one
for "open persists", one for "closed persists". Where the belief in the state falls to a threshold
the other filter starts anew, and so on into the future.

How long states last is learnt from the readings up to the first forecast: the most likely sequence
of states (two-state Viterbi with a price of a change) gives durations, these an exponential or
log-normal prior. The price, the prior and the threshold are those that forecast these readings
best, each from those before it (Brier score), as far ahead as is asked.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from statistics import NormalDist
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent))

from asks import Ask, Floats, Readings, answer_all

PRICES = (2.0, 4.0, 8.0)
"""Nats that a change of the state costs."""
THRESHOLDS = (0.05, 0.25, 0.5)
"""Belief in a state at which it counts as over: Perpetua's examples have 0.05 and 0.5."""
RUN_UP = 0.2
"""The first such share of the readings is not forecast."""
MOST_READINGS = 20_000
"""Settings are learnt from the last so many."""
MOST_TRIALS = 2_000
NORMAL = NormalDist()


class Lasting(Protocol):
    """How long a state lasts."""

    def survives(self, age_s: float) -> float:
        """Return P(it lasts longer than that)."""

    def survive(self, ages_s: Floats) -> Floats:
        """Return the same of many."""

    def age_s(self, share: float) -> float:
        """Return the age that such a share of states reaches."""


@dataclass(frozen=True)
class Exponential:
    """Whatever its age, a state ends as soon."""

    mean_s: float

    @classmethod
    def of(cls, durations_s: Floats) -> Exponential:
        return cls(float(np.mean(durations_s)))

    def survives(self, age_s: float) -> float:
        return math.exp(-max(age_s, 0.0) / self.mean_s)

    def survive(self, ages_s: Floats) -> Floats:
        return np.asarray(np.exp(-np.maximum(ages_s, 0.0) / self.mean_s))

    def age_s(self, share: float) -> float:
        return -self.mean_s * math.log(share)


@dataclass(frozen=True)
class LogNormal:
    """States of a typical length."""

    log_median: float
    spread: float

    @classmethod
    def of(cls, durations_s: Floats) -> LogNormal:
        logs = np.log(durations_s)
        # Of few durations the spread is not known: one more counts that is as far off as e.
        return cls(float(np.mean(logs)), float(np.sqrt(np.var(logs) + 1 / len(logs))))

    def survives(self, age_s: float) -> float:
        if age_s <= 0:
            return 1.0
        z = (math.log(age_s) - self.log_median) / self.spread
        return max(0.5 * math.erfc(z / math.sqrt(2)), 1e-12)

    def survive(self, ages_s: Floats) -> Floats:
        return np.array([self.survives(age) for age in ages_s.tolist()])

    def age_s(self, share: float) -> float:
        return math.exp(self.log_median + self.spread * NORMAL.inv_cdf(1 - share))


PRIORS: Sequence[type[Exponential | LogNormal]] = (Exponential, LogNormal)


@dataclass(frozen=True)
class Chain:
    """Settings of the two filters."""

    lasting: tuple[Lasting, Lasting]
    """Of closed, and of open."""
    threshold: float


class ChainedFilter:
    """The filter of the state that is believed in; the other one waits.

    With S the survival function of its prior, F = 1 - S, ages t from its start, and the reading y_N
    at t_N, the filter holds (Rosen et al., equations 9 to 13)

        l_N = p(Y_1:N | T >= t_N) = l_N-1 P(y_N | it persists)
        L_N = P(y_N | it is over) (L_N-1 + l_N-1 (F(t_N) - F(t_N-1)))
        P(X_t = 1 | Y_1:N) = l_N S(t) / (L_N + l_N S(t_N)) for t >= t_N.

    Only r = L / l matters, and it does not underflow.
    """

    def __init__(self, chain: Chain, start_s: float, *, is_open: bool) -> None:
        self._chain = chain
        self._is_open = is_open
        self._start_s = self._last_s = start_s
        self._over = 0.0
        """r: how much the readings speak for "it is over" against "it persists"."""

    def read(self, at_s: float, *, reads_open: bool, missed: float, false: float) -> None:
        """Take a reading; the state may have changed on the way to it."""
        self._go_to(at_s)
        when_open = 1 - missed if reads_open else missed
        when_closed = false if reads_open else 1 - false
        persists, over = (when_open, when_closed) if self._is_open else (when_closed, when_open)
        grown = self._over + self._survives(self._last_s) - self._survives(at_s)
        self._over = grown * max(over, 1e-6) / max(persists, 1e-6)
        self._last_s = at_s

    def p_open(self, times_s: Floats) -> Floats:
        """Return P(open) at times behind the last reading, changes to come included."""
        lasting, threshold = self._chain.lasting, self._chain.threshold
        ends_s = self._ends_s()
        evidence = self._over + self._survives(self._last_s)
        p_same = lasting[self._is_open].survive(times_s - self._start_s) / evidence
        # After that they take turns, each as long as its prior needs to fall to the threshold.
        other, same = lasting[not self._is_open], lasting[self._is_open]
        other_s, same_s = other.age_s(threshold), same.age_s(threshold)
        phase = np.mod(np.maximum(times_s - ends_s, 0.0), other_s + same_s)
        p_later = np.where(phase < other_s, 1 - other.survive(phase), same.survive(phase - other_s))
        p = np.where(times_s < ends_s, p_same, p_later)
        return np.asarray(p if self._is_open else 1 - p)

    def _go_to(self, at_s: float) -> None:
        while (ends_s := self._ends_s()) < at_s:
            self._is_open = not self._is_open
            self._start_s = self._last_s = ends_s
            self._over = 0.0

    def _ends_s(self) -> float:
        """Return when the belief in the state falls to the threshold, without further readings."""
        now = self._survives(self._last_s)
        then = self._chain.threshold * (self._over + now)
        if then >= now:
            return self._last_s
        age_s = self._chain.lasting[self._is_open].age_s(max(then, 1e-12))
        return max(self._start_s + age_s, self._last_s)

    def _survives(self, at_s: float) -> float:
        return self._chain.lasting[self._is_open].survives(at_s - self._start_s)


def forecasts(chain: Chain, readings: Readings, times_s: Floats, last: NDArray[np.intp]) -> Floats:
    """Return P(open) at some times, each by the readings up to its `last`."""
    p_open = np.full(len(times_s), 0.5)
    if not len(readings):
        return p_open
    order = np.argsort(last, kind="stable")
    ends = np.searchsorted(last[order], np.arange(len(readings) + 1)).tolist()
    columns = (readings.times_s, readings.reads_open, readings.missed, readings.false)
    door = ChainedFilter(chain, float(readings.times_s[0]), is_open=bool(readings.reads_open[0]))
    for n, (at, is_open, missed, false) in enumerate(
        zip(*map(np.ndarray.tolist, columns), strict=True)
    ):
        door.read(at, reads_open=is_open, missed=missed, false=false)
        if ends[n] < ends[n + 1]:
            asked = order[ends[n] : ends[n + 1]]
            p_open[asked] = door.p_open(times_s[asked])
    return p_open


def states(readings: Readings, price: float) -> NDArray[np.bool_]:
    """Return the most likely states, where each change costs so many nats (Viterbi)."""
    when = np.where(readings.reads_open, readings.reads_open - readings.missed, readings.missed)
    when_open = np.log(np.maximum(when, 1e-6))
    when = np.where(readings.reads_open, readings.false, 1 - readings.false)
    when_closed = np.log(np.maximum(when, 1e-6))
    best, changed = [0.0, 0.0], np.zeros((len(readings), 2), np.bool_)
    for n, said in enumerate(zip(when_closed.tolist(), when_open.tolist(), strict=True)):
        stay, come = best, [best[1] - price, best[0] - price]
        changed[n] = come[0] > stay[0], come[1] > stay[1]
        best = [max(stay[state], come[state]) + said[state] for state in (0, 1)]
    found = np.zeros(len(readings), np.bool_)
    state = int(best[1] > best[0])
    for n in range(len(readings) - 1, -1, -1):
        found[n] = state
        state ^= int(changed[n, state])
    return found


def durations_s(readings: Readings, price: float) -> tuple[Floats, Floats]:
    """Return how long the door was closed each time, and how long open; never empty."""
    found = states(readings, price)
    begins = np.flatnonzero(np.diff(found, prepend=not found[0]))
    lasted = np.maximum(np.diff(readings.times_s[begins], append=readings.times_s[-1]), 1.0)
    # A state that was never seen is over at once, as Perpetua's example of a room has it.
    never = np.array([1.0])
    closed, opened = lasted[~found[begins]], lasted[found[begins]]
    return closed if len(closed) else never, opened if len(opened) else never


def learnt(ask: Ask) -> Chain:
    """Return the settings that forecast the training part best."""
    readings = ask.readings[max(0, ask.training - MOST_READINGS) : ask.training]
    last, asked = trials(readings, ask.ahead_s)
    chains = [
        Chain((prior.of(closed), prior.of(opened)), threshold)
        for closed, opened in (durations_s(readings, price) for price in PRICES)
        for prior, threshold in product(PRIORS, THRESHOLDS)
    ]

    def brier(chain: Chain) -> float:
        p_open = forecasts(chain, readings, readings.times_s[asked], last)
        p_reads = readings.p_reads_open(p_open, asked)
        return float(np.mean((p_reads - readings.reads_open[asked]) ** 2))

    return min(chains, key=brier)


def trials(readings: Readings, ahead_s: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return (last reading known, reading to be told) of trials on what teaches."""
    first = int(RUN_UP * len(readings))
    step = max(1, (len(readings) - first) // MOST_TRIALS)
    last = np.arange(first, len(readings) - 1, step)
    asked = np.searchsorted(readings.times_s, readings.times_s[last] + ahead_s)
    asked = np.maximum(asked, last + 1)
    last, asked = last[asked < len(readings)], asked[asked < len(readings)]
    # What comes behind an outage is no trial of that lead.
    usual_s = float(np.median(np.diff(readings.times_s)))
    near = readings.times_s[asked] - readings.times_s[last] <= ahead_s + 2 * usual_s
    return last[near], asked[near]


def predict(ask: Ask) -> Floats:
    """Return P(open) of what is asked."""
    if ask.training < 20:
        return np.full(len(ask.times_s), 0.5)
    return forecasts(learnt(ask), ask.readings, ask.times_s, ask.last)


if __name__ == "__main__":
    answer_all(predict)
