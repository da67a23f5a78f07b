"""When a door was looked at, and how long a sighting of it holds: pure numpy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.moments import HOUR_NS, SECOND_NS

REPEATS_NS = 60 * SECOND_NS
"""A sighting less than that after the one before is of the same pass."""
PASS_NS = 300 * SECOND_NS
"""A pass lasts at most this long: a robot that stays longer looks again."""
USUAL_GAP_NS = HOUR_NS
"""Taken as the gap between looks at a door that has fewer than `LEAST_GAPS`."""
LEAST_GAPS = 2


class Hold(NamedTuple):
    """How long a sighting of a door holds."""

    gaps: int
    """The log's setting: this many median gaps between looks."""
    gap_ns: int
    """The door's median gap; `USUAL_GAP_NS` where `looks` are too few."""
    looks: int
    """How many times the door was looked at."""

    @property
    def ns(self) -> int:
        """How long a sighting holds, nanoseconds."""
        return min(self.gaps * self.gap_ns, MAX_TIME_NS)

    @property
    def is_measured(self) -> bool:
        """False where the looks are too few for a median gap."""
        return self.looks > LEAST_GAPS


def hold_of(seen_ns: NDArray[np.int64], gaps: int) -> Hold:
    """Return how long a sighting of a door holds.

    A look is a pass, however many sightings it consists of; a gap is the time from the beginning of
    one look to the beginning of the next.

    Args:
        seen_ns: When the door was sighted, ascending.
        gaps: The log's setting.
    """
    looks_ns = seen_ns[pass_begins(seen_ns)]
    measured = len(looks_ns) > LEAST_GAPS
    gap_ns = _median(np.diff(looks_ns)) if measured else USUAL_GAP_NS
    return Hold(gaps, gap_ns, len(looks_ns))


def _median(values: NDArray[np.int64]) -> int:
    low, high = np.sort(values)[[(len(values) - 1) // 2, len(values) // 2]].tolist()
    return int(low + (high - low) // 2)


def pass_begins(
    seen_ns: NDArray[np.int64], is_parted: NDArray[np.bool_] | None = None
) -> NDArray[np.bool_]:
    """Tell which sightings begin a pass.

    Args:
        seen_ns: (k,), ascending where nothing parts them.
        is_parted: (k - 1,): whether a pass ends before the second, the third sighting, and so on.
    """
    begins = np.ones(len(seen_ns), np.bool_)
    begins[1:] = np.diff(seen_ns) >= REPEATS_NS
    if is_parted is not None:
        begins[1:] |= is_parted
    starts = np.flatnonzero(begins)
    ends = np.append(starts, len(begins))[1:]
    is_long = seen_ns[ends - 1] - seen_ns[starts] > PASS_NS
    for start, end in zip(starts[is_long].tolist(), ends[is_long].tolist(), strict=True):
        times = seen_ns[start:end]
        following = np.searchsorted(times, times + PASS_NS, "right").tolist()
        at = following[0]
        while at < len(following):
            begins[start + at] = True
            at = following[at]
    return begins
