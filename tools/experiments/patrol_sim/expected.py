"""The state of a recording at a moment, folded by hand from the journal: no part of the product.

It reads the rules of the log's design once more, in dictionaries, so that a replay of the
recording has something to agree with that was made without it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Any

from patrol_sim.journal import Entry
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
    Retracted,
)

State = dict[str, Any]
"""A door in the form of `replay --json`."""


@dataclass(frozen=True, slots=True)
class Moment:
    """Which state is asked for; None: no limit."""

    about: str
    """Why this moment is worth a look."""
    at_ns: int | None = None
    known_at_ns: int | None = None
    event: int | None = None


def expected_json(journal: Sequence[Entry], moments: Iterable[Moment]) -> str:
    """Return the states at those moments as a JSON text, one door a line."""
    told = []
    for moment in moments:
        head = {
            "about": moment.about,
            "at": iso(moment.at_ns),
            "known_at": iso(moment.known_at_ns),
            "event": moment.event,
        }
        lines = ",\n".join(f"  {json.dumps(door)}" for door in doors_at(journal, moment))
        told.append(f'{json.dumps(head)[:-1]}, "doors": [\n{lines}\n]}}')
    return "[\n" + ",\n".join(told) + "\n]\n"


def doors_at(journal: Sequence[Entry], moment: Moment) -> list[State]:
    """Return the doors in the map at that moment, ids ascending."""
    known = [
        (number, recorded_ns, event)
        for number, recorded_ns, event in _numbered(journal)
        if (moment.known_at_ns is None or recorded_ns <= moment.known_at_ns)
        and (moment.event is None or number <= moment.event)
    ]
    hidden = {
        number
        for _, _, event in known
        if isinstance(event, Retracted)
        for number in range(event.first_event, event.last_event + 1)
    }
    doors: dict[int, State] = {}
    # Nothing counts as having happened after it was recorded.
    stamped = [(min(_happened(event), at_ns), number, event) for number, at_ns, event in known]
    for when, number, event in sorted(stamped, key=lambda item: item[:2]):
        if number not in hidden and (moment.at_ns is None or when <= moment.at_ns):
            _apply(doors, when, event)
    return [doors[door_id] for door_id in sorted(doors)]


def _numbered(journal: Sequence[Entry]) -> Iterator[tuple[int, int, Event]]:
    number = 0
    for entry in journal:
        for event in entry.events:
            yield number, entry.recorded_ns, event
            number += 1


def _happened(event: Event) -> int:
    assert event.happened_ns is not None
    return event.happened_ns


def _apply(doors: dict[int, State], when: int, event: Event) -> None:
    """Let an event change the doors, as the rules say; most kinds change none."""
    match event:
        case DoorAdded():
            doors[event.door_id] = {
                "door_id": event.door_id, "name": None, "level": event.level,
                "x": event.x, "y": event.y, "theta": event.theta, "width": event.width,
                "state": event.state.name, "prob_open": _number(event.prob_open),
                "prob_closed": _number(event.prob_closed), "last_seen": iso(when),
            }  # fmt: skip
        case DoorUpdated() if event.door_id in doors:
            _update(doors[event.door_id], when, event)
        case DoorRemoved():
            doors.pop(event.door_id, None)
        case DoorObserved() if event.door_id in doors:
            doors[event.door_id].update(state=event.state.name, last_seen=iso(when))
        case DoorPassed() if event.passed and event.door_id in doors:
            doors[event.door_id].update(state=DoorState.OPEN.name, last_seen=iso(when))
        case DoorAnnotated(key="name") if event.door_id in doors:
            doors[event.door_id]["name"] = event.value


def _update(door: State, when: int, event: DoorUpdated) -> None:
    if event.changed & Changed.POSE:
        door.update(level=event.level, x=event.x, y=event.y, theta=event.theta)
    if event.changed & Changed.WIDTH:
        door.update(width=event.width)
    if event.changed & Changed.STATE:
        door.update(state=event.state.name, last_seen=iso(when))
    if event.changed & Changed.PROB_OPEN:
        door.update(prob_open=_number(event.prob_open))
    if event.changed & Changed.PROB_CLOSED:
        door.update(prob_closed=_number(event.prob_closed))


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value


def iso(moment_ns: int | None) -> str | None:
    """Return the moment as ISO-8601, UTC, nanoseconds."""
    if moment_ns is None:
        return None
    seconds, rest_ns = divmod(moment_ns, 10**9)
    return f"{datetime.fromtimestamp(seconds, timezone.utc):%Y-%m-%dT%H:%M:%S}.{rest_ns:09d}Z"
