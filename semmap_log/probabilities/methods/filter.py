"""`filter`: what was seen lately, and the schedule, weighed by how fast the door forgets.

A hidden Markov chain (see `chain`) whose long run is the schedule: what is believed now decays
toward how the door is at such hours, at rates learnt from the door's own past, by time of day.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import DoorId
from semmap_log.moments import SECOND_NS
from semmap_log.probabilities.chain.chain import Steps, filtered
from semmap_log.probabilities.chain.forgetting import Forgetting, forgettings_of
from semmap_log.probabilities.chain.nodes import LOOK_NS, Looks, held_at, looks
from semmap_log.probabilities.chain.scan import states
from semmap_log.probabilities.evidence.evidence import DoorEvidence
from semmap_log.probabilities.forecast import LEAST, MOST, Forecast
from semmap_log.probabilities.local_clock import LocalClock
from semmap_log.probabilities.methods.memory import Memory
from semmap_log.probabilities.methods.schedule import DoorSchedule, nothing_known

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


class _Belief(NamedTuple):
    """What was believed at some times, since when."""

    p_open: Reals
    """When it was last told."""
    spread: Reals
    """Standard deviation of that: it rests on a schedule that is not known for sure."""
    told_ns: Times
    """When that was."""
    seen_ns: Times
    """When the door was really seen, at that look or before."""


@dataclass(frozen=True, slots=True)
class _Epoch:
    """A time with the same rates, and what was believed in it."""

    forgetting: Forgetting
    looks: Looks
    believed: Reals
    """(n,): P(open) after each look."""
    spread: Reals
    """(n,): its standard deviation."""

    def belief(self, known_ns: Times) -> _Belief:
        """Return what the looks up to each time say."""
        place = np.maximum(np.searchsorted(self.looks.times_ns, known_ns, "right") - 1, 0)
        sees = np.maximum.accumulate(np.where(self.looks.llr != 0, np.arange(len(self.looks)), -1))
        seen_ns = np.where(sees >= 0, self.looks.times_ns[sees], _NEVER)
        told_ns = self.looks.times_ns[place]
        return _Belief(self.believed[place], self.spread[place], told_ns, seen_ns[place])


class DoorFilter:
    """What was learnt about one door; each epoch when it is first asked for."""

    def __init__(self, evidence: DoorEvidence, clock: LocalClock) -> None:
        self._evidence = evidence
        self._clock = clock
        self.schedule = DoorSchedule(evidence, clock)
        self._first_day = int(self._days(_first_ns(evidence))[0])
        self._memory = Memory(evidence, self.schedule, clock)
        self._epochs: dict[int, _Epoch] = {}

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return forecasts: see `Learnt.predict`."""
        known_ns = np.minimum(known_ns, times_ns)
        p_open, variance, is_known, days = self.schedule.expect(times_ns, known_ns)
        epochs = self._epoch_of(known_ns)
        for number in np.unique(epochs).tolist():
            asked = epochs == number
            epoch = self._epoch(number)
            times, known = times_ns[asked], known_ns[asked]
            belief = self._belief(epoch, known)
            kept = epoch.forgetting.kept(belief.told_ns, times, self._clock)
            deviation = belief.p_open - self.schedule.p_open(belief.told_ns, known)
            p_open[asked] += kept * deviation
            held = belief.told_ns == known
            if held.any():
                where = np.flatnonzero(asked)[held]
                p_open[where] += self._memory.correction(
                    epoch.forgetting, times[held], known[held], deviation[held]
                )
            variance[asked] *= (1 - kept) ** 2
            variance[asked] += (epoch.forgetting.unsure(kept) * deviation) ** 2
            variance[asked] += (kept * belief.spread) ** 2
            fresh = epoch.forgetting.kept(belief.seen_ns, times, self._clock) >= FRESH
            is_known[asked] |= fresh & (belief.seen_ns > _NEVER)
        return Forecast.around(p_open, variance, is_known, days)

    def wait_s(self, at_ns: int, *, until_open: bool) -> float:
        """Return how long it will take, on average, until the door is open, or closed; seconds.

        It is the mean first passage of the chain: through time t survive e^(-H(t)) of the doors
        that are not so yet, H being the sum of their rates.
        """
        steps_ns = at_ns + np.arange(WAIT_D * 48, dtype=np.int64) * LOOK_NS
        known_ns = np.full(len(steps_ns), at_ns)
        forgetting = self._epoch(int(self._epoch_of(known_ns[:1])[0])).forgetting
        here = self.predict(known_ns[:1], known_ns[:1]).p_open[0]
        expected = self.schedule.p_open(steps_ns, known_ns)
        step_s = LOOK_NS / SECOND_NS
        # What changes faster than it is looked at may do so at any pace: looks do not tell which.
        relaxation = np.minimum(forgetting.rates.relaxation, 1 / step_s)
        rate = relaxation[self._clock.hour_of(steps_ns) % 24]
        rate = rate * (expected if until_open else 1 - expected)
        left = np.exp(-np.append(0.0, np.cumsum(rate * step_s)))
        waited_s = float(((left[:-1] - left[1:]) / rate).sum() + left[-1] / rate.mean())
        return float(1 - here if until_open else here) * waited_s

    def _belief(self, epoch: _Epoch, known_ns: Times) -> _Belief:
        """Return what was believed at each time; where the state is known, that."""
        found = epoch.belief(known_ns)
        held, is_open = held_at(self._evidence, known_ns)
        state = np.where(is_open, MOST, LEAST)
        return _Belief(
            np.where(held, state, found.p_open),
            np.where(held, 0.0, found.spread),
            np.where(held, known_ns, found.told_ns),
            np.where(held, known_ns, found.seen_ns),
        )

    def past(self, known_ns: int) -> Looks | None:
        """Return what the rates in force at a time are learnt from; None: they are learnt."""
        number = int(self._epoch_of(np.array([known_ns], np.int64))[0])
        return None if number in self._epochs else self._past(number)

    def learn(self, known_ns: int, forgetting: Forgetting) -> None:
        """Take the rates in force at a time."""
        number = int(self._epoch_of(np.array([known_ns], np.int64))[0])
        self._epochs[number] = self._made(number, forgetting)

    def _epoch(self, number: int) -> _Epoch:
        if number not in self._epochs:
            (forgetting,) = forgettings_of([self._past(number)])
            self._epochs[number] = self._made(number, forgetting)
        return self._epochs[number]

    def _past(self, number: int) -> Looks:
        """Return the looks before an epoch; in the first one there are none."""
        first_ns = self._midnight_ns(_learnt_on(number))
        back_ns = self._midnight_ns(_learnt_on(number) - LEARNT_FROM_D)
        return looks(self._evidence.up_to(first_ns - 1), self._clock, back_ns, first_ns - 1)

    def _made(self, number: int, forgetting: Forgetting) -> _Epoch:
        """Return an epoch of such rates: what is believed of what is seen in it."""
        # One look more: also who asks for what was known before the first sighting finds one.
        run_up_ns = self._midnight_ns(_learnt_on(number) - RUN_UP_D) - LOOK_NS
        until_ns = min(self._midnight_ns(_learnt_on(number + 1)), self._evidence.until_ns)
        seen = looks(self._evidence, self._clock, run_up_ns, max(run_up_ns, until_ns))
        return self._believed(seen, forgetting)

    def _midnight_ns(self, day: int) -> int:
        """Return when a day of the door's begins, counted from its first; none is before that."""
        days = np.array([self._first_day + max(day, 0)])
        return int(self._clock.midnights_ns(days)[0])

    def _believed(self, seen: Looks, forgetting: Forgetting) -> _Epoch:
        """Return what is believed after each look.

        The chain's steps are such that its long run is the schedule, as it was known at the time.
        """
        times_ns = seen.times_ns
        before_ns = np.append(times_ns[:1], times_ns[:-1])
        here, variance, _, _ = self.schedule.expect(times_ns, times_ns)
        before = self.schedule.p_open(before_ns, times_ns)
        kept = forgetting.kept(before_ns, times_ns, self._clock)
        kept[:1] = 0.0
        # A surprise stays possible, by the half hour: looks in a row leave no room for a hundred.
        least = LEAST * np.minimum((times_ns - before_ns) / LOOK_NS, 1.0)
        from_closed = np.clip(here - before * kept, least, 1 - least)
        from_open = np.clip(here + (1 - before) * kept, from_closed, 1 - least)
        after, foretold = filtered(Steps(from_closed, from_open), seen.llr)
        moved = after * (1 - after) / np.maximum(foretold * (1 - foretold), _CERTAIN)
        return _Epoch(forgetting, seen, after, _carried(moved * kept, moved * (1 - kept), variance))

    def _epoch_of(self, known_ns: Times) -> NDArray[np.intp]:
        """Return which epoch each time lies in."""
        age_d = np.maximum(self._days(known_ns) - self._first_day, 0)
        later = len(LEARNT_ON) + (age_d - LEARNT_ON[-1]) // LEARNT_EVERY_D
        early = np.searchsorted(np.array(LEARNT_ON), age_d, "right")
        return np.where(age_d >= LEARNT_ON[-1], later, early).astype(np.intp)

    def _days(self, times_ns: Times) -> NDArray[np.int64]:
        return self._clock.hour_of(times_ns) // 24


class LearntFilter:
    """What was learnt about all doors; each when it is first asked for."""

    def __init__(self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock) -> None:
        self._evidence = evidence
        self._clock = clock
        self._doors: dict[DoorId, DoorFilter] = {}

    def predict(self, door_id: DoorId, times_ns: Times, known_ns: Times) -> Forecast:
        """Return how likely the door is open: see `Learnt`."""
        if door_id not in self._evidence:
            return nothing_known(len(times_ns))
        return self._door(door_id).predict(times_ns, known_ns)

    def prepare(self, door_ids: Iterable[DoorId], known_ns: int) -> None:
        """Learn of many doors at once what forecasts of that moment need; they come quicker then.

        Args:
            door_ids: Which doors.
            known_ns: What the forecasts may know.
        """
        doors = [self._door(door_id) for door_id in door_ids if door_id in self._evidence]
        pasts = [(door, door.past(known_ns)) for door in doors]
        missing = [(door, past) for door, past in pasts if past is not None]
        learnt = forgettings_of([past for _, past in missing])
        for (door, _), forgetting in zip(missing, learnt, strict=True):
            door.learn(known_ns, forgetting)

    def wait_s(self, door_id: DoorId, at_ns: int, *, until_open: bool = True) -> float:
        """Return the expected wait until a door is open, or closed, in seconds; NaN: not known.

        Args:
            door_id: The door.
            at_ns: From then on, by what was known then.
            until_open: Or until it is closed.
        """
        if door_id not in self._evidence:
            return math.nan
        return self._door(door_id).wait_s(at_ns, until_open=until_open)

    def _door(self, door_id: DoorId) -> DoorFilter:
        if door_id not in self._doors:
            self._doors[door_id] = DoorFilter(self._evidence[door_id], self._clock)
        return self._doors[door_id]


@dataclass(frozen=True, slots=True)
class Filter:
    """The estimator."""

    name: str = "filter"

    def learn(self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock) -> LearntFilter:
        """Return what the evidence teaches."""
        return LearntFilter(evidence, clock)


_NEVER = 0
"""Of times: nanoseconds since 1970."""
_CERTAIN = 1e-12
"""Of a variance: whoever sees a door for sure, again and again at once, leaves none."""


def _carried(of_before: Reals, of_schedule: Reals, variance: Reals) -> Reals:
    """Return (n,): how unsure each belief is, which leans on the one before and on the schedule.

    A recurrence y = a y + b, as products of [[a, b], [0, 1]].
    """
    steps = np.zeros((2, 2, len(variance)))
    steps[0, 0], steps[0, 1], steps[1, 1] = of_before, of_schedule * np.sqrt(variance), 1.0
    carried, one = states(steps, np.array([0.0, 1.0]))
    found: Reals = carried / one
    return found


def _learnt_on(epoch: int) -> int:
    """Return how many days after a door's first its rates are learnt for that epoch."""
    if epoch <= len(LEARNT_ON):
        return (0, *LEARNT_ON)[epoch]
    return LEARNT_ON[-1] + (epoch - len(LEARNT_ON)) * LEARNT_EVERY_D


def _first_ns(evidence: DoorEvidence) -> Times:
    """Return when the door was first told of, as an array of one."""
    firsts = [times[:1] for times in (evidence.start_ns, evidence.seen_ns)]
    return np.array([np.concatenate(firsts).min(initial=evidence.until_ns)], np.int64)
