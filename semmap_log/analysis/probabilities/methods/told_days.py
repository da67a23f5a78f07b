"""The days that a door's habits are learnt from, and what each midnight knew of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.day_tables import day_tables
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.core.model.local_clock import LocalClock

Times = NDArray[np.int64]


class ToldDays:
    """Whole days up to the last that tells something; a row for each midnight between them."""

    def __init__(
        self, evidence: DoorEvidence, clock: LocalClock, *, with_today: bool = False
    ) -> None:
        """Take the evidence about a door; `with_today`: the day that has not ended counts, too."""
        self._clock = clock
        until_ns = np.array([evidence.until_ns], np.int64)
        today = int(clock.hour_of(until_ns)[0]) // 24
        tables = day_tables(evidence, clock).before(today + with_today)
        tells = np.flatnonzero(tables.known_h.any(1)) + 1
        self.tables = tables.before(int(tables.rows.midnights[tells.max(initial=0)]))
        self.midnights = self.tables.rows.midnights
        """(rows,): the day that begins then."""
        self._told = np.zeros(len(self.midnights), np.int64)
        """(rows,): the row of the last day that tells something; through a gap nothing is learnt,
        and what is known grows old."""
        self._told[tells] = tells
        np.maximum.accumulate(self._told, out=self._told)

    def row(self, known_ns: Times) -> NDArray[np.int64]:
        """Return (n,): the row of what the last midnight before each time knew."""
        known_day = self._clock.hour_of(known_ns) // 24
        return self._told[np.maximum(np.searchsorted(self.midnights, known_day, "right") - 1, 0)]
