"""How much the errors of sensors add to the variance of what was read, as each midnight knew it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.day_tables import DayTables
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.evidence.stretches import covered_ns
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import HOUR_NS

Reals = NDArray[np.float64]


def noise_of(evidence: DoorEvidence, tables: DayTables, clock: LocalClock) -> Reals:
    """Return (rows,): the variance of what a known hour says of the door, by its readings' errors.

    A corrected reading (see `day_tables`) errs by a (1 - a) / J^2, and counts as J^2 of an hour;
    several in an hour err less than one, and still tell no more than that hour.

    Args:
        evidence: Of the door.
        tables: Its days.
        clock: Whose days.
    """
    first = evidence.is_visit
    day = tables.rows.row(clock.hour_of(evidence.seen_ns[first]) // 24)
    own = day < len(tables)
    when_open, when_closed = (
        evidence.accuracy_open[first][own],
        evidence.accuracy_closed[first][own],
    )
    errs = (when_open * (1 - when_open) + when_closed * (1 - when_closed)) / 2

    def so_far(of_days: NDArray[Any]) -> Reals:
        return np.append(0.0, np.cumsum(of_days))

    def by_day(of_visits: Reals) -> Reals:
        return so_far(np.bincount(day[own], of_visits, len(tables)))

    edges_ns = clock.midnights_ns(tables.rows.midnights)
    held_h = covered_ns(evidence.start_ns, evidence.end_ns, edges_ns) / HOUR_NS
    known_h = so_far(tables.known_h.sum(1))
    read_h = np.maximum(known_h - (held_h - held_h[0]), 0.0)
    told_h, visits = by_day((when_open + when_closed - 1) ** 2), by_day(np.ones(len(errs)))
    of_visit = by_day(errs) / np.maximum(visits, 1)
    of_hour = of_visit * np.minimum(1.0, read_h / np.maximum(told_h, 1e-9))
    found: Reals = of_hour * read_h / np.maximum(known_h, 1e-9)
    return found
