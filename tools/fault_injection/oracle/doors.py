"""The doors of a moment, folded anew: each field is what the latest event said of it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol

Stamp = tuple[int, int]
"""(happened, number): the greater wins."""

POSE, WIDTH, STATE, PROB_OPEN, PROB_CLOSED = 1, 2, 4, 8, 16
FIELDS = {
    "level": POSE, "x": POSE, "y": POSE, "theta": POSE, "width": WIDTH, "state": STATE,
    "prob_open": PROB_OPEN, "prob_closed": PROB_CLOSED,
}  # fmt: skip
STATES = ("UNKNOWN", "OPEN", "CLOSED", "MOVING", "OFFLINE")
OPEN = 1


class Commit(Protocol):
    """Events that became known together."""

    @property
    def recorded_ns(self) -> int:
        """When."""

    @property
    def events(self) -> Iterable[dict[str, Any]]:
        """The events, by the names of their fields."""


class Log(Protocol):
    """What was ever recorded."""

    @property
    def commits(self) -> Iterable[Commit]:
        """In order."""


@dataclass
class _Door:
    fields: dict[str, tuple[Stamp, Any]] = field(default_factory=dict)
    texts: dict[str, tuple[Stamp, str]] = field(default_factory=dict)
    added: Stamp | None = None
    removed: Stamp | None = None
    last_event: int = -1

    def set(self, stamp: Stamp, values: dict[str, Any]) -> None:
        """Set what is not set later already."""
        for name, value in values.items():
            if name not in self.fields or stamp > self.fields[name][0]:
                self.fields[name] = (stamp, value)

    @property
    def is_here(self) -> bool:
        """Whether it was added, and not removed since."""
        return self.added is not None and (self.removed is None or self.removed < self.added)


def doors(
    log: Log, *, at: int | None = None, known_at: int | None = None, event: int | None = None
) -> dict[str, Any]:
    """Return the door map of a moment, as the log's own `replay --json` has it."""
    folded = _events(log, at, known_at, event)
    found: dict[int, _Door] = {}
    levels: dict[int, dict[str, tuple[Stamp, Any]]] = {}
    for one in folded:
        _fold(one, found, levels)
    named = {number: _value(level, "name") for number, level in levels.items()}
    return {
        "event": max((one["event"] for one in folded), default=None),
        "levels": [_level(number, level) for number, level in sorted(levels.items())],
        "doors": [
            _shown(number, door, named) for number, door in sorted(found.items()) if door.is_here
        ],
    }


def _events(
    log: Log, at: int | None, known_at: int | None, event: int | None
) -> list[dict[str, Any]]:
    """Return the events that count, retracted ones left out."""
    commits = [c for c in log.commits if known_at is None or c.recorded_ns <= known_at]
    known = [e for c in commits for e in c.events if event is None or e["event"] <= event]
    hidden = [(e["first_event"], e["last_event"]) for e in known if e["kind"] == "Retracted"]
    return [
        one
        for one in known
        if (at is None or stamp(one)[0] <= at)
        and (one["kind"] == "Retracted" or not any(a <= one["event"] <= b for a, b in hidden))
    ]


def stamp(event: dict[str, Any]) -> Stamp:
    """Return what an event is ordered by: it cannot have happened after it was recorded."""
    return min(event["happened"], event["recorded"]), event["event"]


def _fold(
    event: dict[str, Any],
    found: dict[int, _Door],
    levels: dict[int, dict[str, tuple[Stamp, Any]]],
) -> None:
    kind, when = event["kind"], stamp(event)
    if kind in {"LevelAdded", "FloorMap"}:
        level = levels.setdefault(event["level"], {})
        names = ("name", "elevation") if kind == "LevelAdded" else ("event",)
        for name in names:
            if name not in level or when > level[name][0]:
                level[name] = (when, event[name])
    if event.get("door_id") is None:
        return
    door = found.setdefault(event["door_id"], _Door())
    door.last_event = max(door.last_event, event["event"])
    if kind == "DoorAdded":
        door.added = max(door.added or when, when)
        door.set(when, {name: event[name] for name in FIELDS})
    elif kind == "DoorUpdated":
        changed = event["changed"]
        door.set(when, {name: event[name] for name, bit in FIELDS.items() if changed & bit})
    elif kind == "DoorRemoved":
        door.removed = max(door.removed or when, when)
    elif kind == "DoorObserved":
        door.set(when, {"state": event["state"]})
    elif kind == "DoorPassed" and event["passed"]:
        door.set(when, {"state": OPEN})
    elif kind == "DoorAnnotated":
        known = door.texts.get(event["key"])
        if known is None or when > known[0]:
            door.texts[event["key"]] = (when, event["value"])


def _level(number: int, level: dict[str, tuple[Stamp, Any]]) -> dict[str, Any]:
    return {
        "level": number,
        "name": _value(level, "name") or None,
        "elevation": _number(_value(level, "elevation")),
        "floor_map_event": _value(level, "event"),
    }


def _shown(number: int, door: _Door, levels: dict[int, Any]) -> dict[str, Any]:
    values = {name: value for name, (_, value) in door.fields.items()}
    added = door.added or (0, 0)
    texts = {k: v for k, (when, v) in sorted(door.texts.items()) if v and when > added}
    numbers = ("x", "y", "theta", "width", "prob_open", "prob_closed")
    return {
        "door_id": number,
        "name": texts.get("name"),
        "level": values["level"],
        "level_name": levels.get(values["level"]) or None,
        **{name: _number(values[name]) for name in numbers},
        "state": STATES[values["state"]] if values["state"] < len(STATES) else "UNKNOWN",
        "last_seen": door.fields["state"][0][0],
        "last_event": door.last_event,
        "annotations": texts,
    }


def _value(known: dict[str, tuple[Stamp, Any]], name: str) -> Any:
    return known[name][1] if name in known else None


def _number(value: Any) -> Any:
    return None if value is None or math.isnan(value) else value
