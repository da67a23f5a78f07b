"""Why a log knows so little of a queried moment: the reports of it were recorded later.

Also what made a door's state what it was at a moment, by what was known at some time.
"""

from __future__ import annotations

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.early_events import remedy as remedy_of_early
from semmap_log.core.folds.explanation import StateReason
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.folds.timeline import timeline
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import Moment, Time, format_local
from semmap_log.log import DoorLog, Scope, Window

AT_ALONE = 'with all that is known today, ask --at "{then}" alone'
"""What to do about it when a map is requested; `{then}` is the moment."""


def recorded_later(
    log: DoorLog,
    at: Time,
    known_at: Time,
    *,
    door: DoorId | None = None,
    remedy: str = AT_ALONE,
) -> str:
    """Return why the log knows so little of the queried time, and what to do.

    Its reports of that time were recorded later, or are about doors that were added later; ""
    if neither is the case.

    Args:
        log: Whose doors.
        at: The queried moment.
        known_at: The queried state of knowledge; None: all is known.
        door: Only reports about it; None: about any door.
        remedy: What to do where it was recorded later; `{then}` in it is the moment.

    Raises:
        MomentError: A time cannot be read.
        LogError: There is no event of that number.
    """
    happened, known = log.moment(at), log.known_moment(known_at)
    moment_ns = query_moment_ns(log, happened, known)
    if known == Moment():
        return _note_of_early(log, moment_ns, door)
    window = Window(
        happened_before_ns=moment_ns + 1,
        recorded_from_ns=None if known.ns is None else known.ns + 1,
        first_event=None if known.event is None else known.event + 1,
    )
    batches = log.batches_in(window)
    if door is not None:
        batches = (batch.select(batch.of_doors([door])) for batch in batches)
    first = next((batch for batch in batches if len(batch)), None)
    if first is None:
        return ""
    recorded = format_local(int(first.recorded_ns[0]), log.info.timezone)
    then = format_local(moment_ns, log.info.timezone)
    return (
        f"What the log tells of that time was recorded later, from {recorded} on "
        f"(event {int(first.number[0])}), as by an import; {remedy.replace('{then}', then)}."
    )


def query_moment_ns(log: DoorLog, at: Moment, known_at: Moment) -> int:
    """Return the moment that a question is about: of `at`, else `known_at`, else the log's end.

    Raises:
        LogError: There is no event of that number.
    """
    if at != Moment():
        at_ns = log.instant(at)
        assert at_ns is not None
        return at_ns
    if known_at.event is not None:
        return log.event(known_at.event).recorded_ns
    return log.end_ns() if known_at.ns is None else known_at.ns


def _note_of_early(log: DoorLog, moment_ns: int, door: DoorId | None) -> str:
    early = log.early_events()
    if door is not None:
        early = early.of(door)
    if not early.counts or min(early.first_ns.values()) > moment_ns:
        return ""
    since = format_local(min(early.first_ns.values()), log.info.timezone)
    return f"{early.as_text(log.door_labels(), since)}; {remedy_of_early(log.path)}"


def state_reason(log: DoorLog, door_id: DoorId, scope: Scope) -> StateReason:
    """Return a door's state in a scope, and the events that made it so.

    Args:
        log: The log.
        door_id: The door.
        scope: Which events count.
    """
    state = log.state_in(scope)
    door = state.door(door_id)
    if door is None:
        gone = state.removed_door(door_id)
        if gone is None:
            return StateReason(None)
        entry = log.entry(gone.event)
        added_by = _setter(log, state, door_id, "added")
        return StateReason(None, True, entry.folds_ns, entry, entry, added_by)
    batches = log.visible_batches(scope, doors=[door_id])
    *_, interval = timeline(batches, door_id, end_ns=scope.at_ns)
    return StateReason(
        door,
        since_ns=interval.start_ns,
        begun_by=log.entry_or_state(interval.event),
        last=_setter(log, state, door_id, "state"),
        added_by=_setter(log, state, door_id, "added"),
        times_told=interval.sightings,
    )


def what_set(log: DoorLog, door_id: DoorId, scope: Scope) -> HistoryEntry | None:
    """Return the last event that set a door's state; None: nothing did.

    Args:
        log: The log.
        door_id: The door.
        scope: Which events count.
    """
    return _setter(log, log.state_in(scope), door_id, "state")


def _setter(
    log: DoorLog, state: DoorMapState, door_id: DoorId, register: str
) -> HistoryEntry | None:
    stamp = state.stamp(door_id, register)
    return None if stamp is None else log.entry_or_state(stamp[1])
