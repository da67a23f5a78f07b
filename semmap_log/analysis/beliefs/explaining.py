"""Explain from a log why a door was in a state at a moment.

import semmap_log as sl

told = sl.read("recordings/office").why("main_door", at="2026-03-02T10:30")
told.true.state, told.believed.state    # (OPEN, CLOSED)
told.taken_back.number                  # 58: what was believed rested on it
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from semmap_log.analysis.beliefs.door_beliefs import DoorBelief, probabilities
from semmap_log.analysis.recorded_later import query_moment_ns, state_reason
from semmap_log.core.folds.explanation import Explanation, NextChange, StateReason
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorPassed, DoorRequested
from semmap_log.core.model.moments import NEAR_NS, Moment, Time
from semmap_log.errors import UnknownDoorError
from semmap_log.log import DoorLog


def explain(
    log: DoorLog,
    door: DoorId | str,
    at: Time = None,
    known_at: Time = None,
    *,
    near_ns: int = NEAR_NS,
    progress: Progress | None = None,
) -> Explanation:
    """Return why a door was in a state.

    Args:
        log: The log.
        door: Its id, name, or level/name; a removed one, too.
        at: The moment; of an event, when it counts; default: the log's end.
        known_at: What had been recorded by then was known; default: by the moment itself. Without
            `at` it is the moment, too.
        near_ns: How long before and after the moment to list events that report another state;
            before it, at least back to the beginning of the state.
        progress: Called with the progress of reading.

    Raises:
        UnknownDoorError: There is no such door, and never was.
        MomentError: A time cannot be read.
        LogError: There is no event of that number.
    """
    door_id = log.resolve_any_door(door)
    when, known = log.moment(at), log.known_moment(known_at)
    time_ns, end_ns = query_moment_ns(log, when, known), log.end_ns()
    if known == Moment():
        known = when
    moment = Moment(ns=time_ns)
    limit = log.limit_of(log.scope(known_at=known))
    true = state_reason(log, door_id, log.scope(moment))
    knows_all = known == Moment()
    believed = true if knows_all else state_reason(log, door_id, log.scope(moment, known))
    begun_ns = time_ns if true.since_ns is None else true.since_ns
    earliest_ns = log.horizon_ns()  # what was before is no longer kept
    near = (
        max(earliest_ns, min(begun_ns, time_ns - near_ns)),
        min(time_ns + near_ns, max(time_ns, end_ns)),
    )
    otherwise = tuple(_otherwise(log, door_id, true.state, near))
    taken_back = _retracted(true, believed)
    return Explanation(
        door_id=door_id,
        label=log.door_labels().get(door_id, str(door_id)),
        time_ns=time_ns,
        known_ns=known.ns,
        known_event=limit,
        end_ns=end_ns,
        true=true,
        believed=believed,
        told_since=_recorded_since(true, believed, limit),
        taken_back=taken_back,
        otherwise=otherwise,
        otherwise_ns=near,
        retractions=_retractions(log, (taken_back, *otherwise)),
        belief=_belief(log, door_id, moment, known, progress),
        next=_next(log, door_id, time_ns),
    )


def _recorded_since(
    true: StateReason, believed: StateReason, limit: int | None
) -> HistoryEntry | None:
    """Return the event on which the truth rests, if it was not known then."""
    rests_on = [true.last, true.added_by if believed.door is None else None]
    late = (each for each in rests_on if each and limit is not None and each.number > limit)
    return next(late, None)


def _retracted(true: StateReason, believed: StateReason) -> HistoryEntry | None:
    """Return the event on which the belief rested, if it has been retracted."""
    rested_on = [believed.last, believed.added_by if true.door is None else None]
    return next((each for each in rested_on if each and each.retracted), None)


def _otherwise(
    log: DoorLog, door_id: DoorId, state: DoorState | None, span_ns: tuple[int, int]
) -> Iterator[HistoryEntry]:
    """Yield the events of a time, both ends included, that report another state."""
    if state is None:
        return
    found = log.history(door_id, Moment(ns=span_ns[0]), Moment(ns=span_ns[1] + 1))
    telling = (entry for entry in found if _speaks_against(entry, state))
    yield from sorted(telling, key=lambda entry: (entry.folds_ns, entry.number))


def _speaks_against(entry: HistoryEntry, state: DoorState) -> bool:
    match entry.event:
        case DoorRequested(state=wanted):
            return wanted is not state
        case DoorPassed(passed=False):
            return state is DoorState.OPEN
        case event:
            told = event.values_set().get("state", state)
            return told not in (state, DoorState.UNKNOWN)


def _retractions(log: DoorLog, entries: Iterable[HistoryEntry | None]) -> dict[int, HistoryEntry]:
    """Return the retractions of some of these events, by their numbers."""
    numbers = {each.retracted_by for each in entries if each is not None}
    return {number: log.entry(number) for number in numbers if number is not None}


def _belief(
    log: DoorLog, door_id: DoorId, at: Moment, known: Moment, progress: Progress | None
) -> DoorBelief | None:
    try:
        (found,) = probabilities(log, at=at, known_at=known, doors=[door_id], progress=progress)
    except UnknownDoorError:
        return None
    return found


def _next(log: DoorLog, door_id: DoorId, time_ns: int) -> NextChange | None:
    """Return the next change of a door after a moment: of its state, or its existence."""
    found = log.timeline(door_id, since=Moment(ns=time_ns))
    for interval in found:
        if interval.start_ns > time_ns:
            return NextChange(interval.start_ns, interval.state, log.entry(interval.event))
    gone = log.state_in().removed_door(door_id)
    if gone is None or int(found.end_ns.max(initial=0)) <= time_ns:
        return None
    entry = log.entry(gone.event)
    return NextChange(entry.folds_ns, None, entry)
