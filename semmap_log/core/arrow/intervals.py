"""The intervals of a timeline as an Arrow table."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.schema import schema_of
from semmap_log.core.arrow.table import states_array, times_array
from semmap_log.core.arrow.table_columns import STATE, TIME, Column
from semmap_log.core.model.moments import SECOND_NS

SEEN_SECONDS = "how much of it a sighting held, or a state that was set"

INTERVAL_SCHEMA = schema_of(
    (
        Column("start", TIME, "when the state began", nullable=False),
        Column("end", TIME, "when it ended", nullable=False),
        Column("state", STATE, "the state", nullable=False),
        Column("event", "int64", "number of the event that began it", nullable=False),
        Column("sightings", "int64", "how many events said so", nullable=False),
        Column("seen_seconds", "float64", SEEN_SECONDS, nullable=False),
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
        times_array(start_ns),
        times_array(end_ns),
        states_array(state),
        pa.array(event),
        pa.array(sightings),
        pa.array(seen_ns / SECOND_NS),
    ]
    return pa.Table.from_arrays(columns, schema=INTERVAL_SCHEMA)
