"""The schema: what each column of a table of events means. Data only; nothing is imported for it.

One row an event, in the order of event numbers; every kind's fields side by side, under the names
that they have in the events; null where a kind has no such field, or a value was not given. What a
DoorUpdated does not set is null, too. Dictionaries are the same in every table.

An event counts from `happened`, but from `recorded` where that is earlier (its clock was wrong):
events sorted by (least(happened, recorded), event) are the order of the fold.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.messages import comments_of
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import KINDS, Event, field_names, told_fields
from semmap_log.core.model.meaning import ALL_CHANGED, Changed
from semmap_log.core.model.rules import Bits, Nanoseconds, OneOf, Rule, Text

SCHEMA_VERSION = 1
"""Counts up when a column changes its meaning or goes; a new column does not."""

TIME = "timestamp[ns, UTC]"
KIND, STATE, CHANGED = "kind", "state", "changed"
CELLS = "list<int8>"
TEXT = "text"
"""The types that are not numpy's own names; `KIND`, `STATE` and `CHANGED` are dictionaries, and so
is `TEXT`, a text that many rows share."""

KIND_NAMES = tuple(kind.__name__ for kind in KINDS)
STATE_NAMES = tuple(state.name for state in DoorState)
CHANGED_NAMES = tuple(
    "|".join(bit.name or "" for bit in Changed if bit & changed)
    for changed in range(1, int(ALL_CHANGED) + 1)
)
"""Of each sum of bits from 1 on, such as `POSE|STATE`."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of the table."""

    name: str
    type: str
    """A numpy name, `str`, or one of the types above."""
    says: str
    """What it means, with its unit."""
    field: str = ""
    """The field of the events that it holds, where that has another name."""
    nullable: bool = True

    @property
    def field_name(self) -> str:
        """The field of the events that it holds."""
        return self.field or self.name

    @property
    def kinds(self) -> tuple[int, ...]:
        """The numbers of the kinds that have such a field."""
        return tuple(kind.kind for kind in KINDS if self.field_name in field_names(kind))


HEAD = (
    Column("event", "int64", "event number, from 0 without gaps", nullable=False),
    Column("kind", KIND, "kind of event, such as DoorObserved", nullable=False),
)

WHEN = (
    Column("happened", TIME, "when it happened, as given", nullable=False),
    Column("recorded", TIME, "when the log learnt it, strictly increasing", nullable=False),
)

MEANINGS: Mapping[str, str] = {
    "level": "storey of the door, the robot or the floor map; 0 without levels",
    "x": "start of the door's line, or the robot, m, frame map",
    "y": "the same",
    "theta": "direction of the door's line, or of the robot, rad",
    "width": "length of the door's line, m",
    "state": "OPEN CLOSED UNKNOWN MOVING OFFLINE: set, seen or asked for",
    "prob_open": "P(open) that was set, 0..1",
    "prob_closed": "P(closed) that was set, 0..1",
    "changed": "DoorUpdated: what it sets, such as POSE|STATE; POSE is with level",
    "accuracy_open": "DoorObserved: P(reads open when open), 0.5..1",
    "accuracy_closed": "DoorObserved: P(reads closed when closed), 0.5..1",
    "opening": "DoorObserved: how far it stood open, 0..1",
    "passed": "DoorPassed: the robot went through; false: it gave up",
    "waited_s": "DoorPassed: how long it waited before the door, s",
    "patrol": "PatrolStarted, PatrolFinished: the round's number",
    "sd_xy": "RobotPose: standard deviation of x and y, m",
    "sd_theta": "RobotPose: standard deviation of theta, rad",
    "first_event": "Retracted: the first event that it takes back",
    "last_event": "Retracted: the last one, inclusive",
    "key": "DoorAnnotated: what is said, such as name",
    "value": "DoorAnnotated: in words; empty: taken back",
    "name": "LevelAdded: the storey's name",
    "elevation": "LevelAdded: above the building's zero, m",
    "resolution": "FloorMap: size of a cell, m",
    "origin_x": "FloorMap: lower left corner of cell (0, 0), m, frame map",
    "origin_y": "the same",
    "origin_theta": "FloorMap: how the grid is turned, rad",
    "cells": "FloorMap: row by row, lowest y first; 0 free..100 occupied, -1 unknown",
    "format": "LogExported: of the file",
    "file_name": "LogExported: of the file",
    "at_ns": "LogExported: the moment whose state was saved",
}
"""Fields of events, in the order of their columns, and what they mean; those that came later have
the words of the `.msg` text behind these."""

OF_CELLS = (
    Column("cells_width", "uint32", "FloorMap: cells in a row", field="cells"),
    Column("cells_height", "uint32", "FloorMap: rows", field="cells"),
    Column("cells", CELLS, MEANINGS["cells"]),
)
"""What a grid becomes."""


def _rules() -> dict[str, tuple[type[Event], Rule]]:
    """Return each field of events, with the first kind that has it, and its rule there."""
    found: dict[str, tuple[type[Event], Rule]] = {}
    for kind in KINDS:
        for name in told_fields(kind):
            found.setdefault(name, (kind, kind.rules.fields[name]))
    return found


def _fields() -> Iterator[Column]:
    """Yield a column for each field that the events of any kind have."""
    rules = _rules()
    for name in dict.fromkeys([*MEANINGS, *rules]):
        kind, rule = rules[name]
        if name == "cells":
            yield from OF_CELLS
        elif name != "door_id":
            says = MEANINGS.get(name) or comments_of(kind.__name__)[name]
            ours = name.removesuffix("_ns") if isinstance(rule, Nanoseconds) else name
            yield Column(ours, _type_of(rule), says, field=name if ours != name else "")


def _type_of(rule: Rule) -> str:
    """Return the type of a field's column."""
    return _TYPES.get(type(rule)) or str(np.dtype(rule.dtype))


_TYPES = {OneOf: STATE, Bits: CHANGED, Nanoseconds: TIME, Text: "str"}
"""Rule of a field -> the type of its column, where that is another than in numpy."""

FIELDS = tuple(_fields())
"""The fields of all kinds."""

DOOR = Column("door_id", "uint32", "the door that it is about")

COLUMNS = (*HEAD, DOOR, *WHEN, *FIELDS)
"""Of `EventBatch.to_arrow()`, in order."""

THEN = (
    Column("door_name", TEXT, "what the door was called then, by what is known now"),
    Column("level_name", TEXT, "storey it, the robot or the map was on then: name, else number"),
)
"""Of the door and its level, as of then."""

SAID = (
    Column("actor", TEXT, "who did it"),
    Column("source", TEXT, "with which sensor, robot or file"),
    Column("reason", TEXT, "why"),
    Column("correlation", TEXT, "what it belongs to: a goal, a ticket, a round"),
    Column("command_id", TEXT, "of its commit, 32 hex digits"),
)
"""What the event's commit says."""

RETRACTED = Column("retracted", "bool", "it was taken back, and does not count", nullable=False)

HISTORY_COLUMNS = (*HEAD, DOOR, *THEN, *WHEN, *FIELDS, *SAID, RETRACTED)
"""Of `DoorLog.to_arrow()`, in order, and of an exported file."""
