"""The one wide table: events with who did it and why, and what doors were called at the time.

It also holds the rows of the read model, by door, and turns them into events again. Values are as
the messages have them: numbers for kinds, states and bits, NaN for what was not given. So rows
become the same events again, which `table`, made for people, does not guarantee. A field is null
where its kind has none; a column that no event fills is left out. The time of an event is stored as
the delay until it was recorded: a small number, where a time is a big one.

The columns of a history's table are made from these rows directly: no row need become an event, and
columns that are not requested are not read.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.arrow import table
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.messages import OBJECT_KINDS, decode, encode, fixed_layout
from semmap_log.core.model.commits import NOTE_TEXTS
from semmap_log.core.model.events import DOOR_KINDS, KINDS, Event, FloorMap
from semmap_log.core.model.meaning import PART_OF

TextsAsOf = Mapping[str, tuple[NDArray[np.intp], Sequence[str]]]
"""Column of `THEN` -> of each event the place of its text among some; an empty one is null."""


def history_table(
    events: table.Events,
    columns: Sequence[table.Column] = table.HISTORY_COLUMNS,
    *,
    retracted: NDArray[np.bool_],
    commits: Commits | None = None,
    then: TextsAsOf = MappingProxyType({}),
) -> pa.Table:
    """Return some columns of events; the others are not made.

    Args:
        events: Their numbers ascend.
        columns: Some of `HISTORY_COLUMNS`, in any order.
        retracted: Which events were taken back.
        commits: Those of the events, where a column of `SAID` is wanted.
        then: The columns of `THEN` that are wanted.
    """
    places = np.empty(0, np.intp) if commits is None else commits.places_of(events.number)
    arrays = []
    for column in columns:
        if column in table.SAID:
            assert commits is not None, "commits say who and why"
            arrays.append(_said(column.name, commits, places))
        elif column in table.THEN:
            arrays.append(table.texts_array(*then[column.name]))
        elif column == table.RETRACTED:
            arrays.append(pa.array(retracted))
        else:
            arrays.append(table.column_of(events, column))
    return pa.Table.from_arrays(arrays, schema=_schema(tuple(columns)))


@lru_cache(maxsize=16)
def _schema(columns: tuple[table.Column, ...]) -> pa.Schema:
    return table.schema_of(columns)


def joined(tables: Iterable[pa.Table], columns: Sequence[table.Column]) -> pa.Table:
    """Return tables of some columns as one, whose dictionaries are the same in all its parts."""
    parts = list(tables)
    if not parts:
        return _schema(tuple(columns)).empty_table()
    return pa.concat_tables(parts).unify_dictionaries()


def plain_texts(columns: Iterable[table.Column]) -> tuple[table.Column, ...]:
    """Return columns as files have them: texts that many rows share are texts all the same."""
    return tuple(replace(each, type="str") if each.type == table.TEXT else each for each in columns)


EXPORT_SCHEMA = table.schema_of(plain_texts(table.HISTORY_COLUMNS))
"""Of an exported file; a table of all columns becomes one by `cast`."""


def _said(name: str, commits: Commits, places: NDArray[np.intp]) -> pa.DictionaryArray:
    if name in NOTE_TEXTS:
        at = NOTE_TEXTS.index(name)
        return table.texts_array(commits.notes.take(places), [texts[at] for texts in commits.texts])
    return pa.DictionaryArray.from_arrays(pa.array(places.astype(np.int32)), _hex(commits))


def _hex(commits: Commits) -> pa.StringArray:
    """Return command ids in hexadecimal digits; no loop over them."""
    count, width = commits.command_id.shape
    digits = pa.py_buffer(commits.command_id.tobytes().hex().encode("ascii"))
    ends = pa.py_buffer(np.arange(count + 1, dtype=np.int32) * (2 * width))
    return pa.StringArray.from_buffers(count, ends, digits)


DATA = "data"
"""Column of the bytes (CDR) of events with texts; of a floor map there are none here."""
LATE = "late_ns"
"""Column: recorded minus happened time; below 0 where a clock was ahead."""
HEADS = ("event", "kind", "door_id", "recorded_ns", LATE)
FIXED_KINDS = tuple(kind.kind for kind in KINDS if kind.kind not in OBJECT_KINDS)


class RowsByDoor:
    """Collects the events of a segment, part by part, and gives them as tables sorted by door."""

    def __init__(self) -> None:
        self._heads: dict[str, list[NDArray[Any]]] = {name: [] for name in HEADS}
        self._fields: dict[int, list[NDArray[np.void]]] = {}
        self._data: dict[int, bytes] = {}
        """Number of an event with texts -> its bytes."""

    def add(self, events: table.Events, door_ids: NDArray[np.uint32]) -> None:
        """Add events whose numbers all follow the earlier ones.

        Args:
            events: The events.
            door_ids: Which door each is about; 0: perhaps none.
        """
        late_ns = events.recorded_ns - events.happened_ns
        heads: tuple[NDArray[Any], ...] = (
            events.number, events.kind, door_ids, events.recorded_ns, late_ns
        )  # fmt: skip
        for name, values in zip(HEADS, heads, strict=True):
            self._heads[name].append(values)
        for kind, rows in events.columns.items():
            self._fields.setdefault(kind, []).append(rows)
        for kind, told in events.objects.items():
            if kind == FloorMap.kind:
                continue
            places = np.flatnonzero(events.kind == kind)
            for at, event in zip(places.tolist(), told, strict=True):
                happened_ns = int(events.happened_ns[at])
                self._data[int(events.number[at])] = encode(event, happened_ns)

    def sorted(self, notes: NDArray[np.int32], texts: Sequence[tuple[str, ...]]) -> SortedRows:
        """Return the rows, by door and event number; those about no door come first.

        Releases the parts.

        Args:
            notes: (events,), in the order of their numbers: the place of each event's note in
                `texts`.
            texts: `NOTE_TEXTS` of each note; an empty one is null.
        """
        heads = {name: _joined(parts) for name, parts in self._heads.items()}
        fields = {kind: _joined(parts) for kind, parts in self._fields.items()}
        return SortedRows(heads, fields, self._data, notes, texts)


class SortedRows:
    """The events of a segment by door, as tables of some rows, so that few are held twice."""

    def __init__(
        self,
        heads: Mapping[str, NDArray[Any]],
        fields: Mapping[int, NDArray[np.void]],
        data: Mapping[int, bytes],
        notes: NDArray[np.int32],
        texts: Sequence[tuple[str, ...]],
    ) -> None:
        self._heads, self._fields, self._data = heads, fields, data
        kind = heads["kind"]
        self._is_about = np.isin(kind, list(DOOR_KINDS))
        self._order = np.argsort(_ranks(heads["door_id"], self._is_about), kind="stable")
        self._place = np.empty(len(kind), np.int32)
        """Of each event: which one of its kind it is."""
        for each, rows in fields.items():
            self._place[kind == each] = np.arange(len(rows))
        self._notes, self._said = notes, _by_text(texts)
        self._names = [name for name in _dtypes() if any(k in fields for k in _kinds_with(name))]

    def __len__(self) -> int:
        return len(self._order)

    def tables(self, rows: int) -> Iterator[pa.Table]:
        """Yield the rows, so many at a time."""
        for start in range(0, len(self), rows):
            yield self._table(self._order[start : start + rows])

    def sample(self, rows: int) -> pa.Table:
        """Return so many rows, or a few more, taken evenly from all."""
        return self._table(self._order[:: max(1, len(self) // rows)])

    def _table(self, chosen: NDArray[np.intp]) -> pa.Table:
        kind, is_about = self._heads["kind"][chosen], self._is_about[chosen]
        columns: dict[str, pa.Array] = {}
        for name, head in self._heads.items():
            missing = ~is_about if name == "door_id" else None
            columns[name] = pa.array(head[chosen], mask=missing)
        values = {name: np.zeros(len(chosen), _dtypes()[name]) for name in self._names}
        for each, rows in self._fields.items():
            places = np.flatnonzero(kind == each)
            found = _taken(rows, self._place[chosen[places]])
            for name in _fields_of(each):
                values[name][places] = found[name]
        for name, column in values.items():
            columns[name] = pa.array(column, mask=_is_without(name)[kind])
        if self._data:
            columns[DATA] = self._bytes_of(self._heads["event"][chosen], kind)
        notes = self._notes[chosen]
        return pa.table(columns | {name: said.at(notes) for name, said in self._said.items()})

    def _bytes_of(self, numbers: NDArray[np.int64], kind: NDArray[np.uint8]) -> pa.Array:
        """Return the bytes of the events with texts, null of the others."""
        places = np.flatnonzero(np.isin(kind, list(OBJECT_KINDS)))
        where = np.full(len(numbers), -1)
        where[places] = np.arange(len(places))
        found = pa.array([self._data.get(n) for n in numbers[places].tolist()], pa.binary())
        return found.take(pa.array(where, mask=where < 0))


def _ranks(door_id: NDArray[np.uint32], is_about: NDArray[np.bool_]) -> NDArray[Any]:
    """Return numbers that sort as doors do, with 0 for no door; small ones are sorted sooner."""
    ids = np.unique(door_id[is_about])
    ranks = np.zeros(len(door_id), np.min_scalar_type(len(ids)))
    ranks[is_about] = np.searchsorted(ids, door_id[is_about]) + 1
    return ranks


class Commits(Protocol):
    """What is turned into a table: see `CommitColumns`."""

    @property
    def first_event(self) -> NDArray[np.int64]: ...  # noqa: D102
    @property
    def count(self) -> NDArray[np.int64]: ...  # noqa: D102
    @property
    def command_id(self) -> NDArray[np.uint8]: ...  # noqa: D102
    @property
    def notes(self) -> NDArray[np.intp]: ...  # noqa: D102
    @property
    def texts(self) -> Sequence[tuple[str, ...]]: ...  # noqa: D102
    def places_of(self, numbers: NDArray[np.int64]) -> NDArray[np.intp]: ...  # noqa: D102


def commit_table(commits: Commits) -> pa.Table:
    """Return commits as a table, in the order of their events."""
    count, width = commits.command_id.shape
    ids = pa.py_buffer(np.ascontiguousarray(commits.command_id))
    columns = {
        "first_event": pa.array(commits.first_event),
        "count": pa.array(commits.count),
        "command_id": pa.Array.from_buffers(pa.binary(width), count, [None, ids]),
    }
    said = _by_text(commits.texts)
    return pa.table(columns | {name: each.at(commits.notes) for name, each in said.items()})


def _by_text(notes: Sequence[tuple[str, ...]]) -> dict[str, table.CodedTexts]:
    """Return what notes say, by the name of the text."""
    said = zip(NOTE_TEXTS, zip(*notes, strict=True), strict=True)
    return {name: table.CodedTexts.of(texts) for name, texts in said}


def events_in(rows: pa.Table) -> dict[str, Any]:
    """Return rows as the fields of an EventBatch, in the order of event numbers.

    Raises:
        ValueError: A row is no event.
        KeyError: A column is missing.
    """
    order = np.argsort(numbers_in(rows, "event"), kind="stable")
    heads = {name: numbers_in(rows, name)[order] for name in HEADS}
    kind, happened_ns = heads["kind"], heads["recorded_ns"] - heads[LATE]
    columns: dict[int, NDArray[np.void]] = {}
    objects: dict[int, list[Event]] = {}
    for each in np.unique(kind).tolist():
        places = np.flatnonzero(kind == each)
        if each in OBJECT_KINDS:
            data = rows[DATA].take(pa.array(order[places])).to_pylist()
            times = happened_ns[places].tolist()
            objects[each] = [decode(each, d, t) for d, t in zip(data, times, strict=True)]
            continue
        found = np.zeros(len(places), fixed_layout(each).dtype)
        for name in found.dtype.names or ():
            found[name] = numbers_in(rows, name)[order[places]]
        columns[each] = found
    return {
        "number": heads["event"],
        "kind": kind,
        "happened_ns": happened_ns,
        "recorded_ns": heads["recorded_ns"],
        "columns": columns,
        "objects": objects,
        "known_door_ids": heads["door_id"],
    }


def numbers_in(rows: pa.Table, name: str) -> NDArray[Any]:
    """Return a column of numbers; 0 where a kind lacks it, and none of its events reads it."""
    column = rows[name]
    if column.null_count:
        column = column.fill_null(False if pa.types.is_boolean(column.type) else 0)
    values: NDArray[Any] = column.to_numpy()
    return values


def columns_of_events(names: Sequence[str]) -> list[str]:
    """Return which columns of a table the events are in."""
    wanted = {*HEADS, *_dtypes(), DATA}
    return [name for name in names if name in wanted]


@cache
def _dtypes() -> dict[str, np.dtype[Any]]:
    """Return the fields of all kinds of fixed size, but for the door."""
    found: dict[str, np.dtype[Any]] = {}
    for name, dtype in _fields():
        assert found.setdefault(name, dtype) == dtype, f"one column holds each field {name}"
    return found


def _fields() -> Iterator[tuple[str, np.dtype[Any]]]:
    for kind in FIXED_KINDS:
        for name in _fields_of(kind):
            yield name, fixed_layout(kind).dtype[name]


@cache
def _fields_of(kind: int) -> list[str]:
    return [name for name in fixed_layout(kind).dtype.names or () if name != "door_id"]


@cache
def _is_without(field: str) -> NDArray[np.bool_]:
    """Return for each number of a kind whether it lacks a field."""
    return ~np.isin(np.arange(256), _kinds_with(field))


def _kinds_with(field: str) -> list[int]:
    return [kind for kind in FIXED_KINDS if field in _fields_of(kind)]


def _taken(rows: NDArray[np.void], places: NDArray[np.integer[Any]]) -> NDArray[np.void]:
    """Return some rows: as plain bytes, which numpy takes several times as fast as fields."""
    whole: NDArray[np.void] = rows.view(f"V{rows.dtype.itemsize}")[places].view(rows.dtype)
    return whole


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    joined = np.concatenate(parts)
    parts.clear()
    return joined


_TIMES = tuple(name for name in HEADS if name.endswith("_ns"))

_MADE_OF = {
    "event": ("event",),
    "kind": ("kind",),
    "door_id": ("door_id",),
    "happened": _TIMES,
    "recorded": ("recorded_ns",),
    "door_name": ("event", "kind", "door_id", *_TIMES),
    "retracted": ("event", "kind"),
    **{name: (name,) for name in NOTE_TEXTS},
}
"""Column -> what of the rows it is made of."""


def stored_columns(columns: Collection[table.Column]) -> frozenset[str] | None:
    """Return which columns of the rows these are made of; None: one needs the events themselves."""
    needed: set[str] = set()
    for column in columns:
        made_of = _MADE_OF.get(column.name) or _of_field(column)
        if not made_of:
            return None
        needed |= {*made_of}
    return frozenset(needed)


def _of_field(column: table.Column) -> tuple[str, ...]:
    """Return what a field of events is made of; nothing where events with texts have it."""
    field, kinds = column.field_name, column.kinds
    if not kinds or not set(kinds) <= set(FIXED_KINDS):
        return ()
    return ("kind", field, "changed") if field in PART_OF else ("kind", field)


def stored_column(rows: pa.Table, name: str) -> pa.Array | pa.ChunkedArray | None:
    """Return a column of a history that rows have as it is; None: it is made of events."""
    if name in {"event", "door_id", *NOTE_TEXTS}:
        return rows[name]
    if name == "recorded":
        return table.times_array(rows["recorded_ns"].to_numpy())
    if name == "happened":
        return table.times_array(_happened_ns(rows))
    return None


def stored_events(rows: pa.Table) -> dict[str, Any]:
    """Return rows as the fields of an EventBatch, in their own order, for one table's columns.

    What `stored_columns` did not name is not there, and reads as zeros.
    """
    heads = {name: _numbers(rows, name) for name in HEADS}
    kind = heads["kind"].astype(np.uint8, copy=False)
    there = np.flatnonzero(np.bincount(kind)).tolist()
    return {
        "number": heads["event"],
        "kind": kind,
        "happened_ns": _happened_ns(rows) if {*_TIMES} <= {*rows.column_names} else heads["event"],
        "recorded_ns": heads["recorded_ns"],
        "columns": {
            each: _FieldsOfKind(rows, np.flatnonzero(kind == each))
            for each in there
            if each in FIXED_KINDS
        },
        "objects": {},
        "known_door_ids": heads["door_id"].astype(np.uint32, copy=False),
    }


def _happened_ns(rows: pa.Table) -> NDArray[np.int64]:
    happened: NDArray[np.int64] = _numbers(rows, "recorded_ns") - _numbers(rows, LATE)
    return happened


class _FieldsOfKind:
    """The fields of the events of one kind, each taken from its column on request."""

    def __init__(self, rows: pa.Table, places: NDArray[np.intp]) -> None:
        self._rows, self._places = rows, places

    def __getitem__(self, name: str) -> NDArray[Any]:
        return _numbers(self._rows, name)[self._places]


def _numbers(rows: pa.Table, name: str) -> NDArray[Any]:
    """Return a column of numbers; 0 where it is null."""
    if name not in rows.column_names:
        return np.zeros(rows.num_rows, np.int64)
    return numbers_in(rows, name)
