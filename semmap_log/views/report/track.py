"""Each robot's track, with as few points as it takes: a point every 25 cm is more than eyes see.

Between two points the robot went straight, at one speed; behind the last of a run it stands.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from semmap_log.views.report.page_events import Rows
from semmap_log.views.zone_times import MS_NS, Span

TOLERANCE_M = 0.3
"""So far at most a pose lies off the line that stands for it."""
ROUNDING_M = 0.2
"""What decimetres and tenths of seconds add to that, for a robot of 2 m/s."""
MOST_POINTS = 50_000
"""With more, the tolerance doubles."""
GAP_MS = 600_000
"""A robot unseen for longer did not drive the straight line between the two poses."""
TENTH_NS = 10**8
DM = 10


@dataclass(frozen=True, slots=True)
class DrawnTrack:
    """What the page draws of the robot's way."""

    runs: list[list[int]]
    """[level, then for each point tenths of seconds, x and y in decimetres]; each point but the
    first as the difference from the one before."""
    robots: list[int]
    """Of each run, the place of its robot among those that the log tells of."""
    within_m: float
    """So far at most a pose lies off it."""


def track_of(
    poses: Rows, span: Span, plans: Mapping[int, Sequence[int]] = MappingProxyType({})
) -> DrawnTrack:
    """Return the track of poses that are in the order of their times.

    Args:
        poses: Where robots were.
        span: What the page shows.
        plans: Level -> when it got another floor plan, ns: over that, nobody drove.
    """
    if not len(poses):
        return DrawnTrack([], [], TOLERANCE_M + ROUNDING_M)
    runs = _runs(poses, plans)
    tolerance_m = TOLERANCE_M
    while True:
        kept = [run[telling(run, tolerance_m)] for run in runs]
        if sum(map(len, kept)) <= max(MOST_POINTS, 2 * len(runs)):
            coded = [_coded(run, span) for run in kept]
            of = [int(run["robot"][0]) for run in kept]
            return DrawnTrack(coded, of, tolerance_m + ROUNDING_M)
        tolerance_m *= 2


def _runs(poses: Rows, plans: Mapping[int, Sequence[int]]) -> list[Rows]:
    """Cut where the level or its plan changes, or nothing was told for long; robot by robot."""
    poses = poses[np.argsort(poses["robot"], kind="stable")]
    jumps = np.diff(poses["robot"].astype(np.int32)) != 0
    jumps |= np.diff(poses["level"].astype(np.int32)) != 0
    jumps |= np.diff(poses["folds_ns"]) > GAP_MS * 10**6
    for begins in plans.values():
        jumps |= np.diff(np.searchsorted(begins, poses["folds_ns"], "right")) != 0
    return np.split(poses, np.flatnonzero(jumps) + 1)


def telling(run: Rows, tolerance_m: float) -> list[int]:
    """Return the places of the poses that a robot going straight through the others would miss.

    From a kept pose on, each further one allows some speeds, along x and along y; once the next
    lies outside of them, the one before it is kept. (A swing filter: Elmeleegy et al., VLDB 2009.)
    """
    times, ways = run["folds_ns"].tolist(), (run["x"].tolist(), run["y"].tolist())
    slack = tolerance_m / math.sqrt(2)  # of both directions together not more than the tolerance
    kept = [0]
    allowed = [[-math.inf, math.inf], [-math.inf, math.inf]]
    for i in range(1, len(times)):
        if not _fits(allowed, ways, times, kept[-1], i):
            kept.append(i - 1)
            allowed = [[-math.inf, math.inf], [-math.inf, math.inf]]
        ahead = times[i] - times[kept[-1]]
        for speeds, way in zip(allowed, ways, strict=True):
            rise = way[i] - way[kept[-1]]
            if ahead:
                speeds[0] = max(speeds[0], (rise - slack) / ahead)
                speeds[1] = min(speeds[1], (rise + slack) / ahead)
    if kept[-1] != len(times) - 1:
        kept.append(len(times) - 1)
    return kept


def _fits(
    allowed: list[list[float]], ways: tuple[list[float], list[float]], times: list[int],
    since: int, i: int,
) -> bool:  # fmt: skip
    ahead = times[i] - times[since]
    return (
        all(
            ahead > 0 and low * ahead <= way[i] - way[since] <= high * ahead
            for (low, high), way in zip(allowed, ways, strict=True)
        )
        or i == since + 1
    )


def _coded(run: Rows, span: Span) -> list[int]:
    columns = np.stack([
        (run["folds_ns"] - span.begin_ms * MS_NS) // TENTH_NS,
        np.rint(run["x"].astype(np.float64) * DM).astype(np.int64),
        np.rint(run["y"].astype(np.float64) * DM).astype(np.int64),
    ], -1)  # fmt: skip
    deltas = np.diff(columns, axis=0, prepend=np.zeros((1, 3), np.int64))
    return [int(run["level"][0]), *deltas.ravel().tolist()]
