"""Events as numpy columns -> one Arrow table. No loop over events but for kinds with texts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.schema import DICTIONARIES, schema_of, type_named, type_of
from semmap_log.core.arrow.table_columns import (
    CELLS,
    CHANGED,
    COLUMNS,
    KIND,
    STATE,
    TEXT,
    TIME,
    Column,
)
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import KINDS, Event
from semmap_log.core.model.meaning import ALL_CHANGED, PART_OF

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
    """Texts that many rows share, ready to be told."""

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
