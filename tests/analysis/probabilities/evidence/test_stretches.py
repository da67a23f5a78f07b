"""How much of stretches lies before a time, against adding up one by one."""

from __future__ import annotations

import numpy as np

from semmap_log.analysis.probabilities.evidence.day_tables import covered_ns


def test_what_is_covered_is_what_lies_before() -> None:
    """Before, between, inside, at the edges of, and behind stretches, also of ones that touch."""
    start, end = np.array([10, 20, 30]), np.array([15, 30, 31])
    times = np.arange(0, 40)
    expected = [
        sum(max(0, min(t, e) - s) for s, e in zip(start.tolist(), end.tolist(), strict=True))
        for t in times.tolist()
    ]

    found = covered_ns(start, end, times)

    assert expected == found.tolist()
