"""`filter`: what was seen lately, and the schedule, weighed by how fast the door forgets.

The present belief decays toward how the door is at such hours, by several `regimes` at once:
paces, and a door that is left closed, or open. The door's own past decides how far each is believed
at the requested lead (`belief_history`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.chain import regimes
from semmap_log.analysis.probabilities.chain.first_passages import Passages, first_passages
from semmap_log.analysis.probabilities.chain.looks import LOOK_NS
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.analysis.probabilities.methods.belief_history import NEVER, BeliefHistory
from semmap_log.analysis.probabilities.methods.by_door import LearntByDoor
from semmap_log.analysis.probabilities.methods.memory import Memory
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule
from semmap_log.core.lazily import computed_once
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import HOUR_S, LocalClock
from semmap_log.core.model.moments import HOUR_NS, SECOND_NS

Times = NDArray[np.int64]
Reals = NDArray[np.float64]

WAIT_D = 28
"""How far ahead a wait is computed by the hour."""
FRESH = 0.6
"""The belief counts as known while so much is left of what was seen last."""
TOGETHER_H = 3.0
"""How long the errors of a schedule are correlated; found on simulated doors."""


class DoorFilter:
    """What was learnt about one door."""

    def __init__(self, evidence: DoorEvidence, clock: LocalClock) -> None:
        self._evidence = evidence
        self._clock = clock
        self._passed: dict[tuple[int, bool], Passages] = {}

    @computed_once
    def schedule(self) -> DoorSchedule:
        """What the door tends to."""
        return DoorSchedule(self._evidence, self._clock)

    @computed_once
    def _memory(self) -> Memory:
        return Memory(self._evidence, self.schedule, self._clock)

    @computed_once
    def _history(self) -> BeliefHistory:
        return BeliefHistory(self._evidence, self.schedule, self._clock)

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return forecasts: see `LearntModel.predict`."""
        known_ns = np.minimum(known_ns, times_ns)
        tends_to, variance, is_known, days = self.schedule.expect(times_ns, known_ns)
        if self._evidence.is_empty:
            return Forecast.around(tends_to, variance, is_known, days)
        belief = self._history.at(known_ns)
        told = self.schedule.p_open(belief.told_ns, known_ns)
        gap_ns, age_ns = times_ns - belief.told_ns, times_ns - belief.seen_ns
        each = regimes.ahead(belief.p_open, told, tends_to, gap_ns, age_ns)
        is_seen = (belief.seen_ns > NEVER)[:, None]  # else the schedule alone speaks
        weight, maybe = (
            is_seen * self._history.weights(now, known_ns, gap_ns)
            for now in (belief.weight, belief.maybe)
        )
        p_open = tends_to + (weight * (each - tends_to[:, None])).sum(1)
        # Unknown are the regime, what the schedule should forecast, and what it forecast before.
        stays = weight * regimes.stays(gap_ns, age_ns)
        variance *= _leaned(np.maximum(1 - stays.sum(1), 0), gap_ns)
        variance += (maybe * (each - p_open[:, None]) ** 2).sum(1)
        variance += (stays * belief.spread).sum(1) ** 2
        is_known |= (weight * regimes.stays(age_ns, age_ns)).sum(1) >= FRESH
        held = np.flatnonzero(belief.is_held)
        if len(held):
            p_open[held] += self._memory.correction(
                self._history.kept, times_ns[held], known_ns[held],
                belief.p_open[held, 0] - told[held],
            )  # fmt: skip
        return Forecast.around(p_open, variance, is_known, days)

    def wait_s(
        self,
        at_ns: int,
        *,
        until_open: bool,
        most_s: float | None = None,
        known_ns: int | None = None,
        is_other: bool = False,
    ) -> float:
        """Return the mean time until the door is open, or closed; seconds.

        It is the mean first passage: through time t survive e^(-H(t)) of the doors that are not so
        yet, H being the sum of their rates.

        Args:
            at_ns: From then on.
            until_open: Or until it is closed.
            most_s: The longest wait; None: no limit.
            known_ns: When the evidence ends; default: `at_ns`.
            is_other: The door is found in the other state then, so that there is a wait.
        """
        told_ns = at_ns if known_ns is None else min(known_ns, at_ns)
        per_h = self._passages(told_ns, until_open).per_h
        waited_s = self._mean_wait_s(at_ns, per_h, most_s)
        return waited_s if is_other else self._waits(at_ns, told_ns, until_open) * waited_s

    def wait_interval_s(self, at_ns: int, *, until_open: bool) -> tuple[float, float]:
        """Return the ends of the 90 % interval of that mean, given the evidence."""
        waits = self._waits(at_ns, at_ns, until_open)
        passages = self._passages(at_ns, until_open)
        shortest, longest = passages.interval(lambda per_h: self._mean_wait_s(at_ns, per_h))
        return waits * shortest, waits * longest

    def _waits(self, at_ns: int, told_ns: int, until_open: bool) -> float:  # noqa: FBT001 - private
        """Return how likely there is a wait at all."""
        here = float(self.predict(np.array([at_ns]), np.array([told_ns])).p_open[0])
        return 1 - here if until_open else here

    def _mean_wait_s(self, at_ns: int, per_h: Reals, most_s: float | None = None) -> float:
        steps_ns = at_ns + np.arange(WAIT_D * 48, dtype=np.int64) * LOOK_NS
        step_s = LOOK_NS / SECOND_NS
        hour = self._clock.hour_of(steps_ns + LOOK_NS // 2)
        rate = per_h[hour // 24 % 7, hour % 24] / HOUR_S
        if most_s is None:
            left = np.exp(-np.append(0.0, np.cumsum(rate * step_s)))
            return float(((left[:-1] - left[1:]) / rate).sum() + left[-1] / rate.mean())
        lasts_s = np.clip(most_s - np.arange(len(rate)) * step_s, 0.0, step_s)
        left = np.exp(-np.append(0.0, np.cumsum(rate * lasts_s)))
        return float(((left[:-1] - left[1:]) / rate).sum())

    def _passages(self, told_ns: int, until_open: bool) -> Passages:  # noqa: FBT001 - private
        """Return the passages to that state, as the last midnight knew them."""
        day = self._clock.hour_of(np.array([told_ns])) // 24
        midnight_ns = int(self._clock.midnights_ns(day)[0])
        key = midnight_ns, until_open
        if key not in self._passed:
            known = self._evidence.up_to(midnight_ns - 1)
            self._passed[key] = first_passages(known, self._clock, until_open=until_open)
        return self._passed[key]


class LearntFilter(LearntByDoor[DoorFilter]):
    """What was learnt about all doors."""

    def __init__(self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock) -> None:
        super().__init__(evidence, lambda door: DoorFilter(door, clock))

    def wait_s(
        self,
        door_id: DoorId,
        at_ns: int,
        *,
        until_open: bool = True,
        most_s: float | None = None,
        known_ns: int | None = None,
        is_other: bool = False,
    ) -> float:
        """Return the expected wait until a door is open, or closed, in seconds; NaN: not known.

        Args:
            door_id: The door.
            at_ns: From then on.
            until_open: Or until it is closed.
            most_s: The longest wait; None: no limit.
            known_ns: When the evidence ends; default: `at_ns`.
            is_other: The door is found in the other state then, so that there is a wait.
        """
        if door_id not in self.evidence:
            return math.nan
        return self.door(door_id).wait_s(
            at_ns, until_open=until_open, most_s=most_s, known_ns=known_ns, is_other=is_other
        )

    def wait_interval_s(
        self, door_id: DoorId, at_ns: int, *, until_open: bool = True
    ) -> tuple[float, float]:
        """Return the ends of the 90 % interval of the expected wait, seconds; NaN: not known."""
        if door_id not in self.evidence:
            return math.nan, math.nan
        return self.door(door_id).wait_interval_s(at_ns, until_open=until_open)


@dataclass(frozen=True, slots=True)
class Filter:
    """The estimator."""

    name: str = "filter"

    def learn(self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock) -> LearntFilter:
        """Return what the evidence teaches."""
        return LearntFilter(evidence, clock)


def _leaned(share: Reals, gap_ns: Times) -> Reals:
    """Return (n,): how much of a schedule's variance is in what leans on it by that share.

    At once its errors are one: the square. Later they are those of several hours; by the share
    itself intervals held what they say.
    """
    apart = -np.expm1(-gap_ns / (TOGETHER_H * HOUR_NS))
    return share**2 + (share - share**2) * apart
