"""What is sent to a log, drawn from dice, in every way in which a log takes it."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

import semmap_log as sl
from fault_injection.oracle.doors import stamp
from fault_injection.trimming.whole_log import HOUR_NS, Row, WholeLog
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    PatrolStarted,
    Retracted,
    RobotPose,
)

ACTORS, KEYS = ("", "anna", "bert"), ("name", "kind", "rooms")
WAYS = ("append", "method", "line")
ALL_CHANGED = 31

_METHODS: dict[type[Event], Callable[..., Any]] = {
    DoorObserved: lambda log, e, **about: log.observe(
        e.door_id, e.state, accuracy_open=e.accuracy_open, accuracy_closed=e.accuracy_closed,
        **about,
    ),
    DoorAnnotated: lambda log, e, **about: log.annotate(e.door_id, e.key, e.value, **about),
    DoorRequested: lambda log, e, **about: log.request(e.door_id, e.state, **about),
    DoorPassed: lambda log, e, **about: log.passed(e.door_id, passed=e.passed, **about),
    DoorRemoved: lambda log, e, **about: log.remove_door(e.door_id, **about),
    Retracted: lambda log, e, **about: log.retract(e.first_event, e.last_event, **about),
}  # fmt: skip
"""What a program calls for an event; those of other kinds it appends."""


@dataclass(frozen=True)
class Command:
    """Events to be stored as one commit, and the way in which they are sent."""

    events: tuple[Event, ...]
    actor: str
    command_id: bytes | None
    way: str

    def send(self, log: sl.DoorLogWriter) -> int:
        """Send it by Python; return the number of its first event, as the log answers."""
        if self.way == "method" and type(self.events[0]) in _METHODS:
            about = {"actor": self.actor, "command_id": self.command_id}
            at = self.events[0].happened_ns
            call = _METHODS[type(self.events[0])]
            return int(call(log, self.events[0], at=at, **about).first_event)
        note = sl.Note(actor=self.actor)
        return log.append(self.events, note=note, command_id=self.command_id).commit.first_event

    def line(self) -> str:
        """Return it as `record` takes it."""
        (event,) = self.events
        said = {"kind": type(event).__name__, **_keys(event)}
        if self.actor:
            said["actor"] = self.actor
        if self.command_id is not None:
            said["command_id"] = self.command_id.hex()
        return json.dumps(said)

    def other(self) -> Command:
        """Return another command under the same id."""
        return Command((PatrolStarted(patrol=77),), self.actor, self.command_id, self.way)

    def rows(self) -> list[Row]:
        """Return what a log must hold of it, but for numbers and times that it gives."""
        return [_without_unset(row_of(event), event) for event in self.events]

    def __str__(self) -> str:
        said = "; ".join(repr(event) for event in self.events[:3])
        more = f" and {len(self.events) - 3} more" if len(self.events) > 3 else ""
        named = " with an id" if self.command_id else ""
        return f"{self.way}{named}: {said}{more}"


def row_of(event: Event) -> Row:
    """Return an event's kind and fields as plain values; when it happened only if it says so."""
    row: Row = {"kind": type(event).__name__}
    for one in fields(event):
        value = getattr(event, one.name)
        if one.name == "happened_ns":
            row |= {} if value is None else {"happened": value}
        elif one.name == "cells":
            row["cells"] = value.tobytes()
        elif one.name != "salt":
            row[one.name] = int(value) if isinstance(value, int) else value
    return row


_SET_BY = {"level": 1, "x": 1, "y": 1, "theta": 1, "width": 2, "state": 4, "prob_open": 8,
           "prob_closed": 16}  # fmt: skip
"""Field of a DoorUpdated -> its bit in `changed`."""


def _without_unset(said: dict[str, Any], event: Event) -> dict[str, Any]:
    """Return what an event says, without what means nothing."""
    if not isinstance(event, DoorUpdated):
        return said
    return {
        name: one for name, one in said.items() if event.changed & _SET_BY.get(name, ALL_CHANGED)
    }


def _keys(event: Event) -> dict[str, Any]:
    """Return an event's fields as the keys of a line, without those that say nothing."""
    said: dict[str, Any] = {}
    for one in fields(event):
        value = getattr(event, one.name)
        if one.name == "happened_ns":
            said |= {} if value is None else {"happened": value}
        elif isinstance(value, DoorState):
            said[one.name] = value.name
        elif one.name not in {"salt", "changed"} and not _is_nan(value):
            said[one.name] = value
    return _without_unset(said, event)


def _is_nan(value: object) -> bool:
    return isinstance(value, float) and math.isnan(value)


class Drawn:
    """Draws what a log has to take, since nothing in it forbids that."""

    def __init__(self, dice: random.Random, whole: WholeLog, now_ns: int) -> None:
        self.dice = dice
        self._whole = whole
        self._now_ns = now_ns
        self._here: list[int] = [door["door_id"] for door in whole.doors()["doors"]]

    def command(self, way: str, events: Sequence[Event] | None = None) -> Command:
        """Return a command of one event, or of several if they are appended."""
        count = self.dice.choice((1, 1, 2, 4)) if way == "append" else 1
        if events is None:
            events = [event for event in (self.event(way) for _ in range(count)) if event]
        command_id = self.dice.randbytes(16) if self.dice.random() < 0.4 else None
        is_pose = way == "line" and any(isinstance(event, RobotPose) for event in events)
        if is_pose and command_id is None:  # else it would wait for another
            command_id = self.dice.randbytes(16)
        return Command(tuple(events), self.dice.choice(ACTORS), command_id, way)

    def late(self, way: str) -> Command:
        """Return one that tells of what happened before something that is stored already."""
        rows = list(self._whole.thinned) if self.dice.random() < 0.5 else []
        row = self.dice.choice(rows or list(self._whole.rows.values()))
        when = max(1, stamp(row)[0] + self.dice.choice((-HOUR_NS, -1, 0, 0, 1, 1, 10**9, 10**11)))
        event = self.event(way, happened_ns=min(when, self._now_ns))
        return self.command(way, [event] if event else [])

    def event(self, way: str, happened_ns: int | None = None) -> Event | None:
        """Return an event; None: there is no door for it.

        Args:
            way: By which it is sent; lines are sent together, and so do not add or remove doors.
            happened_ns: When; None: mostly now.
        """
        dice = self.dice
        is_late = happened_ns is not None
        if happened_ns is None and dice.random() < 0.2:
            late = dice.choice((10**6, 10**9, 10**11, 2 * HOUR_NS))
            happened_ns = max(1, self._now_ns + dice.choice((-late, -late, -1, 0, 10**9)))
        kind = dice.choices(
            (DoorObserved, DoorUpdated, DoorPassed, DoorRequested, RobotPose, DoorAnnotated,
             PatrolStarted, LevelAdded, FloorMap, DoorAdded, DoorRemoved),
            (45, 9, 5, 4, 8, 9, 3, 2, 1, 3, 2),
        )[0]  # fmt: skip
        if kind in {DoorAdded, DoorRemoved, FloorMap, LevelAdded} and (way == "line" or is_late):
            kind = DoorObserved
        if kind is PatrolStarted:
            return PatrolStarted(patrol=dice.randint(1, 9), happened_ns=happened_ns)
        if kind is RobotPose:
            x = dice.randint(0, 9) / 4
            return RobotPose(x=x, y=1.0, theta=0.5, level=0, happened_ns=happened_ns)
        if kind is LevelAdded:
            return LevelAdded(level=0, name=dice.choice(("ground", "E0")), happened_ns=happened_ns)
        if kind is FloorMap:
            cells = np.full((1, 2), dice.randint(-1, 100), np.int8)
            return FloorMap(level=0, resolution=0.5, origin_x=0.0, origin_y=0.0, cells=cells,
                            happened_ns=happened_ns)  # fmt: skip
        if kind is DoorAdded:
            return self._new_door()
        if not self._here:
            return None
        door = DoorId(dice.choice(self._here))
        if kind is DoorRemoved:
            self._here.remove(door)
            return DoorRemoved(door_id=door)
        return self._about(kind, door, happened_ns)

    def _new_door(self) -> Event:
        used = [row["door_id"] for row in self._whole.rows.values() if "door_id" in row]
        door = DoorId(max([*used, *self._here], default=0) + 1)
        self._here.append(door)
        place: dict[str, Any] = {name: self.dice.randint(0, 3) / 2 for name in ("x", "y", "theta")}
        return DoorAdded(door_id=door, level=0, width=0.9, state=self._state(), **place)

    def _state(self) -> DoorState:
        return self.dice.choices(list(DoorState), (1, 12, 6, 1, 1))[0]

    def _about(self, kind: type[Event], door: DoorId, happened_ns: int | None) -> Event:
        dice = self.dice
        about: dict[str, Any] = {"door_id": door, "happened_ns": happened_ns}
        if kind is DoorUpdated:
            about |= {name: dice.randint(0, 3) / 2 for name in ("x", "y", "theta", "width")}
            changed = Changed(dice.choice((4, 4, 8, dice.randint(1, ALL_CHANGED))))
            return DoorUpdated(level=0, state=self._state(), prob_open=0.25, prob_closed=0.5,
                               changed=changed, **about)  # fmt: skip
        if kind is DoorPassed:
            return DoorPassed(passed=dice.random() < 0.5, **about)
        if kind is DoorRequested:
            return DoorRequested(state=self._state(), **about)
        if kind is DoorAnnotated:
            key, value = dice.choice(KEYS), dice.choice(("", "x", "y", f"z{dice.randint(0, 99)}"))
            value += f" of {door}" if key == "name" and value else ""  # no two have the same
            return DoorAnnotated(key=key, value=value, **about)
        return DoorObserved(state=self._state(), accuracy_open=0.9, accuracy_closed=0.8, **about)
