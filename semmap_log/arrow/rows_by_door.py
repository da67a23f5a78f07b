"""Events of one door side by side: the rows of the read model, and the events in them again.

Values are as the messages have them: numbers for kinds, states and bits, NaN for what was not
given. So rows become the same events again, which `table`, made for people, does not promise. A
field is null where its kind has none; a column that no event fills is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.arrow.arrow_sdk import pa
from semmap_log.arrow.table import Events, texts_array
from semmap_log.domain.commits import NOTE_TEXTS
from semmap_log.domain.events import DOOR_KINDS, KINDS, Event, FloorMap
from semmap_log.messages import OBJECT_KINDS, decode, encode, fixed_layout

DATA = "data"
"""Column of the bytes (CDR) of events with texts; of a floor map there are none here."""
HEADS = ("event", "kind", "door_id", "happened_ns", "recorded_ns")
FIXED_KINDS = tuple(kind.kind for kind in KINDS if kind.kind not in OBJECT_KINDS)


class RowsByDoor:
    """Collects the events of a segment, part by part, and sorts them by door."""

    def __init__(self) -> None:
        self._heads: dict[str, list[NDArray[Any]]] = {name: [] for name in HEADS}
        self._fields: dict[str, list[NDArray[Any]]] = {name: [] for name in _dtypes()}
        self._data: dict[int, bytes] = {}
        """Number of an event with texts -> its bytes."""

    def add(self, events: Events, door_ids: NDArray[np.uint32]) -> None:
        """Take events, all of whose numbers lie behind those before.

        Args:
            events: They.
            door_ids: Which door each is about; 0: perhaps none.
        """
        heads: tuple[NDArray[Any], ...] = (
            events.number, events.kind, door_ids, events.happened_ns, events.recorded_ns
        )  # fmt: skip
        for name, values in zip(HEADS, heads, strict=True):
            self._heads[name].append(values)
        kinds = (*events.columns, *events.objects)
        places = {kind: np.flatnonzero(events.kind == kind) for kind in kinds}
        for name, dtype in _dtypes().items():
            self._fields[name].append(_scattered(name, dtype, events, places))
        for kind, told in events.objects.items():
            if kind == FloorMap.kind:
                continue
            for at, event in zip(places[kind].tolist(), told, strict=True):
                happened_ns = int(events.happened_ns[at])
                self._data[int(events.number[at])] = encode(event, happened_ns)

    def table(self, said: Mapping[str, tuple[NDArray[np.intp], Sequence[str]]]) -> pa.Table:
        """Return the rows, by door and event number; those about no door come first.

        The parts are let go of.

        Args:
            said: More columns: for each event the place of its text among some texts, in the order
                of event numbers; an empty text is null.
        """
        heads = {name: _joined(parts) for name, parts in self._heads.items()}
        kind, door_id = heads["kind"], heads["door_id"]
        is_about = np.isin(kind, list(DOOR_KINDS))
        order = np.lexsort((door_id, is_about))  # stable: numbers ascend within a door
        kind, is_about = kind[order], is_about[order]
        columns: dict[str, pa.Array] = {}
        for name, values in heads.items():
            missing = ~is_about if name == "door_id" else None
            columns[name] = pa.array(values[order], mask=missing)
        for name, parts in self._fields.items():
            has = np.isin(kind, _kinds_with(name))
            if has.any():
                columns[name] = pa.array(_joined(parts)[order], mask=None if has.all() else ~has)
            else:
                parts.clear()
        if self._data:
            numbers = heads["event"][order].tolist()
            columns[DATA] = pa.array([self._data.get(n) for n in numbers], pa.binary())
        for name, (places, texts) in said.items():
            columns[name] = texts_array(places[order], texts)
        return pa.table(columns)


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
    for name, said in zip(NOTE_TEXTS, zip(*commits.texts, strict=True), strict=True):
        columns[name] = texts_array(commits.notes, said)
    return pa.table(columns)


def events_in(rows: pa.Table) -> dict[str, Any]:
    """Return rows as the fields of an EventBatch, in the order of event numbers.

    Raises:
        ValueError: A row is no event.
        KeyError: A column is missing.
    """
    order = np.argsort(_numbers(rows, "event"), kind="stable")
    heads = {name: _numbers(rows, name)[order] for name in HEADS}
    kind, happened_ns = heads["kind"], heads["happened_ns"]
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
            found[name] = _numbers(rows, name)[order[places]]
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


def _numbers(rows: pa.Table, name: str) -> NDArray[Any]:
    """Return a column of numbers; 0 where there is none, which no event of the kind reads."""
    column = rows[name]
    if column.null_count:
        column = column.fill_null(0)
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
        dtype = fixed_layout(kind).dtype
        for name in dtype.names or ():
            if name != "door_id":
                yield name, dtype[name]


@cache
def _kinds_with(field: str) -> list[int]:
    return [k for k in FIXED_KINDS if field in (fixed_layout(k).dtype.names or ())]


def _scattered(
    name: str, dtype: np.dtype[Any], events: Events, places: Mapping[int, NDArray[np.intp]]
) -> NDArray[Any]:
    """Return a field of all events, 0 where their kind has none."""
    kinds = [kind for kind in _kinds_with(name) if kind in events.columns]
    count = len(events.kind)
    if len(kinds) == 1 and len(places[kinds[0]]) == count:
        return np.ascontiguousarray(events.columns[kinds[0]][name])
    values = np.zeros(count, dtype)
    for kind in kinds:
        values[places[kind]] = events.columns[kind][name]
    return values


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    joined = np.concatenate(parts)
    parts.clear()
    return joined
