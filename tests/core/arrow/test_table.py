"""Batches as Arrow tables and pandas frames."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.arrow.table import CHANGED_NAMES, KIND_NAMES, STATE_NAMES
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.messages import layout
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorUpdated,
    Event,
    FloorMap,
    PatrolStarted,
)
from tests.batches import batch_of
from tests.core.arrow.rows import row_of, rows_of
from tests.strategies import events


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(events, max_size=30))
def test_every_event_is_the_row_that_it_should_be(drawn: list[Event]) -> None:
    """All kinds, all fields, at the ends of their ranges; what was not given is null."""
    batch = batch_of(drawn, first_number=7)

    assert list(map(row_of, batch)) == rows_of(batch.to_arrow())


@pytest.mark.slow
@settings(deadline=None)
@given(st.lists(events, max_size=8), st.lists(events, max_size=8))
def test_tables_can_be_joined(one: list[Event], other: list[Event]) -> None:
    """Whatever kinds are in a batch, its table has the same schema and the same dictionaries."""
    tables = [batch_of(one).to_arrow(), batch_of(other).to_arrow()]

    joined = pa.concat_tables(tables).combine_chunks()

    assert rows_of(tables[0]) + rows_of(tables[1]) == rows_of(joined)
    for name, words in (("kind", KIND_NAMES), ("state", STATE_NAMES), ("changed", CHANGED_NAMES)):
        for table in (*tables, joined):
            assert all(list(words) == c.dictionary.to_pylist() for c in table.column(name).chunks)


def test_numbers_and_times_are_the_batch_s_own_memory() -> None:
    """Nothing is copied that has the right form already."""
    batch = batch_of([DoorAdded(door_id=DoorId(n), happened_ns=n) for n in range(1, 50)])

    table = batch.to_arrow()

    for name, column in (
        ("event", batch.number),
        ("happened", batch.happened_ns),
        ("recorded", batch.recorded_ns),
    ):
        (chunk,) = table.column(name).chunks
        assert column.ctypes.data == chunk.buffers()[1].address


def test_what_an_update_does_not_set_is_null() -> None:
    """So that `df.dropna(subset="state")` are the events that say a state."""
    update = DoorUpdated(
        door_id=DoorId(1), changed=Changed.WIDTH | Changed.STATE, width=0.8, state=DoorState.OPEN,
        prob_open=0.5, happened_ns=0,
    )  # fmt: skip

    (row,) = rows_of(batch_of([update]).to_arrow())

    assert ("WIDTH|STATE", 0.8, "OPEN", None, None, None) == tuple(
        row[name] for name in ("changed", "width", "state", "prob_open", "x", "level")
    )


def test_a_state_of_a_later_version_is_unknown() -> None:
    """As everywhere: 5 to 255 are reserved."""
    rows = np.zeros(3, layout("DoorObserved").dtype)
    rows["state"] = [4, 5, 255]
    stamps = np.arange(3)
    kinds = np.full(3, DoorObserved.kind, np.uint8)
    batch = EventBatch(stamps, kinds, stamps, stamps, {DoorObserved.kind: rows}, {})

    states = batch.to_arrow().column("state").to_pylist()

    assert ["OFFLINE", "UNKNOWN", "UNKNOWN"] == states


def test_the_frame_has_types_that_can_be_worked_with() -> None:
    """Categories, times with their zone, whole numbers that stay whole where some are missing."""
    batch = batch_of(
        [
            DoorObserved(door_id=DoorId(2**32 - 1), state=DoorState.OPEN, happened_ns=1),
            PatrolStarted(patrol=3, happened_ns=2**62),
        ]
    )

    frame = batch.to_pandas()

    assert {
        "event": "int64", "kind": "category", "door_id": "UInt32", "state": "category",
        "happened": "datetime64[ns, UTC]", "recorded": "datetime64[ns, UTC]", "x": "float64",
        "passed": "boolean", "patrol": "UInt32", "first_event": "Int64",
    } == {name: str(frame.dtypes[name]) for name in (
        "event", "kind", "door_id", "state", "happened", "recorded", "x", "passed", "patrol",
        "first_event",
    )}  # fmt: skip
    assert 2**32 - 1 == frame.door_id[0]
    assert [1, 2**62] == frame.happened.astype("int64").tolist()
    assert [True, False] == frame.state.eq("OPEN").tolist()
    assert frame.door_id.isna()[1]


def test_a_batch_of_nothing_is_an_empty_table() -> None:
    """With all its columns."""
    table = batch_of([]).to_arrow()

    assert 0 == table.num_rows
    assert "happened" in table.column_names


def test_the_cells_of_a_floor_map_come_back() -> None:
    """Row by row: `np.reshape(cells, (height, width))`."""
    cells = np.arange(6, dtype=np.int8).reshape(2, 3)
    floor = FloorMap(happened_ns=0, resolution=0.5, origin_x=1, origin_y=2, cells=cells)

    row = batch_of([floor]).to_pandas().iloc[0]

    np.testing.assert_array_equal(
        cells, np.reshape(row.cells, (int(row.cells_height), int(row.cells_width)))
    )
