"""A sensor's readings as visits, and three in a row of one visit, which show how it errs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.visits import Rows
from semmap_log.core.batches.event_batch import placed
from semmap_log.core.folds.timeline import PASS_NS, REPEATS_NS
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import HOUR_NS

Reals = NDArray[np.float64]
Flags = NDArray[np.bool_]

STEADY = 0.8
"""Hours count in which so many visits, between two that agree on a state, agree with them."""
FEW_BY_CHANCE = 4
"""So many disagreeing visits are added: a few of a restless door may agree by chance."""
FEWEST_OF_HOURS = 20
"""Some hours of a door with fewer occasions do not count."""
UNITS = 6
"""Parts of a day."""


class SensorVisits(NamedTuple):
    """Visits of one sensor, door by door, in order of time."""

    visit: NDArray[np.intp]
    """(readings,): which visit each belongs to."""
    place: NDArray[np.intp]
    """(readings,): which of its visit's readings each is."""
    door_id: NDArray[np.uint32]
    """(visits,)."""
    readings: NDArray[np.intp]
    """(visits,): how many."""
    share: Reals
    """(visits,): of its readings, those that say open."""

    @classmethod
    def of(cls, rows: Rows) -> SensorVisits:
        """Return the visits that readings make, which are by door, then in order."""
        times_ns, doors = rows["folds_ns"], rows["door_id"]
        begins = np.ones(len(rows), np.bool_)
        begins[1:] = (np.diff(times_ns) >= REPEATS_NS) | (doors[1:] != doors[:-1])
        first = np.flatnonzero(begins)
        visit = np.cumsum(begins) - 1
        # Who stays longer than a pass looks again.
        part = (times_ns - times_ns[first][visit]) // PASS_NS
        begins[1:] |= np.diff(part) != 0
        first, visit = np.flatnonzero(begins), np.cumsum(begins) - 1
        count = np.bincount(visit)
        share = np.bincount(visit, rows["state"] == DoorState.OPEN) / count
        return cls(visit, np.arange(len(rows)) - first[visit], doors[first], count, share)


class Triples(NamedTuple):
    """Three readings in a row of a visit, where the visits before and after agree on a state.

    A row of the counts is a unit: a door at some hours of the day.
    """

    door_id: NDArray[np.uint32]
    """(units,)."""
    both: NDArray[np.int64]
    """(units,): the outer two say that state."""
    others: NDArray[np.int64]
    """(units,): the outer two say the other one."""
    odd: NDArray[np.int64]
    """(units,): the outer two say it, and the middle one does not."""
    edge: NDArray[np.int64]
    """(units,): the middle one and only one of the outer two say it."""

    @classmethod
    def of(cls, rows: Rows, visits: SensorVisits, *, is_open: bool) -> Triples:
        """Return the counts of those where the visits around agree on open, or on closed."""
        said = visits.share if is_open else 1 - visits.share
        quiet = np.zeros(len(said), np.bool_)
        quiet[1:-1] = (said[:-2] > 0.5) & (said[2:] > 0.5)
        quiet[1:-1] &= visits.door_id[:-2] == visits.door_id[2:]
        here = quiet[visits.visit] & (visits.place % 3 == 0)
        start = np.flatnonzero(here & (visits.place + 2 < visits.readings[visits.visit]))
        says = (rows["state"] == DoorState.OPEN) == is_open
        first, middle, last = says[start], says[start + 1], says[start + 2]
        unit = rows["door_id"][start].astype(np.int64) * UNITS + _unit(rows["folds_ns"][start])
        units, place = placed(unit)

        def count(chosen: Flags) -> NDArray[np.int64]:
            return np.bincount(place[chosen], minlength=len(units))

        return cls(
            (units // UNITS).astype(np.uint32),
            both=count(first & last),
            others=count(~first & ~last),
            odd=count(first & ~middle & last),
            edge=count((first != last) & middle),
        )

    @property
    def usable(self) -> Flags:
        """(units,): where the door stays as it is for long; else it may move while it is seen."""
        occasions = self.both + self.others + FEW_BY_CHANCE
        return (self.both >= FEWEST_OF_HOURS) & (self.both >= STEADY * occasions)

    def only(self, chosen: Flags) -> Triples:
        """Return some of the units."""
        return Triples(
            self.door_id[chosen],
            self.both[chosen],
            self.others[chosen],
            self.odd[chosen],
            self.edge[chosen],
        )


def _unit(times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return which part of the day times lie in."""
    return times_ns // (24 * HOUR_NS // UNITS) % UNITS
