"""Sightings that a thinning took out: the periods in which a door's history has gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import SightingsThinned

HOUR_NS = 3600 * 10**9
"""A run of sightings that repeat each other lies within one hour of UTC."""
MOST_OF_A_RUN = 4096
"""More than one sighting a second shows no more about a door."""

_COLUMNS = ("door_id", "state", "first_ns", "last_ns")


class ThinnedRun(NamedTuple):
    """Sightings of a door that followed each other, all of one state, and are gone."""

    door_id: int
    state: int
    first_ns: int
    """When the first of them happened; a sighting that stays came before it, in the same hour."""
    last_ns: int
    """When the last of them did; one that stays came after it."""


def sightings_of_runs(
    told: NDArray[np.void],
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return the sightings that were taken out, spread evenly over the time that their run took.

    A run lies within an hour and has at most `MOST_OF_A_RUN`, whatever a stranger's log says.

    Args:
        told: Rows of `SightingsThinned`.

    Returns:
        For each sighting, the row that it comes from, and when it happened.
    """
    counts = np.minimum(told["count"], MOST_OF_A_RUN).astype(np.intp)
    of_row = np.repeat(np.arange(len(told)), counts)
    within = np.arange(len(of_row)) - np.repeat(np.cumsum(counts) - counts, counts)
    span_ns = np.clip(told["last_ns"] - told["first_ns"], 0, HOUR_NS)[of_row]
    seen_ns = told["first_ns"][of_row] + span_ns * within // np.maximum(counts[of_row] - 1, 1)
    return of_row, seen_ns


class ThinnedRuns:
    """The runs of a log; fold all visible events in."""

    def __init__(self) -> None:
        self._parts: list[NDArray[np.void]] = []

    def apply(self, batch: EventBatch) -> None:
        """Fold a batch in."""
        if SightingsThinned in batch:
            self._parts.append(batch[SightingsThinned][list(_COLUMNS)])

    @property
    def until_ns(self) -> int:
        """When the last sighting that is gone happened; -1: none is."""
        return max((int(part["last_ns"].max()) for part in self._parts), default=-1)

    def around(self, door_id: int, at_ns: int) -> list[ThinnedRun]:
        """Return the runs of a door that may have begun by a moment, and had not ended then."""
        found = []
        for part in self._parts:
            begins = part["first_ns"] // HOUR_NS * HOUR_NS
            chosen = (part["door_id"] == door_id) & (begins <= at_ns) & (at_ns < part["last_ns"])
            found += [ThinnedRun(*row) for row in part[chosen].tolist()]
        return found
