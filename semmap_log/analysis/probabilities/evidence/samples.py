"""Evidence as methods take it that know of samples only: stretches as a sample each minute."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.day_tables import covered_ns
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.core.model.moments import SECOND_NS

Times = NDArray[np.int64]
Seconds = NDArray[np.float64]

SAMPLE_S = 60.0
"""The weight of a visit, against stretches in which the state is known throughout."""


@dataclass(frozen=True, slots=True)
class KnownTime:
    """How long a door was known, and open, up to any time; a visit counts as a minute."""

    start_ns: Times
    """(m,), of the stretches."""
    end_ns: Times
    is_open: NDArray[np.bool_]
    seen_ns: Times
    """(k,), of the visits."""
    reads_open: NDArray[np.bool_]
    _visits_open: NDArray[np.int64]
    """(k + 1,), visits that read open before each."""

    @classmethod
    def of(cls, evidence: DoorEvidence) -> KnownTime:
        """Return what is known of a door; the first sighting of a visit stands for it."""
        visits = evidence.is_visit
        reads_open = evidence.reads_open[visits]
        return cls(
            evidence.start_ns,
            evidence.end_ns,
            evidence.is_open,
            evidence.seen_ns[visits],
            reads_open,
            np.concatenate([[0], np.cumsum(reads_open)]),
        )

    @property
    def first_ns(self) -> int:
        """When the first of it begins; 0: there is none."""
        firsts = [int(times[0]) for times in (self.start_ns, self.seen_ns) if len(times)]
        return min(firsts, default=0)

    @property
    def last_ns(self) -> int:
        """When the last of it ends; 0: there is none."""
        lasts = [int(times[-1]) for times in (self.end_ns, self.seen_ns) if len(times)]
        return max(lasts, default=0)

    def until(self, times_ns: Times) -> tuple[Seconds, Seconds]:
        """Return (seconds open, seconds known) before or at each time."""
        starts, ends, is_open = self.start_ns, self.end_ns, self.is_open
        known_s = covered_ns(starts, ends, times_ns) / SECOND_NS
        open_s = covered_ns(starts[is_open], ends[is_open], times_ns) / SECOND_NS
        visit = np.searchsorted(self.seen_ns, times_ns, "right")
        return open_s + SAMPLE_S * self._visits_open[visit], known_s + SAMPLE_S * visit
