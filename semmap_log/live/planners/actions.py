"""What planners want done: each action one commit, and T once it lasts."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorMap, DoorState
from semmap_log.core.model.events import DoorRemoved, DoorUpdated, Event
from semmap_log.core.model.meaning import Changed
from semmap_log.errors import CommandError
from semmap_log.live.planners.asked import AskedQuestion
from semmap_log.live.planners.door_view import DoorView
from semmap_log.live.ros.serving.door_server import when_ns
from semmap_log.log.door_log.door_commands import content_of
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.door_log.door_log_writer import DoorLogWriter

ACTOR = "planner"


class AskedDoors(Protocol):
    """The doors that planners ask about: a `DoorServer`, or a `DoorFollower`."""

    @property
    def log(self) -> DoorLog:
        """The log, with all that is written now."""

    def door_map(self) -> DoorMap:
        """Return the doors as they are now."""

    def append(
        self,
        make: Callable[[DoorLogWriter], list[Event]],
        *,
        note: Note,
        command_id: bytes,
        content: bytes,
    ) -> int | None:
        """Append what `make` gives, once, as one commit that lasts."""


def act(doors: AskedDoors, asked: AskedQuestion, client: str = "") -> None:
    """Do what is asked; it lasts, as the log's durability promises, when this returns.

    What the map is already needs no event. With a command id one is stored all the same: sent
    again, later, the command must be known.

    Args:
        doors: Of the log.
        asked: An action.
        client: Who asks, for the note.

    Raises:
        SemmapError: It is not done, or nobody knows; the message says why.
    """
    name = asked.question.name
    given = asked.command_id
    note = Note(
        actor=ACTOR,
        source=f"{name} from {client}" if client else name,
        correlation="" if given is None else given.hex(),
    )
    doors.append(
        lambda log: _events(log, asked),
        note=note,
        command_id=os.urandom(16) if given is None else given,
        content=content_of(name, asked.doors, asked.number),
    )


def _events(log: DoorLogWriter, asked: AskedQuestion) -> list[Event]:
    """Return what an action means for the log as it stands; the log is held meanwhile."""
    door = DoorView(log.door_map()).door(asked.doors[0])
    happened_ns = when_ns(log)
    if asked.question.name == "REMOVE_DOOR":
        return [DoorRemoved(door_id=door.door_id, happened_ns=happened_ns)]
    changed, field, value = _set_by(asked)
    if getattr(door, field) == value and asked.command_id is None:
        return []
    values: dict[str, Any] = {field: value}
    return [
        DoorUpdated(
            door_id=door.door_id,
            changed=changed,
            level=door.level,
            happened_ns=happened_ns,
            **values,
        )
    ]


def _set_by(asked: AskedQuestion) -> tuple[Changed, str, DoorState | float]:
    """Return the part of a door that an action sets, its field, and what it becomes.

    Raises:
        CommandError: A probability that is none.
    """
    changed, field, value = _SETS[asked.question.name]
    if value is not None:
        return changed, field, value
    if not 0 <= asked.number <= 1:  # neither is NaN
        raise CommandError(f"expected a probability from 0 to 1, got {asked.number!r}.")
    return changed, field, asked.number


_SETS: Mapping[str, tuple[Changed, str, DoorState | None]] = {
    "SET_DOOR_OPEN": (Changed.STATE, "state", DoorState.OPEN),
    "SET_DOOR_CLOSED": (Changed.STATE, "state", DoorState.CLOSED),
    "SET_OPEN_PROBABILITY": (Changed.PROB_OPEN, "prob_open", None),
    "SET_CLOSED_PROBABILITY": (Changed.PROB_CLOSED, "prob_closed", None),
}
"""Action -> part, field and value; None: the number that is asked for."""
