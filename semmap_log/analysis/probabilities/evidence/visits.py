"""Sightings as visits: what a sensor says again and again in one pass is one proof, not many."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.sighting_hold import pass_begins

LEAST_ACCURACY, MOST_ACCURACY = 0.5, 0.999
"""What a sensor's accuracies count as; no reading proves more."""

_FINE = 2.0**32
"""Sums are of whole parts of a nat, so that they do not depend on what else is summed up."""


class Visits(NamedTuple):
    """Which visit each sighting belongs to, and what it adds."""

    visit: NDArray[np.intp]
    """(k,), counted from 0 in the order in which they begin."""
    llr: NDArray[np.float64]
    """(k,), nats: sightings of a visit add up, at each of them, to the mean of those so far."""


def llr_of(
    reads_open: NDArray[np.bool_],
    accuracy_open: NDArray[np.float64],
    accuracy_closed: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return log P(reading | open) / P(reading | closed) of readings by themselves, in nats."""
    when_open = np.clip(accuracy_open, LEAST_ACCURACY, MOST_ACCURACY)
    when_closed = np.clip(accuracy_closed, LEAST_ACCURACY, MOST_ACCURACY)
    return np.where(
        reads_open,
        np.log(when_open / (1 - when_closed)),
        np.log((1 - when_open) / when_closed),
    )


def visits_of(
    seen_ns: NDArray[np.int64],
    sensor: NDArray[np.integer[Any]],
    segment: NDArray[np.intp],
    llr: NDArray[np.float64],
) -> Visits:
    """Return the visits that sightings of one door make.

    Args:
        seen_ns: (k,), ascending.
        sensor: (k,): what looked; sightings of different ones belong to different visits, however
            they mix.
        segment: (k,), never falling: a visit lies in one of them.
        llr: (k,): what each would say by itself.
    """
    order = np.argsort(sensor, kind="stable")
    first = _firsts(seen_ns[order], sensor[order], segment[order])
    added = np.empty(len(llr))
    added[order] = _added(llr[order], first)
    is_first = first == np.arange(len(first))
    # Passes come sensor by sensor here; they are counted by when they began.
    begins = np.zeros(len(first), np.bool_)
    begins[order[is_first]] = True
    visit = np.empty(len(first), np.intp)
    visit[order] = (np.cumsum(begins) - 1)[order[first]]
    return Visits(visit, added)


def _firsts(
    seen_ns: NDArray[np.int64], sensor: NDArray[np.integer[Any]], segment: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return the place of the first sighting of each one's pass; sensor by sensor."""
    is_parted = (np.diff(segment) != 0) | (sensor[1:] != sensor[:-1])
    begins = pass_begins(seen_ns, is_parted)
    return np.maximum.accumulate(np.where(begins, np.arange(len(begins)), 0))


def _added(llr: NDArray[np.float64], first: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return by how much each sighting moves the mean of its pass."""
    place = np.arange(len(llr))
    fine = np.rint(llr * _FINE).astype(np.int64)
    total = np.cumsum(fine)
    mean = (total - total[first] + fine[first]) / (place - first + 1) / _FINE
    return np.where(place == first, llr, mean - np.append(0.0, mean[:-1]))
