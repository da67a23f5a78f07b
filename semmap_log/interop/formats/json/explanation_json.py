"""Why a door was in a state, as the JSON that `why` prints."""

from __future__ import annotations

from typing import Any

from semmap_log.analysis.beliefs.door_beliefs import DoorBelief
from semmap_log.core.folds.explanation import Explanation, StateReason
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.model.moments import format_utc
from semmap_log.interop.formats.json.beliefs_json import belief_to_json
from semmap_log.interop.formats.json.door_json import entry_to_json


def explanation_to_json(told: Explanation) -> dict[str, Any]:
    """Return all of it: events as `history` has them, P(open) as `probabilities` has it.

    `true` is by all that is known today, `believed` by what was recorded by `known_at`, up to
    `known_event` (-1: nothing was; null: all was).
    """
    first, last = told.otherwise_ns
    belief, following = told.belief, told.next
    door = told.true.door or told.believed.door
    return {
        "door_id": told.door_id,
        "name": told.label if door is None else door.name,
        "at": format_utc(told.time_ns),
        "known_at": None if told.known_ns is None else format_utc(told.known_ns),
        "known_event": told.known_event,
        "end": format_utc(told.end_ns),
        "agrees": told.agrees,
        "true": _reason(told.true),
        "believed": _reason(told.believed),
        "told_since": _entry(told.told_since),
        "taken_back": _entry(told.taken_back),
        "otherwise": {
            "since": format_utc(first),
            "until": format_utc(last),
            "events": [_entry(entry) for entry in told.otherwise],
        },
        "retractions": [_entry(entry) for _, entry in sorted(told.retractions.items())],
        "belief": belief_to_json(belief) if isinstance(belief, DoorBelief) else None,
        "next": None
        if following is None
        else {
            "at": format_utc(following.time_ns),
            "state": None if following.state is None else following.state.name,
            "event": _entry(following.entry),
        },
    }


def _reason(known: StateReason) -> dict[str, Any]:
    return {
        "in_map": known.door is not None,
        "removed": known.is_removed,
        "state": None if known.state is None else known.state.name,
        "since": None if known.since_ns is None else format_utc(known.since_ns),
        "times_told": known.times_told,
        "begun_by": _entry(known.begun_by),
        "last": _entry(known.last),
    }


def _entry(entry: HistoryEntry | None) -> dict[str, Any] | None:
    if entry is None:
        return None
    return {**entry_to_json(entry), "retracted_by": entry.retracted_by}
