"""On what a belief about a door rests, in numbers."""

from __future__ import annotations

import numpy as np

from semmap_log.analysis.probabilities.evidence.coverage import Coverage
from semmap_log.analysis.probabilities.evidence.evidence import Counts, DoorEvidence
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.local_clock import LocalClock


@dataclass(frozen=True, slots=True)
class EvidenceSummary:
    """What a belief rests on."""

    coverage: Coverage
    """On which hours of the week the evidence lies."""
    known_ns: int
    """For how long its state was known without a look, since it had been set."""
    counts: Counts
    """Words about its state, sightings among them, visits, and when it was last seen."""

    @classmethod
    def of(cls, evidence: DoorEvidence, counts: Counts, clock: LocalClock) -> EvidenceSummary:
        """Return the evidence about a door in numbers."""
        known_ns = int(np.sum(evidence.end_ns - evidence.start_ns))
        return cls(Coverage.of(evidence, clock), known_ns, counts)

    @property
    def is_empty(self) -> bool:
        """True for a door of which nobody ever said whether it is open."""
        return self.counts.last_seen_ns is None
