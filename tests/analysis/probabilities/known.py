"""Evidence about a door as tests write it down: stretches and visits in hours."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.core.model.doors import DoorId

DOOR = DoorId(1)
HOUR_NS = 3600 * 10**9
MONDAY_NS = 4 * 24 * HOUR_NS
"""1970-01-05T00:00Z."""


def hours_ns(hours: object) -> np.ndarray:
    """Return hours since that Monday as instants."""
    return MONDAY_NS + np.round(np.asarray(hours, float) * HOUR_NS).astype(np.int64)


def evidence(
    stretches: Sequence[tuple[float, float, bool]] = (),
    visits: Sequence[tuple[float, bool]] = (),
) -> DoorEvidence:
    """Return evidence of (start, end, is open) and (time, reads open), hours since a Monday."""
    start, end, is_open = zip(*stretches, strict=True) if stretches else ((), (), ())
    seen, reads = zip(*visits, strict=True) if visits else ((), ())
    right = np.full(len(seen), 0.9)
    reads_open = np.array(reads, np.bool_)
    return DoorEvidence(
        DOOR,
        until_ns=2**62,
        start_ns=hours_ns(start),
        end_ns=hours_ns(end),
        is_open=np.array(is_open, np.bool_),
        seen_ns=hours_ns(seen),
        llr=np.where(reads_open, 1.0, -1.0) * np.log(9),
        accuracy_open=right,
        accuracy_closed=right,
        reads_open=reads_open,
        is_visit=np.ones(len(seen), np.bool_),
        visit=np.arange(len(seen)),
    )


def random_stretches(
    rng: np.random.Generator, hours: float, *, mean_h: float = 3.0, hole: float = 0.1
) -> list[tuple[float, float, bool]]:
    """Return stretches of whole minutes that alternate, some of them left out."""
    edges = np.cumsum(rng.exponential(mean_h, int(3 * hours / mean_h)))
    edges = np.unique(np.round(np.append(edges[edges < hours], [0.0, hours]) * 60)) / 60
    return [
        (start, end, bool(index % 2))
        for index, (start, end) in enumerate(pairwise(edges.tolist()))
        if rng.random() > hole
    ]
