"""A door as a two-state chain whose rates hold for half an hour of the week: its chances, exactly.

Weeks begin on a Monday, 00:00 UTC. Nothing here is estimated: P(open), also by a state that was
known at some time, and the mean wait are the solutions of the chain's equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from patrol_sim.habits import HOUR_NS, SLOTS, Habit

from semmap_log.analysis.beliefs.trials import StateIntervals
from semmap_log.analysis.probabilities.chain.matrix_scan import Steps, filtered
from semmap_log.core.model.doors import DoorState

Reals = NDArray[np.float64]
Times = NDArray[np.int64]

SLOT_H = 0.5
WEEK_H = SLOTS * SLOT_H
MONDAY_NS = int(np.datetime64("2026-01-05", "ns").astype(np.int64))


@dataclass(frozen=True)
class WeekChain:
    """How often an hour a closed door is opened, and an open one closed."""

    opening: Reals
    """(336,)."""
    closing: Reals
    """(336,)."""

    @classmethod
    def of(cls, habit: Habit) -> WeekChain:
        """Return the chain of a door with that habit."""
        opening, closing = (
            np.array([habit.leaving_rate(state, slot) for slot in range(SLOTS)])
            for state in (DoorState.CLOSED, DoorState.OPEN)
        )
        return cls(opening, closing)

    @property
    def relaxation(self) -> Reals:
        """(336,): per hour."""
        return self.opening + self.closing

    def p_open(self, times_ns: Times) -> Reals:
        """Return P(open) of a door of which nothing was seen, (n,)."""
        hours = _hours(times_ns)
        slot = _slot(hours)
        return self._after(slot, self._at_slots()[slot], hours % SLOT_H)

    def p_open_later(self, times_ns: Times, known_ns: Times, p_then: NDArray[Any]) -> Reals:
        """Return P(open) of a door of which it was known at a time before, (n,).

        Args:
            times_ns: (n,).
            known_ns: (n,), before them.
            p_then: (n,), P(open) at those; 0 or 1 where the state was known.
        """
        kept = self._kept(known_ns, times_ns)
        return self.p_open(times_ns) + kept * (p_then - self.p_open(known_ns))

    def p_open_by(self, seen_ns: Times, llr: Reals, known_ns: Times) -> Reals:
        """Return P(open) at times of a door that was seen at others, (n,), the last one included.

        Args:
            seen_ns: (k,), ascending.
            llr: (k,), what each says, nats.
            known_ns: (n,).
        """
        before_ns = np.append(seen_ns[:1], seen_ns[:-1])
        here, kept = self.p_open(seen_ns), self._kept(before_ns, seen_ns)
        kept[0] = 0.0
        from_closed = np.clip(here - kept * self.p_open(before_ns), 0, 1)[:, None]
        steps = Steps(from_closed, np.clip(from_closed + kept[:, None], 0, 1))
        after = filtered(steps, llr, np.full(1, 0.5))[0][:, 0]
        last = np.maximum(np.searchsorted(seen_ns, known_ns, "right") - 1, 0)
        return self.p_open_later(known_ns, seen_ns[last], after[last])

    def wait_h(self, times_ns: Times, is_open: NDArray[np.bool_]) -> Reals:
        """Return the mean wait until the door is open, hours, (n,): 0 where it is.

        Through a half hour of rate a survive e^(-a/2), and their mean time in it is
        (1 - e^(-a/2)) / a; a week later the wait is what it was.
        """
        survive = np.exp(-self.opening * SLOT_H)
        spent = _spent(self.opening, SLOT_H)
        # The wait from the week's beginning: what is spent in it, and after it the same again.
        reached = np.append(1.0, np.cumprod(survive))
        wait = np.empty(SLOTS + 1)
        wait[-1] = (reached[:-1] * spent).sum() / (1 - reached[-1])
        for slot in range(SLOTS - 1, -1, -1):
            wait[slot] = spent[slot] + survive[slot] * wait[slot + 1]
        hours = _hours(times_ns)
        slot, left_h = _slot(hours), SLOT_H - hours % SLOT_H
        rate = self.opening[slot]
        found = _spent(rate, left_h) + np.exp(-rate * left_h) * wait[slot + 1]
        return np.where(is_open, 0.0, found)

    def life(self, rng: np.random.Generator, weeks: float) -> StateIntervals:
        """Return one life of such a door, from Monday on, known all through."""
        hours, state = [0.0], [bool(rng.random() < self._at_slots()[0])]
        now, end, left = 0.0, weeks * WEEK_H, rng.exponential()
        while True:
            rates = self.closing if state[-1] else self.opening
            passed, total = self._rate_through(rates, now), self._rate_through(rates, WEEK_H)
            through = passed + left
            if total <= 0 or not np.isfinite(through):
                break
            week, rest = divmod(through, total)
            now = now // WEEK_H * WEEK_H + week * WEEK_H + self._when(rates, rest)
            if now >= end:
                break
            hours.append(now)
            state.append(not state[-1])
            left = rng.exponential()
        times = MONDAY_NS + np.rint(np.array([*hours, end]) * HOUR_NS).astype(np.int64)
        return StateIntervals(times[:-1], times[1:], np.array(state))

    def _at_slots(self) -> Reals:
        """Return P(open) at the beginning of each half hour, (336,): that of the week before."""
        kept = np.exp(-self.relaxation * SLOT_H)
        share = self.opening / np.maximum(self.relaxation, 1e-300)
        of_week, added = 1.0, 0.0
        for k, s in zip(kept, share, strict=True):
            of_week, added = of_week * k, s + k * (added - s)
        found = np.empty(SLOTS)
        found[0] = added / (1 - of_week)
        for slot in range(SLOTS - 1):
            found[slot + 1] = share[slot] + kept[slot] * (found[slot] - share[slot])
        return found

    def _after(self, slot: NDArray[np.intp], p_open: Reals, hours: Reals) -> Reals:
        share = self.opening[slot] / np.maximum(self.relaxation[slot], 1e-300)
        found: Reals = share + np.exp(-self.relaxation[slot] * hours) * (p_open - share)
        return found

    def _kept(self, from_ns: Times, to_ns: Times) -> Reals:
        """Return what is left of a deviation."""
        found: Reals = np.exp(self._through(_hours(from_ns)) - self._through(_hours(to_ns)))
        return found

    def _through(self, hours: Reals) -> Reals:
        """Return the integral of the relaxation since the first Monday."""
        before = np.append(0.0, np.cumsum(self.relaxation * SLOT_H))
        slot = _slot(hours)
        weeks = hours // WEEK_H
        found: Reals = weeks * before[-1] + before[slot] + self.relaxation[slot] * (hours % SLOT_H)
        return found

    @staticmethod
    def _rate_through(rates: Reals, hours: float) -> float:
        """Return the integral of rates since the beginning of the week of that hour."""
        in_week = hours % WEEK_H if hours < WEEK_H or hours % WEEK_H else WEEK_H
        slot = min(int(in_week / SLOT_H), SLOTS - 1)
        return float(rates[:slot].sum() * SLOT_H + rates[slot] * (in_week - slot * SLOT_H))

    @staticmethod
    def _when(rates: Reals, through: float) -> float:
        """Return the hour of the week at which the integral of rates reaches a value."""
        reached = np.cumsum(rates * SLOT_H)
        slot = int(np.searchsorted(reached, through, "right"))
        slot = min(slot, SLOTS - 1)
        before = reached[slot - 1] if slot else 0.0
        return slot * SLOT_H + (through - before) / max(rates[slot], 1e-300)


def _hours(times_ns: Times) -> Reals:
    return (times_ns - MONDAY_NS) / HOUR_NS


def _slot(hours: Reals) -> NDArray[np.intp]:
    return (hours % WEEK_H / SLOT_H).astype(np.intp)


def _spent(rate: Reals, hours: float | Reals) -> Reals:
    """Return the mean time until something of that rate happens, or the hours are over."""
    safe = np.maximum(rate, 1e-12)
    found: Reals = -np.expm1(-safe * hours) / safe
    return found
