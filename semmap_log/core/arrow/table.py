"""The schema: what each column of a table of events means.

One row an event, in the order of event numbers; every kind's fields are in the same row, under the
names that they have in the events. A value is null where a kind has no such field or it was not
given, and where a DoorUpdated does not set it. Dictionaries are the same in every table.

An event counts from `happened`, but from `recorded` where that is earlier (its clock was wrong):
events sorted by (least(happened, recorded), event) are the order of the fold.

Events as numpy columns become one Arrow table, without a loop over events except for kinds with
texts. The schema in Arrow's own types includes what pandas needs to read whole numbers with gaps.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.messages import comments_of
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import KINDS, Event, field_names, public_fields
from semmap_log.core.model.meaning import ALL_CHANGED, PART_OF, Changed
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
"""Fields of events, in the order of their columns, and what they mean; later fields, described
by their `.msg` text, follow these."""

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
        for name in public_fields(kind):
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


DICTIONARIES = {KIND: KIND_NAMES, STATE: STATE_NAMES, CHANGED: CHANGED_NAMES}

TYPES = {
    TIME: pa.timestamp("ns", "UTC"),
    CELLS: pa.list_(pa.int8()),
    "str": pa.string(),
    TEXT: pa.dictionary(pa.int32(), pa.string()),
    "bool": pa.bool_(),
    **{name: pa.dictionary(pa.int8(), pa.string()) for name in DICTIONARIES},
}

PANDAS_TYPES = {"bool": "boolean", "uint16": "UInt16", "uint32": "UInt32", "int64": "Int64"}
"""Our type -> pandas's own that can say `not given`; without a word pandas takes floats."""


def type_of(column: Column) -> pa.DataType:
    """Return a column's Arrow type."""
    return type_named(column.type)


def type_named(name: str) -> pa.DataType:
    """Return the Arrow type of what a column calls its type."""
    return TYPES[name] if name in TYPES else pa.type_for_alias(name)


def schema_of(
    columns: Iterable[Column], said: Mapping[str, str] = MappingProxyType({})
) -> pa.Schema:
    """Return the Arrow schema of these columns.

    Args:
        columns: In order; what each means becomes its `description`.
        said: More about the whole table, key -> text.
    """
    columns = tuple(columns)
    fields = [
        pa.field(
            column.name,
            type_of(column),
            nullable=column.nullable,
            metadata={"description": column.says},
        )
        for column in columns
    ]
    metadata = {"semmap_log.schema": str(SCHEMA_VERSION), **said, "pandas": _for_pandas(columns)}
    return pa.schema(fields, metadata=metadata)


def _for_pandas(columns: tuple[Column, ...]) -> str:
    """Return pandas's own notes, as it would write them, without the versions of the day."""
    told = [
        {
            "name": column.name,
            "field_name": column.name,
            "pandas_type": column.type,
            "numpy_type": PANDAS_TYPES[column.type],
            "metadata": None,
        }
        for column in columns
        if column.nullable and column.type in PANDAS_TYPES
    ]
    return json.dumps({"index_columns": [], "column_indexes": [], "columns": told})


Array = NDArray[Any]

SCHEMA = schema_of(COLUMNS)

_WORDS = {name: pa.array(words) for name, words in DICTIONARIES.items()}

_STORED = {TIME: "int64", STATE: "uint8", CHANGED: "uint8"}
"""Type -> how its values wait in numpy."""


class Events(Protocol):
    """What is turned into a table: an `EventBatch`, which says what these are."""

    @property
    def number(self) -> NDArray[np.int64]: ...  # noqa: D102
    @property
    def kind(self) -> NDArray[np.uint8]: ...  # noqa: D102
    @property
    def happened_ns(self) -> NDArray[np.int64]: ...  # noqa: D102
    @property
    def recorded_ns(self) -> NDArray[np.int64]: ...  # noqa: D102
    @property
    def columns(self) -> Mapping[int, NDArray[np.void]]: ...  # noqa: D102
    @property
    def objects(self) -> Mapping[int, Sequence[Event]]: ...  # noqa: D102
    def places_of(self, kind: int) -> NDArray[np.intp]: ...  # noqa: D102
    def door_ids(self) -> NDArray[np.uint32]: ...  # noqa: D102
    def about_doors(self) -> NDArray[np.bool_]: ...  # noqa: D102


def table_of(events: Events) -> pa.Table:
    """Return events as a table of `COLUMNS`; numbers and times share the events' memory."""
    return pa.Table.from_arrays([column_of(events, each) for each in COLUMNS], schema=SCHEMA)


def column_of(events: Events, column: Column) -> pa.Array:
    """Return one of `COLUMNS` of some events."""
    head = _HEADS.get(column.name)
    return _field(column, events) if head is None else head(events)


def _door_ids(events: Events) -> pa.Array:
    return array_of(events.door_ids(), events.about_doors())


_HEADS: Mapping[str, Callable[[Events], pa.Array]] = {
    "event": lambda events: pa.array(events.number),
    "kind": lambda events: _dictionary(KIND, events.kind - 1),
    "door_id": _door_ids,
    "happened": lambda events: times_array(events.happened_ns),
    "recorded": lambda events: times_array(events.recorded_ns),
}
"""The columns that events of all kinds have."""


def _field(column: Column, events: Events) -> pa.Array:
    """Return one field of all kinds that have it; null for the others."""
    there = events.columns.keys() | events.objects.keys()
    kinds = [kind for kind in column.kinds if kind in there]
    if not kinds:
        return _nulls(column.type, len(events.number))
    if column.type in {"str", CELLS}:
        return _of_objects(column, events, kinds)
    values = np.zeros(len(events.number), _STORED.get(column.type, column.type))
    given = np.zeros(len(values), np.bool_)
    for kind in kinds:
        places = events.places_of(kind)
        if kind in events.columns:
            rows = events.columns[kind]
            values[places] = rows[column.field_name]
            given[places] = _is_set(column.field_name, kind, rows)
        else:
            values[places] = [_value(column, event) for event in events.objects[kind]]
            given[places] = True
    return _array(column, values, given)


def _nulls(type_: str, count: int) -> pa.Array:
    """Return nothing, so many times: most columns of most batches, so they share their memory."""
    most = 1 << max(count - 1, _FEW).bit_length()
    return _many_nulls(type_, most).slice(0, count)


_FEW = 2**14


@lru_cache(maxsize=64)
def _many_nulls(type_: str, count: int) -> pa.Array:
    if type_ in DICTIONARIES:  # Arrow's own nulls would bring a dictionary without words
        return _dictionary(type_, np.zeros(count, np.int8), np.zeros(count, np.bool_))
    return pa.nulls(count, type_named(type_))


def _is_set(field: str, kind: int, rows: NDArray[np.void]) -> Array | bool:
    """Return which rows mean something by this field: an update's only what it changes."""
    if KINDS[kind - 1].effect.says_what and field in PART_OF:
        set_: Array = (rows["changed"] & int(PART_OF[field])) != 0
        return set_
    return True


def _array(column: Column, values: Array, given: NDArray[np.bool_]) -> pa.Array:
    if column.type == STATE:
        return states_array(values, given)
    if column.type == CHANGED:
        bits = values & int(ALL_CHANGED)
        return _dictionary(CHANGED, bits - 1, given & (bits != 0))
    if values.dtype.kind == "f":
        given &= values == values  # noqa: PLR0124 - NaN
    return times_array(values, given) if column.type == TIME else array_of(values, given)


def _of_objects(column: Column, events: Events, kinds: Sequence[int]) -> pa.Array:
    """Return texts or grids, which only kinds that are read as objects have."""
    place = np.zeros(len(events.number), np.int64)
    given = np.zeros(len(place), np.bool_)
    found: list[Any] = []
    for kind in kinds:
        mine = events.places_of(kind)
        place[mine] = np.arange(len(found), len(found) + len(mine))
        given[mine] = True
        found += [_value(column, event) for event in events.objects[kind]]
    return pa.array(found, type_of(column)).take(pa.array(place, mask=~given))


def _value(column: Column, event: Event) -> Any:
    value = getattr(event, column.field_name)
    match column.name:
        case "cells":
            return value.reshape(-1)
        case "cells_height":
            return value.shape[0]
        case "cells_width":
            return value.shape[1]
        case _:
            return value


def states_array(states: Array, given: NDArray[np.bool_] | None = None) -> pa.Array:
    """Return numbers of states as their names; one that only a later version knows is UNKNOWN."""
    return _dictionary(STATE, _KNOWN_STATES.take(states), given)


_KNOWN_STATES = np.arange(2**8, dtype=np.uint8)
_KNOWN_STATES[len(DoorState) :] = DoorState.UNKNOWN


def times_array(ns: Array, given: NDArray[np.bool_] | None = None) -> pa.Array:
    """Return nanoseconds since the Unix epoch as instants, in the same memory."""
    return array_of(ns, given).view(pa.timestamp("ns", "UTC"))


def array_of(values: Array, given: NDArray[np.bool_] | None = None) -> pa.Array:
    """Return numbers in the same memory, null where they were not given; None: all were.

    Nobody may write to them from then on.
    """
    if values.dtype == np.bool_ or given is None or given.all():
        return pa.array(values, mask=None if given is None else ~given)
    bits = pa.py_buffer(np.packbits(given, bitorder="little"))
    buffers = [bits, pa.py_buffer(np.ascontiguousarray(values))]
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), buffers)


def texts_array(places: NDArray[np.integer[Any]], texts: Sequence[str]) -> pa.Array:
    """Return texts that many rows share as a dictionary, in the order in which they stand.

    Args:
        places: Of each row the place of its text among `texts`.
        texts: Some may be equal; an empty one is null.
    """
    return CodedTexts.of(texts).at(places)


class CodedTexts(NamedTuple):
    """Texts that many rows share, as codes."""

    codes: NDArray[np.int32]
    """Of each text its place among the different ones; -1: it is empty."""
    different: pa.Array

    @classmethod
    def of(cls, texts: Sequence[str]) -> CodedTexts:
        """Return texts, some of which may be equal, or empty."""
        known = {text: place for place, text in enumerate(dict.fromkeys(t for t in texts if t))}
        codes = np.array([known.get(text, -1) for text in texts], np.int32)
        return cls(codes, pa.array(list(known), pa.string()))

    def at(self, places: NDArray[np.integer[Any]]) -> pa.Array:
        """Return the texts of rows, by their places among all; an empty one is null."""
        if not len(self.different):
            return _nulls(TEXT, len(places))
        codes = self.codes.take(places)
        return pa.DictionaryArray.from_arrays(array_of(codes, codes >= 0), self.different)


def _dictionary(type_: str, places: Array, given: NDArray[np.bool_] | None = None) -> pa.Array:
    indices = array_of(places.astype(np.int8, copy=False), given)
    return pa.DictionaryArray.from_arrays(indices, _WORDS[type_])
