"""How fast a door forgets: what share of a deviation from its schedule is left after some time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.common.late_dataclass import dataclass
from semmap_log.domain.moments import SECOND_NS
from semmap_log.probabilities.chain.markov_chain import Nodes, Rates
from semmap_log.probabilities.chain.nodes import Looks
from semmap_log.probabilities.chain.rates import START_PER_S, learn_rates
from semmap_log.probabilities.local_clock import DAY_S, HOUR_S, LocalClock

Times = NDArray[np.int64]
Reals = NDArray[np.float64]

HOURS = 24
SIDE_BY_SIDE = 20_000
"""So many looks, about, are learnt from at once: what fits a processor's cache."""


@dataclass(frozen=True, slots=True)
class Forgetting:
    """A door's rates by hour of the day, as what they do to a belief."""

    rates: Rates
    """(24,)."""
    changes: float
    """How many changes of the door they were learnt from, about."""

    def kept(self, from_ns: Times, to_ns: Times, clock: LocalClock) -> Reals:
        """Return what is left of a deviation: 1 of a fresh one, 0 in the long run."""
        from_s, to_s = clock.wall_s(from_ns), clock.wall_s(to_ns)
        through = self._through(to_s) - self._through(from_s)
        # An hour that comes twice passes twice, and one that is skipped not at all.
        unseen_s = (to_ns - from_ns) / SECOND_NS - (to_s - from_s)
        through += self.rates.relaxation.mean() * unseen_s
        kept: Reals = np.exp(-np.maximum(through, 0.0))
        return kept

    def mean_kept(self, ahead_h: Reals) -> Reals:
        """Return what is left after some hours, on average over the day."""
        starts_s: Reals = np.arange(HOURS, dtype=np.float64) * HOUR_S
        then_s: Reals = starts_s + ahead_h[:, None] * HOUR_S
        kept: Reals = np.exp(self._through(starts_s) - self._through(then_s)).mean(-1)
        return kept

    def unsure(self, kept: Reals) -> Reals:
        """Return the standard deviation of `kept`: rates learnt from n changes err by 1/sqrt(n)."""
        slope = kept * np.log(np.maximum(kept, 1e-12))
        found: Reals = np.abs(slope) / np.sqrt(self.changes + 1)
        return found

    def _through(self, wall_s: Reals) -> Reals:
        """Return the integral of the relaxation rate over local time, since some Monday."""
        per_s = self.rates.relaxation
        before = np.append(0.0, np.cumsum(per_s * HOUR_S))
        day, in_day_s = np.divmod(wall_s, DAY_S)
        hour = (in_day_s // HOUR_S).astype(np.intp)
        found: Reals = day * before[-1] + before[hour] + per_s[hour] * (in_day_s - hour * HOUR_S)
        return found


START = Forgetting(Rates(np.full(HOURS, START_PER_S), np.full(HOURS, START_PER_S)), 0.0)
"""Of a door of which nothing is known."""


def forgettings_of(doors: Sequence[Looks]) -> list[Forgetting]:
    """Return what the looks at each door teach: first its rates, then those of each hour.

    Many doors take little longer than one: they are learnt side by side.
    """
    found = [START] * len(doors)
    group: list[int] = []
    many = 0
    for place, looks in enumerate(doors):
        if np.any(looks.llr):
            group.append(place)
            many += len(looks)
        if group and (many > SIDE_BY_SIDE or place == len(doors) - 1):
            for learnt, forgetting in zip(group, _learnt([doors[p] for p in group]), strict=True):
                found[learnt] = forgetting
            group, many = [], 0
    return found


def _learnt(doors: Sequence[Looks]) -> Iterator[Forgetting]:
    """Yield what the looks at each door teach; all of them have some."""
    seen = [looks.only(looks.llr != 0).nodes() for looks in doors]
    nodes = Nodes.joined(seen, HOURS)
    overall = learn_rates(nodes.with_bins(nodes.bin // HOURS), len(doors))
    nodes = Nodes.joined([looks.nodes() for looks in doors], HOURS)
    rates = learn_rates(nodes, len(doors), bins=HOURS, prior=overall)
    per_s = 2 * overall.opening * overall.closing / overall.relaxation
    for door, looks in enumerate(doors):
        own = slice(door * HOURS, (door + 1) * HOURS)
        looked_s = int(looks.times_ns[-1] - looks.times_ns[0]) / SECOND_NS
        own_rates = Rates(rates.opening[own], rates.closing[own])
        yield Forgetting(own_rates, float(per_s[door] * looked_s))
