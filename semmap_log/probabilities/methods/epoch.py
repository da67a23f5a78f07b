"""A time in which a door's rates are the same: what is believed after each look in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.common.late_dataclass import dataclass
from semmap_log.probabilities.chain.forgetting import Forgetting
from semmap_log.probabilities.chain.markov_chain import Steps, filtered
from semmap_log.probabilities.chain.matrix_scan import states
from semmap_log.probabilities.chain.nodes import CERTAIN_LLR, LOOK_NS, Looks
from semmap_log.probabilities.forecast import LEAST
from semmap_log.probabilities.local_clock import LocalClock
from semmap_log.probabilities.methods.schedule import DoorSchedule

Times = NDArray[np.int64]
Reals = NDArray[np.float64]

NEVER = 0
"""Of times: nanoseconds since 1970."""
_CERTAIN = 1e-12
"""Of a variance: whoever sees a door again and again at once leaves none."""
_ROUNDING = 1e-9


class Belief(NamedTuple):
    """What was believed at some times, since when."""

    p_open: Reals
    """When it was last told."""
    spread: Reals
    """Standard deviation of that: it rests on a schedule that is not known for sure."""
    told_ns: Times
    """When that was."""
    seen_ns: Times
    """When the door was really seen, at that look or before."""
    is_held: NDArray[np.bool_]
    """Where it is no belief: the state was known."""


@dataclass(frozen=True, slots=True)
class Epoch:
    """A time with the same rates, and what was believed in it."""

    forgetting: Forgetting
    looks: Looks
    believed: Reals
    """(n,): P(open) after each look."""
    spread: Reals
    """(n,): its standard deviation."""

    def belief(self, known_ns: Times) -> Belief:
        """Return what the looks up to each time say."""
        place = np.maximum(np.searchsorted(self.looks.times_ns, known_ns, "right") - 1, 0)
        sees = np.maximum.accumulate(np.where(self.looks.llr != 0, np.arange(len(self.looks)), -1))
        seen_ns = np.where(sees >= 0, self.looks.times_ns[sees], NEVER)
        told_ns = self.looks.times_ns[place]
        nowhere = np.zeros(len(place), np.bool_)
        return Belief(self.believed[place], self.spread[place], told_ns, seen_ns[place], nowhere)


def believed(
    seen: Looks, schedule: DoorSchedule, forgetting: Forgetting, clock: LocalClock
) -> Epoch:
    """Return what is believed after each look.

    The chain's steps are such that its long run is the schedule, as it was known at the time.

    Args:
        seen: The looks.
        schedule: Of the door.
        forgetting: How fast beliefs tend to it.
        clock: Whose hours.
    """
    times_ns = seen.times_ns
    before_ns = np.append(times_ns[:1], times_ns[:-1])
    here, variance, _, _ = schedule.expect(times_ns, times_ns)
    before = schedule.p_open(before_ns, times_ns)
    kept = forgetting.kept(before_ns, times_ns, clock)
    kept[:1] = 0.0
    # A surprise stays possible, by the half hour: looks in a row leave no room for a hundred.
    least = LEAST * np.minimum((times_ns - before_ns) / LOOK_NS, 1.0)
    from_closed = np.clip(here - before * kept, least, 1 - least)
    from_open = np.clip(here + (1 - before) * kept, from_closed, 1 - least)
    # What is certain says all: it gainsays any number of earlier sightings.
    is_certain = np.abs(seen.llr) > CERTAIN_LLR - _ROUNDING
    from_closed[is_certain] = from_open[is_certain] = 0.5
    after, predicted = filtered(Steps(from_closed, from_open), seen.llr)
    moved = after * (1 - after) / np.maximum(predicted * (1 - predicted), _CERTAIN)
    return Epoch(forgetting, seen, after, _carried(moved * kept, moved * (1 - kept), variance))


def _carried(of_before: Reals, of_schedule: Reals, variance: Reals) -> Reals:
    """Return (n,): how unsure each belief is, which leans on the one before and on the schedule.

    A recurrence y = a y + b, as products of [[a, b], [0, 1]].
    """
    steps = np.zeros((2, 2, len(variance)))
    steps[0, 0], steps[0, 1], steps[1, 1] = of_before, of_schedule * np.sqrt(variance), 1.0
    carried, one = states(steps, np.array([0.0, 1.0]))
    found: Reals = carried / one
    return found
