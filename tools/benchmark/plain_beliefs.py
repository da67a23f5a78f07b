"""What beliefs take in plain Python: a loop for each visit, each sighting, each minute.

`explained` is the forward algorithm as books write it down, one visit after another; `visits` and
`hour_of_week` are what somebody would write who counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

PASS_S, REPEATS_S = 300, 60

Sighting = tuple[int, int, bool, float, float]
"""Door, when (seconds), whether it read open, and P(it reads right) of open and closed doors."""


def explained(
    hours: Sequence[int],
    gaps_h: Sequence[float],
    llrs: Sequence[float],
    modes: Sequence[tuple[float, float]],
) -> list[float]:
    """Return the log-likelihood of visits in each mode, were each hour a door of its own.

    Args:
        hours: In which hour each visit's gap lies.
        gaps_h: Since the visit before.
        llrs: What each visit says.
        modes: P(open) in the long run, and how much an hour is forgotten.
    """
    sees = [1 / (1 + math.exp(-llr)) for llr in llrs]
    totals = []
    for share, per_h in modes:
        total, belief, last = 0.0, share, None
        for hour, gap_h, see in zip(hours, gaps_h, sees, strict=True):
            kept = math.exp(-per_h * gap_h) if hour == last else 0.0
            belief = share + kept * (belief - share)
            opened, closed = belief * see, (1 - belief) * (1 - see)
            total += math.log(opened + closed)
            belief, last = opened / (opened + closed), hour
        totals.append(total)
    return totals


def visits(sightings: Sequence[Sighting]) -> tuple[int, float]:
    """Return how many visits sightings make, and the sum of what these tell: their means."""
    by_door: dict[int, list[tuple[int, float]]] = {}
    for door, time_s, reads_open, right_open, right_closed in sightings:
        if reads_open:
            llr = math.log(right_open / (1 - right_closed))
        else:
            llr = math.log((1 - right_open) / right_closed)
        by_door.setdefault(door, []).append((time_s, llr))
    count, told = 0, 0.0
    for seen in by_door.values():
        for one in _passes(sorted(seen)):
            count += 1
            told += sum(one) / len(one)
    return count, told


def _passes(seen: Sequence[tuple[int, float]]) -> Iterator[list[float]]:
    begun_s, llrs = seen[0][0], [seen[0][1]]
    for (before_s, _), (time_s, llr) in pairwise(seen):
        if time_s - before_s >= REPEATS_S or time_s - begun_s > PASS_S:
            yield llrs
            begun_s, llrs = time_s, []
        llrs.append(llr)
    yield llrs
