"""How often a door was open when it was looked at, at such hours of such days."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.beta import beta_interval
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.evidence.samples import KnownTime
from semmap_log.core.folds.sighting_hold import REPEATS_NS
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import DAY_NS, HOUR_NS

REACH_H = 3.0
"""To both sides of the time of day."""
WORKDAYS = 5
BACK_NS = 28 * DAY_NS
"""What is older does not count."""


class LooksThen(NamedTuple):
    """Looks at a door at such hours: visits, and whole hours in which its state was known."""

    looks: int
    found_open: int

    @property
    def high(self) -> float:
        """The upper end of the 90 % interval of the share that is open; 1: there was no look.

        Jeffreys' interval: that of a Beta distribution, half a look more of each kind.
        """
        if not self.looks:
            return 1.0
        return _interval(self.found_open, self.looks)[1]


def looks_then(
    evidence: DoorEvidence, clock: LocalClock, *, time_ns: int, known_ns: int
) -> LooksThen:
    """Return the looks at a door at about that time of day, on working days or at weekends.

    Args:
        evidence: What is known of the door.
        clock: Whose hours and days.
        time_ns: That time.
        known_ns: Later looks do not count.
    """
    known = KnownTime.of(evidence.up_to(known_ns))
    # Of sightings that follow on each other the last one tells how the visit ended.
    ends = np.append(np.diff(known.seen_ns) >= REPEATS_NS, True)[: len(known.seen_ns)]
    in_stretches, are_open = _hours(known, known_ns)
    times_ns = np.concatenate([known.seen_ns[ends], in_stretches])
    is_open = np.concatenate([known.reads_open[ends], are_open])
    wall_h = clock.wall_s(np.append(times_ns, time_ns)) / 3600
    then_h, wall_h = wall_h[-1], wall_h[:-1]
    apart_h = np.abs((wall_h - then_h + 12) % 24 - 12)
    alike = _is_workday(wall_h) == _is_workday(then_h)
    counts = (apart_h <= REACH_H) & alike & (times_ns > known_ns - BACK_NS)
    return LooksThen(int(counts.sum()), int(is_open[counts].sum()))


def _hours(known: KnownTime, known_ns: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return a time for each hour in which the state was known all through, and that state."""
    times_ns = [np.empty(0, np.int64)]
    states = [np.empty(0, np.bool_)]
    for start, end, state in zip(
        known.start_ns.tolist(), known.end_ns.tolist(), known.is_open.tolist(), strict=True
    ):
        first = max(start, known_ns - BACK_NS)
        hours = np.arange(first + HOUR_NS // 2, end, HOUR_NS, dtype=np.int64)
        times_ns.append(hours)
        states.append(np.full(len(hours), state))
    return np.concatenate(times_ns), np.concatenate(states)


def _is_workday(wall_h: NDArray[np.float64]) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = wall_h // 24 % 7 < WORKDAYS
    return found


@lru_cache(4096)
def _interval(found_open: int, looks: int) -> tuple[float, float]:
    return beta_interval(found_open + 0.5, looks - found_open + 0.5)
