"""What made a door's state what it was at a moment, by what was known at some time."""

from __future__ import annotations

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.folds.timeline import timeline
from semmap_log.core.model.doors import DoorId
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.door_log.explanation import StateReason
from semmap_log.log.replay.replay import Scope


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
