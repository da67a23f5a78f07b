"""The columns of the view `events`: those of a history, with times as queries want them.

SQL's instants have microseconds, and queries filter by them. `happened` is when an event counts,
as in all other queries: never after it was recorded, however wrong a clock was.

Also the intervals of a timeline as an Arrow table.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.arrow import table
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.model.moments import SECOND_NS

HAPPENED, RECORDED = "happened", "recorded"

_TIMES = (
    table.Column("happened_ns", "int64", "happened, nanoseconds since 1970", nullable=False),
    table.Column("recorded_ns", "int64", "recorded, nanoseconds since 1970", nullable=False),
    table.Column(
        "happened_given",
        table.TIME,
        "as given, by a clock that may have been wrong",
        nullable=False,
    ),
)
_COUNTS = "when it happened, never after recorded"

EVENT_VIEW = (
    *(replace(c, says=_COUNTS) if c.name == HAPPENED else c for c in table.HISTORY_COLUMNS),
    *_TIMES,
)
"""In order."""

_MADE_OF: Mapping[str, tuple[str, ...]] = {
    HAPPENED: (HAPPENED, RECORDED),
    "happened_ns": (HAPPENED, RECORDED),
    "recorded_ns": (RECORDED,),
    "happened_given": (HAPPENED,),
}


def history_columns(names: Collection[str]) -> list[str]:
    """Return the columns of a history from which these of the view are made."""
    needed = {made_of for name in names for made_of in _MADE_OF.get(name, (name,))}
    return [column.name for column in table.HISTORY_COLUMNS if column.name in needed]


def as_event_view(history: pa.Table, names: Collection[str]) -> pa.Table:
    """Return some columns of the view.

    Args:
        history: The columns that `history_columns` names.
        names: Of the view's columns.
    """
    made = {name: history[name] for name in names if name in history.column_names}
    if {HAPPENED, "happened_ns"} & {*names}:
        counts_ns = np.minimum(_ns(history[HAPPENED]), _ns(history[RECORDED]))
        made |= {HAPPENED: _instants(counts_ns), "happened_ns": pa.array(counts_ns)}
    if RECORDED in names:
        made[RECORDED] = _instants(_ns(history[RECORDED]))
    if "recorded_ns" in names:
        made["recorded_ns"] = history[RECORDED].cast(pa.int64())
    if "happened_given" in names:
        made["happened_given"] = _instants(_ns(history[HAPPENED]))
    return pa.table({name: made[name] for name in names})


def _ns(times: pa.ChunkedArray) -> NDArray[np.int64]:
    ns: NDArray[np.int64] = times.cast(pa.int64()).to_numpy()
    return ns


def _instants(ns: NDArray[np.int64]) -> pa.Array:
    """Return times in microseconds: numpy divides several times as fast as Arrow casts."""
    return pa.array(ns // 1000).view(pa.timestamp("us", "UTC"))


SEEN_SECONDS = "how much of it a sighting held, or a state that was set"

INTERVAL_SCHEMA = table.schema_of(
    (
        table.Column("start", table.TIME, "when the state began", nullable=False),
        table.Column("end", table.TIME, "when it ended", nullable=False),
        table.Column("state", table.STATE, "the state", nullable=False),
        table.Column("event", "int64", "number of the event that began it", nullable=False),
        table.Column("sightings", "int64", "how many events said so", nullable=False),
        table.Column("seen_seconds", "float64", SEEN_SECONDS, nullable=False),
    )
)


def interval_table(
    *,
    start_ns: NDArray[np.int64],
    end_ns: NDArray[np.int64],
    state: NDArray[np.uint8],
    event: NDArray[np.int64],
    sightings: NDArray[np.int64],
    seen_ns: NDArray[np.int64],
) -> pa.Table:
    """Return the columns of a `Timeline` as a table of `INTERVAL_SCHEMA`."""
    columns: list[Any] = [
        table.times_array(start_ns),
        table.times_array(end_ns),
        table.states_array(state),
        pa.array(event),
        pa.array(sightings),
        pa.array(seen_ns / SECOND_NS),
    ]
    return pa.Table.from_arrays(columns, schema=INTERVAL_SCHEMA)
