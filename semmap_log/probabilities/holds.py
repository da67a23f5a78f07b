"""When a state that was set is known to hold, and which sightings stand by themselves."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import DoorState
from semmap_log.events import MAX_TIME_NS
from semmap_log.moments import DAY_NS
from semmap_log.probabilities.words import Means, Rows

HOLDS_NS = 30 * DAY_NS
"""A state that was set is known for so long after the last word that agreed; silence that is
longer is a gap, and not "as before"."""


class Holds(NamedTuple):
    """What the words about a door mean."""

    start_ns: NDArray[np.int64]
    """(m,), ascending: when stretches begin in which the state is known; neighbours that touch
    are in different states."""
    end_ns: NDArray[np.int64]
    """(m,), > start: when they end, as far as these words tell."""
    is_open: NDArray[np.bool_]
    """(m,)."""
    points: NDArray[np.intp]
    """(k,), ascending: which words are sightings, OPEN or CLOSED, of no held state."""
    segment: NDArray[np.intp]
    """(k,), never falling: two points of different ones have a word between them that is no
    sighting of a state: a pass does not go on over it."""


def holds_of(words: Rows) -> Holds:
    """Return what words mean that are all about one door which is there all through.

    A state that was set is known from then on: until the next word that is not a sighting, until
    a sighting that disagrees, or `HOLDS_NS` after the last word that agreed. What `DoorAdded` says
    is only what somebody thought when he drew the map: any sighting takes its place. UNKNOWN,
    MOVING, OFFLINE, set or seen, and the removal, end it, and nothing is known.

    Args:
        words: In the order of the fold.
    """
    time_ns, means, state = words["time_ns"], words["means"], words["state"]
    tells = (state == DoorState.OPEN) | (state == DoorState.CLOSED)
    is_sighting = (means == Means.SEEN) & tells
    base = _last_true(~is_sighting)
    holds = tells[base] & (means[base] != Means.SEEN)
    disagrees = (state != state[base]) | (means[base] == Means.ADDED)
    lapsed = np.diff(time_ns, prepend=time_ns[:1]) > HOLDS_NS
    broken = np.cumsum(is_sighting & (disagrees | lapsed))
    agrees = holds & (broken == broken[base])
    points = np.flatnonzero(is_sighting & ~agrees)
    return Holds(*_stretches(words, base, agrees), points, base[points])


def _last_true(flags: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return for each place the last one up to it that is true; the first is."""
    return np.maximum.accumulate(np.where(flags, np.arange(len(flags)), 0))


def _stretches(
    words: Rows, base: NDArray[np.intp], agrees: NDArray[np.bool_]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return (start, end, is_open) of the stretches; touching ones of one state are joined."""
    time_ns = words["time_ns"]
    ends = _last_of_each(base, agrees)
    firsts = base[ends]
    start_ns, is_open = time_ns[firsts], words["state"][firsts] == DoorState.OPEN
    silent_ns = np.minimum(time_ns[ends], MAX_TIME_NS - HOLDS_NS) + HOLDS_NS
    next_ns = np.append(time_ns[1:], MAX_TIME_NS)[ends]
    end_ns = np.minimum(silent_ns, next_ns)
    lasts = end_ns > start_ns
    start_ns, end_ns, is_open = start_ns[lasts], end_ns[lasts], is_open[lasts]
    begins = np.ones(len(start_ns), np.bool_)
    begins[1:] = (start_ns[1:] > end_ns[:-1]) | (is_open[1:] != is_open[:-1])
    goes_on = np.append(~begins[1:], np.zeros(len(begins[:1]), np.bool_))
    return start_ns[begins], end_ns[~goes_on], is_open[begins]


def _last_of_each(base: NDArray[np.intp], agrees: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the last word that agrees with each state that was set."""
    agreeing = np.flatnonzero(agrees)
    is_last = np.ones(len(agreeing), np.bool_)
    is_last[:-1] = base[agreeing[1:]] != base[agreeing[:-1]]
    return agreeing[is_last]
