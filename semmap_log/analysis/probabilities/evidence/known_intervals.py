"""When a state that was set is known to hold, and which sightings stand by themselves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.reports import Rows
from semmap_log.core.folds.door_changes import are_sightings, of_presence
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.meaning import Presence
from semmap_log.core.model.moments import DAY_NS

HOLDS_NS = 30 * DAY_NS
"""A state that was set is known for so long after the last report that agreed; silence that is
longer is a gap, and not "as before"."""


class KnownIntervals(NamedTuple):
    """What the reports about a door mean."""

    start_ns: NDArray[np.int64]
    """(m,), ascending: when stretches begin in which the state is known. Two that touch are in
    different states, unless a sighting that disagreed lies between them."""
    end_ns: NDArray[np.int64]
    """(m,), > start: when they end, as far as these reports tell."""
    is_open: NDArray[np.bool_]
    """(m,)."""
    points: NDArray[np.intp]
    """(k,), ascending: which reports are sightings, OPEN or CLOSED, of no held state."""
    segment: NDArray[np.intp]
    """(k,), never falling: two points of different ones have a report between them that is no
    sighting of a state: a pass does not go on over it."""


def known_intervals(reports: Rows) -> KnownIntervals:
    """Return what reports mean that are all about one door which is there all through.

    A state that was set is known from then on: until the next report that is not a sighting, until
    a sighting that disagrees, or `HOLDS_NS` after the last report that agreed. What `DoorAdded`
    says is only what somebody thought when he drew the map: any sighting takes its place. UNKNOWN,
    MOVING, OFFLINE, set or seen, and the removal, end it, and nothing is known.

    Args:
        reports: In the order of the fold.
    """
    folds_ns, state = reports["folds_ns"], reports["state"]
    was_seen = are_sightings(reports)
    tells = (state == DoorState.OPEN) | (state == DoorState.CLOSED)
    is_sighting = was_seen & tells
    base = _last_true(~is_sighting)
    holds = tells[base] & ~was_seen[base]
    disagrees = (state != state[base]) | of_presence(reports, Presence.COMES)[base]
    lapsed = np.diff(folds_ns, prepend=folds_ns[:1]) > HOLDS_NS
    broken = np.cumsum(is_sighting & (disagrees | lapsed))
    agrees = holds & (broken == broken[base])
    is_point = is_sighting & ~agrees
    points = np.flatnonzero(is_point)
    stretches = _stretches(reports, base, agrees, np.cumsum(is_point))
    return KnownIntervals(*stretches, points, base[points])


def _last_true(flags: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return for each place the last one up to it that is true; the first is."""
    return np.maximum.accumulate(np.where(flags, np.arange(len(flags)), 0))


def _stretches(
    reports: Rows,
    base: NDArray[np.intp],
    agrees: NDArray[np.bool_],
    points_so_far: NDArray[np.intp],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return (start, end, is_open) of the stretches; touching ones of one state are joined."""
    folds_ns = reports["folds_ns"]
    last = _last_of_each(base, agrees)
    silent_ns = np.minimum(folds_ns[last], MAX_TIME_NS - HOLDS_NS) + HOLDS_NS
    end_ns = np.minimum(silent_ns, np.append(folds_ns[1:], MAX_TIME_NS)[last])
    has_length = end_ns > folds_ns[base[last]]
    last, end_ns = last[has_length], end_ns[has_length]
    first = base[last]
    start_ns, is_open = folds_ns[first], reports["state"][first] == DoorState.OPEN
    goes_on = (
        (start_ns[1:] == end_ns[:-1])
        & (is_open[1:] == is_open[:-1])
        & (points_so_far[first[1:]] == points_so_far[last[:-1]])
    )
    begins, ends = np.ones((2, len(first)), np.bool_)
    begins[1:], ends[:-1] = ~goes_on, ~goes_on
    return start_ns[begins], end_ns[ends], is_open[begins]


def _last_of_each(base: NDArray[np.intp], agrees: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the last report that agrees with each state that was set."""
    agreeing = np.flatnonzero(agrees)
    is_last = np.ones(len(agreeing), np.bool_)
    is_last[:-1] = base[agreeing[1:]] != base[agreeing[:-1]]
    return agreeing[is_last]
