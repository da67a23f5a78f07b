"""Rows of the read model as they lie there, by door: columns of a history's table made of them.

A row need not become an event for it, and columns that nobody asks for are not read.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.rows_by_door import FIXED_KINDS, HEADS, LATE, numbers_in
from semmap_log.core.arrow.table import times_array
from semmap_log.core.arrow.table_columns import Column
from semmap_log.core.model.commits import NOTE_TEXTS
from semmap_log.core.model.meaning import PART_OF

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


def stored_columns(columns: Collection[Column]) -> frozenset[str] | None:
    """Return which columns of the rows these are made of; None: one needs the events themselves."""
    needed: set[str] = set()
    for column in columns:
        made_of = _MADE_OF.get(column.name) or _of_field(column)
        if not made_of:
            return None
        needed |= {*made_of}
    return frozenset(needed)


def _of_field(column: Column) -> tuple[str, ...]:
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
        return times_array(rows["recorded_ns"].to_numpy())
    if name == "happened":
        return times_array(_happened_ns(rows))
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
    """The fields of the events of one kind, each taken from its column when it is asked for."""

    def __init__(self, rows: pa.Table, places: NDArray[np.intp]) -> None:
        self._rows, self._places = rows, places

    def __getitem__(self, name: str) -> NDArray[Any]:
        return _numbers(self._rows, name)[self._places]


def _numbers(rows: pa.Table, name: str) -> NDArray[Any]:
    """Return a column of numbers; 0 where there is none."""
    if name not in rows.column_names:
        return np.zeros(rows.num_rows, np.int64)
    return numbers_in(rows, name)
