"""The schema: what each column of a table of events means. Data only; nothing is imported for it.

One row an event, in the order of event numbers; every kind's fields side by side, under the names
that they have in the events; null where a kind has no such field, or a value was not given. What a
DoorUpdated does not set is null, too. Dictionaries are the same in every table.

An event counts from `happened`, but from `recorded` where that is earlier (its clock was wrong):
events sorted by (least(happened, recorded), event) are the order of the fold.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from semmap_log.domain.doors import DoorState
from semmap_log.domain.events import KINDS, Event, field_names
from semmap_log.domain.meaning import ALL_CHANGED, Changed
from semmap_log.messages import OBJECT_KINDS, comments_of, fixed_layout

SCHEMA_VERSION = 1
"""Counts up when a column changes its meaning or goes; a new column does not."""

TIME = "timestamp[ns, UTC]"
KIND, STATE, CHANGED = "kind", "state", "changed"
CELLS = "list<int8>"
"""The types that are not numpy's own names; `KIND`, `STATE` and `CHANGED` are dictionaries."""

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


NOT_SHOWN = frozenset({"salt"})
"""Fields of events that no column holds: a salt keeps a redacted text from being guessed."""

HEAD = (
    Column("event", "int64", "event number, from 0 without gaps", nullable=False),
    Column("kind", KIND, "kind of event, such as DoorObserved", nullable=False),
)

WHEN = (
    Column("happened", TIME, "when it happened, as given", nullable=False),
    Column("recorded", TIME, "when the log learnt it, strictly increasing", nullable=False),
)

OLDEST = (
    Column("level", "uint16", "storey of the door, the robot or the floor map; 0 without levels"),
    Column("x", "float64", "start of the door's line, or the robot, m, frame map"),
    Column("y", "float64", "the same"),
    Column("theta", "float64", "direction of the door's line, or of the robot, rad"),
    Column("width", "float64", "length of the door's line, m"),
    Column("state", STATE, "OPEN CLOSED UNKNOWN MOVING OFFLINE: set, seen or asked for"),
    Column("prob_open", "float64", "P(open) that was set, 0..1"),
    Column("prob_closed", "float64", "P(closed) that was set, 0..1"),
    Column("changed", CHANGED, "DoorUpdated: what it sets, such as POSE|STATE; POSE is with level"),
    Column("accuracy_open", "float64", "DoorObserved: P(reads open when open), 0.5..1"),
    Column("accuracy_closed", "float64", "DoorObserved: P(reads closed when closed), 0.5..1"),
    Column("opening", "float64", "DoorObserved: how far it stood open, 0..1"),
    Column("passed", "bool", "DoorPassed: the robot went through; false: it gave up"),
    Column("waited_s", "float64", "DoorPassed: how long it waited before the door, s"),
    Column("patrol", "uint32", "PatrolStarted, PatrolFinished: the round's number"),
    Column("sd_xy", "float64", "RobotPose: standard deviation of x and y, m"),
    Column("sd_theta", "float64", "RobotPose: standard deviation of theta, rad"),
    Column("first_event", "int64", "Retracted: the first event that it takes back"),
    Column("last_event", "int64", "Retracted: the last one, inclusive"),
    Column("key", "str", "DoorAnnotated: what is said, such as name"),
    Column("value", "str", "DoorAnnotated: in words; empty: taken back"),
    Column("name", "str", "LevelAdded: the storey's name"),
    Column("elevation", "float64", "LevelAdded: above the building's zero, m"),
    Column("resolution", "float64", "FloorMap: size of a cell, m"),
    Column("origin_x", "float64", "FloorMap: lower left corner of cell (0, 0), m, frame map"),
    Column("origin_y", "float64", "the same"),
    Column("origin_theta", "float64", "FloorMap: how the grid is turned, rad"),
    Column("cells_width", "uint32", "FloorMap: cells in a row", field="cells"),
    Column("cells_height", "uint32", "FloorMap: rows", field="cells"),
    Column(
        "cells", CELLS, "FloorMap: row by row, lowest y first; 0 free..100 occupied, -1 unknown"
    ),
    Column("format", "str", "LogExported: of the file"),
    Column("file_name", "str", "LogExported: of the file"),
    Column("at", TIME, "LogExported: the moment whose state was saved", field="at_ns"),
)


def _others() -> Iterator[Column]:
    """Yield a column for each field that came later: its meaning is that of the `.msg` text."""
    known = {column.field_name for column in OLDEST} | NOT_SHOWN | {"door_id"}
    for kind in KINDS:
        for name in field_names(kind):
            if name not in known:
                known.add(name)
                yield Column(name, _type_of(kind, name), comments_of(kind.__name__)[name])


def _type_of(kind: type[Event], name: str) -> str:
    return "str" if kind.kind in OBJECT_KINDS else str(fixed_layout(kind.kind).dtype[name])


FIELDS = (*OLDEST, *_others())
"""The fields of all kinds; those of `OLDEST` have words of their own."""

DOOR = Column("door_id", "uint32", "the door that it is about")

COLUMNS = (*HEAD, DOOR, *WHEN, *FIELDS)
"""Of `EventBatch.to_arrow()`, in order."""

SAID = (
    Column("actor", "str", "who did it"),
    Column("source", "str", "with which sensor, robot or file"),
    Column("reason", "str", "why"),
    Column("correlation", "str", "what it belongs to: a goal, a ticket, a round"),
    Column("command_id", "str", "of its commit, 32 hex digits"),
    Column("retracted", "bool", "it was taken back, and does not count", nullable=False),
)
"""What an exported file has besides."""
