"""`filter`: what was seen lately, and the schedule, weighed by how fast the door forgets.

A hidden Markov chain (see `chain`) whose long run is the schedule: what is believed now decays
toward how the door is at such hours, at rates learnt from the door's own past, by time of day.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from semmap_log.common.distinct import distinct
from semmap_log.common.late_dataclass import dataclass
from semmap_log.common.lazily import computed_once
from semmap_log.domain.doors import DoorId
from semmap_log.domain.moments import SECOND_NS
from semmap_log.probabilities.chain.first_passages import Passages, first_passages
from semmap_log.probabilities.chain.forgetting import Forgetting, forgettings_of
from semmap_log.probabilities.chain.nodes import LOOK_NS, Looks, held_at, looks, training_set
from semmap_log.probabilities.evidence.evidence import DoorEvidence
from semmap_log.probabilities.forecast import LEAST, MOST, Forecast
from semmap_log.probabilities.local_clock import HOUR_S, LocalClock
from semmap_log.probabilities.methods.by_door import LearntByDoor
from semmap_log.probabilities.methods.epoch import NEVER, Belief, Epoch, believed
from semmap_log.probabilities.methods.memory import Memory
from semmap_log.probabilities.methods.schedule import DoorSchedule

Times = NDArray[np.int64]
Reals = NDArray[np.float64]

LEARNT_ON = (1, 2, 3, 5, 7, 10, 14, 21, 28)
"""Days after a door's first at whose midnights its rates are learnt anew; then each 28 days."""
LEARNT_EVERY_D = 28
LEARNT_FROM_D = 182
"""Rates are those of the last half year."""
RUN_UP_D = 14
"""So long before an epoch its filter starts; what was seen earlier is forgotten by then."""
WAIT_D = 28
"""So far ahead a wait is worked out by the hour."""
FRESH = 0.5
"""The belief counts as known while so much is left of what was seen last."""


LearntRates = dict[int, Forgetting]
"""When a door's rates were learnt -> what they do to a belief from then on."""


class DoorFilter:
    """What was learnt about one door; each epoch when it is first asked for."""

    def __init__(self, evidence: DoorEvidence, clock: LocalClock, rates: LearntRates) -> None:
        """Take a door.

        Args:
            evidence: Of the door.
            clock: Whose days and hours.
            rates: Those learnt before; what is learnt is added.
        """
        self._evidence = evidence
        self._clock = clock
        self._rates = rates
        self._first_day = int(self._days(np.array([evidence.first_ns]))[0])
        self._epochs: dict[int, Epoch] = {}
        self._passed: dict[tuple[int, bool], Passages] = {}

    @computed_once
    def schedule(self) -> DoorSchedule:
        """What the door tends to."""
        return DoorSchedule(self._evidence, self._clock)

    @computed_once
    def _memory(self) -> Memory:
        return Memory(self._evidence, self.schedule, self._clock)

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return forecasts: see `LearntModel.predict`."""
        known_ns = np.minimum(known_ns, times_ns)
        p_open, variance, is_known, days = self.schedule.expect(times_ns, known_ns)
        epochs = self._epochs_of(known_ns)
        for number in distinct(epochs).tolist():
            asked = epochs == number
            epoch = self._epoch(number)
            times, known = times_ns[asked], known_ns[asked]
            belief = self._belief(epoch, known)
            kept = epoch.forgetting.kept(belief.told_ns, times, self._clock)
            kept[belief.seen_ns <= NEVER] = 0.0  # nothing was seen: the schedule alone speaks
            deviation = belief.p_open - self.schedule.p_open(belief.told_ns, known)
            p_open[asked] += kept * deviation
            held = belief.is_held
            if held.any():
                where = np.flatnonzero(asked)[held]
                p_open[where] += self._memory.correction(
                    epoch.forgetting, times[held], known[held], deviation[held]
                )
            # What is forgotten gives way to the schedule of all hours in between. Its errors hang
            # together in part: were they one, it would be (1 - kept)^2; each its own, 1 - kept^2.
            variance[asked] *= 1 - kept
            variance[asked] += (epoch.forgetting.unsure(kept) * deviation) ** 2
            variance[asked] += (kept * belief.spread) ** 2
            fresh = epoch.forgetting.kept(belief.seen_ns, times, self._clock) >= FRESH
            is_known[asked] |= fresh & (belief.seen_ns > NEVER)
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
        """Return how long it will take, on average, until the door is open, or closed; seconds.

        It is the mean first passage: through time t survive e^(-H(t)) of the doors that are not so
        yet, H being the sum of their rates.

        Args:
            at_ns: From then on.
            until_open: Or until it is closed.
            most_s: Who waits so long goes; None: nobody does.
            known_ns: By what was known then; None: at `at_ns`.
            is_other: It is found closed, or open, then: there is a wait for sure.
        """
        told_ns = at_ns if known_ns is None else min(known_ns, at_ns)
        per_h = self._passages(told_ns, until_open).per_h
        waited_s = self._mean_wait_s(at_ns, per_h, most_s)
        return waited_s if is_other else self._waits(at_ns, told_ns, until_open) * waited_s

    def wait_interval_s(self, at_ns: int, *, until_open: bool) -> tuple[float, float]:
        """Return the ends of the 90 % interval of that mean, as few passages leave it open."""
        passages, waits = self._passages(at_ns, until_open), self._waits(at_ns, at_ns, until_open)
        longest, shortest = (
            0.0 if np.isinf(factor) else self._mean_wait_s(at_ns, factor * passages.per_h)
            for factor in passages.bounds
        )
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
        """Return how soon it passes to that state, as the last midnight knew it."""
        midnight_ns = int(self._clock.midnights_ns(self._days(np.array([told_ns])))[0])
        key = midnight_ns, until_open
        if key not in self._passed:
            known = self._evidence.up_to(midnight_ns - 1)
            rates = self._epoch(self.epoch_at(told_ns)).forgetting.rates
            self._passed[key] = first_passages(known, self._clock, rates, until_open=until_open)
        return self._passed[key]

    def _belief(self, epoch: Epoch, known_ns: Times) -> Belief:
        """Return what was believed at each time; where the state is known, that."""
        found = epoch.belief(known_ns)
        held, is_open = held_at(self._evidence, known_ns)
        state = np.where(is_open, MOST, LEAST)
        return Belief(
            np.where(held, state, found.p_open),
            np.where(held, 0.0, found.spread),
            np.where(held, known_ns, found.told_ns),
            np.where(held, known_ns, found.seen_ns),
            held,
        )

    def epoch_at(self, known_ns: int) -> int:
        """Return the number of the epoch that a time lies in."""
        return int(self._epochs_of(np.array([known_ns], np.int64))[0])

    def learnt_ns(self, number: int) -> int:
        """Return when an epoch begins, and its rates were learnt."""
        return self._midnight_ns(_learnt_on(number))

    def past(self, number: int) -> Looks:
        """Return the looks before an epoch, which teach its rates; in the first there are none."""
        first_ns = self.learnt_ns(number)
        back_ns = self._midnight_ns(_learnt_on(number) - LEARNT_FROM_D)
        return training_set(self._evidence.up_to(first_ns - 1), self._clock, back_ns, first_ns - 1)

    def _epoch(self, number: int) -> Epoch:
        if number not in self._epochs:
            at_ns = self.learnt_ns(number)
            if at_ns not in self._rates:
                (self._rates[at_ns],) = forgettings_of([self.past(number)])
            self._epochs[number] = self._made(number, self._rates[at_ns])
        return self._epochs[number]

    def _made(self, number: int, forgetting: Forgetting) -> Epoch:
        """Return an epoch of such rates: what is believed of what is seen in it."""
        # One look more: also who asks for what was known before the first sighting finds one.
        run_up_ns = self._midnight_ns(_learnt_on(number) - RUN_UP_D) - LOOK_NS
        until_ns = min(self._midnight_ns(_learnt_on(number + 1)), self._evidence.until_ns)
        seen = looks(self._evidence, self._clock, run_up_ns, max(run_up_ns, until_ns))
        return believed(seen, self.schedule, forgetting, self._clock)

    def _midnight_ns(self, day: int) -> int:
        """Return when a day of the door's begins, counted from its first; none is before that."""
        days = np.array([self._first_day + max(day, 0)])
        return int(self._clock.midnights_ns(days)[0])

    def _epochs_of(self, known_ns: Times) -> NDArray[np.intp]:
        """Return which epoch each time lies in."""
        age_d = np.maximum(self._days(known_ns) - self._first_day, 0)
        later = len(LEARNT_ON) + (age_d - LEARNT_ON[-1]) // LEARNT_EVERY_D
        early = np.searchsorted(np.array(LEARNT_ON), age_d, "right")
        return np.where(age_d >= LEARNT_ON[-1], later, early).astype(np.intp)

    def _days(self, times_ns: Times) -> NDArray[np.int64]:
        return self._clock.hour_of(times_ns) // 24


class LearntFilter(LearntByDoor[DoorFilter]):
    """What was learnt about all doors; of each the rates are kept, small as they are."""

    def __init__(
        self,
        evidence: Mapping[DoorId, DoorEvidence],
        clock: LocalClock,
        rates: Mapping[DoorId, LearntRates] = MappingProxyType({}),
    ) -> None:
        """Take the evidence, and rates that were learnt from what it holds.

        Args:
            evidence: Of all doors.
            clock: Whose days and hours.
            rates: Those that need not be learnt anew.
        """
        self._clock = clock
        self._rates: defaultdict[DoorId, LearntRates] = defaultdict(dict, rates)
        super().__init__(evidence, lambda door: DoorFilter(door, clock, self._rates[door.door_id]))

    def continued(
        self, evidence: Mapping[DoorId, DoorEvidence], unmoved_until_ns: int
    ) -> LearntFilter:
        """Return what more evidence teaches: see `IncrementalModel`."""
        rates = {
            door_id: {at_ns: found for at_ns, found in learnt.items() if at_ns <= unmoved_until_ns}
            for door_id, learnt in self._rates.items()
        }
        return LearntFilter(evidence, self._clock, rates)

    def prepare(self, door_ids: Iterable[DoorId], known_ns: int) -> None:
        """Learn of many doors at once what forecasts of that moment need; they come quicker then.

        Args:
            door_ids: Which doors.
            known_ns: What the forecasts may know.
        """
        pasts: dict[tuple[DoorId, int], Looks] = {}
        for door_id in door_ids:
            if door_id in self.evidence:
                door = self.door(door_id)
                number = door.epoch_at(known_ns)
                at_ns = door.learnt_ns(number)
                if at_ns not in self._rates[door_id]:
                    pasts[door_id, at_ns] = door.past(number)
        learnt = forgettings_of(list(pasts.values()))
        for (door_id, at_ns), forgetting in zip(pasts, learnt, strict=True):
            self._rates[door_id][at_ns] = forgetting

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
            most_s: Who waits so long goes; None: nobody does.
            known_ns: By what was known then; None: at `at_ns`.
            is_other: It is found closed, or open, then: there is a wait for sure.
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


def _learnt_on(epoch: int) -> int:
    """Return how many days after a door's first its rates are learnt for that epoch."""
    if epoch <= len(LEARNT_ON):
        return (0, *LEARNT_ON)[epoch]
    return LEARNT_ON[-1] + (epoch - len(LEARNT_ON)) * LEARNT_EVERY_D
