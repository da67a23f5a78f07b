"""Events as columns: made from what a user has, and refused where an event would refuse."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.batches.columnar_events import check_rows, event_of_row
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.messages import OBJECT_KINDS, fixed_layout
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    KINDS,
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRequested,
    DoorUpdated,
    Event,
    PatrolStarted,
)
from semmap_log.errors import InvalidEventError
from tests.strategies import events, fixed_size, same

FIXED = [kind for kind in KINDS if kind.kind not in OBJECT_KINDS]


def test_columns_become_events() -> None:
    """One value stands for all rows, what is left out has the event's default."""
    batch = EventBatch.of(
        DoorObserved,
        door_id=[1, 2, 3],
        state=np.array([1, 2, 1], np.int64),
        accuracy_open=0.9,
        happened_ns=[10, 20, 30],
    )

    expected = [
        DoorObserved(door_id=DoorId(i), state=state, accuracy_open=0.9, happened_ns=10 * i)
        for i, state in ((1, DoorState.OPEN), (2, DoorState.CLOSED), (3, DoorState.OPEN))
    ]
    assert all(same(event, row.event) for event, row in zip(expected, batch, strict=True))


def test_single_values_are_one_event() -> None:
    """And the time that is not given is not made up."""
    batch = EventBatch.of(DoorPassed, door_id=7, passed=True, waited_s=1.5)

    assert [DoorPassed(door_id=DoorId(7), passed=True, waited_s=1.5)] == [r.event for r in batch]
    assert 3 == len(EventBatch.of(PatrolStarted, patrol=4, happened_ns=[1, 2, 3]))
    assert 0 == len(EventBatch.of(DoorRequested, door_id=[], state=[]))


@pytest.mark.slow
@settings(deadline=None)
@given(st.lists(events, max_size=20), st.data())
def test_events_become_columns_and_events_again(drawn: list[Event], data: st.DataObject) -> None:
    """Of every kind, with and without a time; and a batch falls into parts as the events do."""
    given_events = [
        replace(event, happened_ns=None) if data.draw(st.booleans()) else event for event in drawn
    ]
    cut = data.draw(st.integers(0, len(drawn)))

    batch = EventBatch.from_events(given_events)

    def texts(batch: EventBatch) -> list[str]:
        return [repr(row.event) for row in batch]

    expected = [repr(event) for event in given_events]
    first, rest = batch.split(cut)
    batch.check()
    assert expected == texts(batch)
    assert expected == [text for part in batch.parts(3) for text in texts(part)]
    assert (expected[:cut], expected[cut:]) == (texts(first), texts(rest))


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"door_id": [1, 2], "state": [1, 1, 1]}, "DoorObserved: expected columns of one length"),
        ({"door_id": [1, 2], "state": 1, "happened_ns": [1]}, "expected columns of one length"),
        ({"door_id": [[1]], "state": 1}, "expected columns of one length"),
        ({"door_id": 1}, r"DoorObserved: expected the columns door_id state .* got \['state'\]"),
        ({"door_id": [1, 2**32], "state": 1},
         "DoorObserved.door_id: expected a whole number from 0 to 4294967295, got 4294967296"),
        ({"door_id": [-1], "state": 1}, "DoorObserved.door_id: .* got -1"),
        ({"door_id": 2**70, "state": 1}, "DoorObserved.door_id: expected numbers of type uint32"),
        ({"door_id": [1.0], "state": 1}, "expected numbers of type uint32, got 'float64'"),
        ({"door_id": [True], "state": 1}, "expected numbers of type uint32, got 'bool'"),
        ({"door_id": ["1"], "state": 1}, "expected numbers of type uint32"),
        ({"door_id": [1, -1], "state": 1},
         "DoorObserved.door_id: expected a whole number from 0 to"),
        ({"door_id": 1, "state": [1, 2, 5]},
         "row 2: DoorObserved.state: expected one of UNKNOWN OPEN CLOSED MOVING OFFLINE, got 5"),
        ({"door_id": 1, "state": 257}, "DoorObserved.state: expected a whole number from 0 to 255"),
        ({"door_id": 1, "state": 1, "accuracy_open": [0.5, 0.4]},
         "row 1: DoorObserved.accuracy_open: expected a number from 0.5 to 1, got 0.4"),
        ({"door_id": 1, "state": 1, "accuracy_closed": math.nan}, "accuracy_closed: .* got nan"),
        ({"door_id": 1, "state": 1, "opening": [math.nan, 1.5]}, "row 1: DoorObserved.opening"),
        ({"door_id": 1, "state": 1, "happened_ns": 2**63},
         "DoorObserved.happened_ns: expected a whole number from .* to 9223372036854775807"),
        ({"door_id": 1, "state": 1, "happened_ns": [3, -1]}, "happened_ns: .* got -1"),
        ({"door_id": 1, "state": 1, "happened_ns": [3.5]}, "expected numbers of type int64"),
    ],
)  # fmt: skip
def test_what_no_event_can_have_is_refused(columns: dict[str, Any], message: str) -> None:
    """Nothing wraps, nothing is cut; the message says which row."""
    with pytest.raises(InvalidEventError, match=message):
        EventBatch.of(DoorObserved, **columns)


def test_kinds_with_texts_are_no_columns() -> None:
    """They come as events."""
    with pytest.raises(InvalidEventError, match="expected a kind without texts"):
        EventBatch.of(DoorAnnotated, door_id=1)


raw_floats = st.sampled_from([math.nan, math.inf, -math.inf, -1.0, -0.0, 0.0, 0.4, 0.5, 1.0, 1.1])
raw_numbers = st.sampled_from(
    [0, 1, 2, 4, 5, 8, 16, 31, 32, 65_000, 65_001, 2**32 - 1, 2**63, 2**64 - 1]
)


def _raw(data: st.DataObject, kind: type[Event]) -> Any:
    """Draw a row of any bytes, mostly near the borders of what is allowed."""
    row = np.zeros(1, fixed_layout(kind.kind).dtype)
    for name in row.dtype.names or ():
        field = row.dtype[name]
        if field.kind == "f":
            row[name] = data.draw(raw_floats)
        else:
            row[name] = np.uint64(data.draw(raw_numbers)).astype(field)
    return row


def _refusal(kind: type[Event], row: Any) -> str:
    try:
        event_of_row(kind, row, None)
    except InvalidEventError as error:
        return str(error)
    return ""


@pytest.mark.slow
@settings(max_examples=400, deadline=None)
@given(st.sampled_from(FIXED), st.integers(1, 3), st.data())
def test_rows_are_refused_as_events_are(kind: type[Event], count: int, data: st.DataObject) -> None:
    """Whatever the values: rows pass where events can be made of them, else the first is named."""
    rows = np.concatenate([_raw(data, kind) for _ in range(count)])
    said = [_refusal(kind, row) for row in rows]
    refused = next((f"row {i}: {text}" for i, text in enumerate(said) if text), None)

    if refused is None:
        check_rows(kind, rows)
    else:
        with pytest.raises(InvalidEventError) as told:
            check_rows(kind, rows)
        assert refused == str(told.value)


REQUESTED = DoorRequested(door_id=DoorId(1), state=DoorState.OPEN)


def _batch(**other: Any) -> EventBatch:
    """Return two sightings, with some of the batch's columns others."""
    return replace(EventBatch.of(DoorObserved, door_id=[1, 2], state=1, happened_ns=5), **other)


@pytest.mark.parametrize(
    ("batch", "message"),
    [
        (_batch(kind=np.full(2, DoorRequested.kind, np.uint8)), "kind: expected rows as in the"),
        (_batch(kind=np.full(3, DoorObserved.kind, np.uint8)), "happened_ns: expected int64"),
        (_batch(happened_ns=np.array([1.0, 2.0])), "happened_ns: expected int64"),
        (_batch(happened_ns=np.array([1, -2])), "row 1: happened_ns: .* got -2"),
        (_batch(columns={4: np.zeros(2, [("door_id", "u8")])}), "expected rows of"),
        (_batch(columns={}, objects={4: [REQUESTED] * 2}), "kind: expected kinds of fixed size"),
        (_batch(columns={99: np.zeros(2)}, kind=np.full(2, 99, np.uint8)), r"got \[99\]"),
        (_batch(columns={}, objects={11: [REQUESTED] * 2}, kind=np.full(2, 11, np.uint8)),
         "objects: expected DoorAnnotated"),
    ],
)  # fmt: skip
def test_columns_that_do_not_fit_each_other_are_refused(batch: EventBatch, message: str) -> None:
    """A batch can be put together by hand, too."""
    with pytest.raises(InvalidEventError, match=message):
        batch.check()


def test_defaults_are_those_of_the_event() -> None:
    """Also where the default is no number that a column of integers could hold."""
    batch = EventBatch.of(DoorUpdated, door_id=[1], changed=Changed.STATE, state=DoorState.MOVING)
    added = EventBatch.of(DoorAdded, door_id=[1, 2])

    expected = DoorUpdated(door_id=DoorId(1), changed=Changed.STATE, state=DoorState.MOVING)
    assert same(expected, next(iter(batch)).event)
    assert same(DoorAdded(door_id=DoorId(1)), next(iter(added)).event)


def test_batches_of_one_kind_can_be_mixed() -> None:
    """In any order, each kind's events in their own."""
    seen = EventBatch.of(DoorObserved, door_id=[1, 2], state=1, happened_ns=[10, 30])
    passed = EventBatch.of(DoorPassed, door_id=3, passed=True, happened_ns=20)

    mixed = EventBatch.mixed([DoorObserved.kind, DoorPassed.kind, DoorObserved.kind], seen, passed)

    found = [(type(row.event).__name__, row.happened_ns) for row in mixed]
    assert [("DoorObserved", 10), ("DoorPassed", 20), ("DoorObserved", 30)] == found


@pytest.mark.parametrize("kinds", [[4, 4], [4, 4, 6, 6], [4, 4, 6, 5], [4, 6, 6]])
def test_what_is_mixed_must_be_all_there(kinds: list[int]) -> None:
    """No event left out, none made up."""
    seen = EventBatch.of(DoorObserved, door_id=[1, 2], state=1)
    passed = EventBatch.of(DoorPassed, door_id=3, passed=True)

    with pytest.raises(InvalidEventError, match="kinds: expected"):
        EventBatch.mixed(kinds, seen, passed)


def stored(kind: type[Event], rows: np.ndarray[Any, Any]) -> EventBatch:
    """Return rows as a log that somebody else wrote may hold them."""
    count = len(rows)
    numbers = np.arange(count)
    kinds = np.full(count, kind.kind, np.uint8)
    return EventBatch(numbers, kinds, numbers + 5, numbers + 9, {kind.kind: rows}, {})


def test_what_no_event_can_hold_is_refused_when_it_comes() -> None:
    """Those before it come; a state of a later version is UNKNOWN."""
    rows = (
        EventBatch.of(DoorObserved, door_id=[1, 2, 3], state=[1, 2, 1])
        .columns[DoorObserved.kind]
        .copy()
    )
    rows["state"][0], rows["accuracy_open"][2] = 77, 7.0
    told = iter(stored(DoorObserved, rows))

    assert DoorState.UNKNOWN is next(told).event.state  # type: ignore[attr-defined]
    assert DoorState.CLOSED is next(told).event.state  # type: ignore[attr-defined]
    with pytest.raises(InvalidEventError, match=r"accuracy_open"):
        next(told)


@given(st.lists(fixed_size, min_size=1, max_size=20))
def test_events_made_at_once_are_those_made_one_by_one(told: list[Event]) -> None:
    """Equal in every field, whatever their kinds."""
    batch = EventBatch.from_events(told)

    assert [repr(event) for event in told] == [repr(row.event) for row in batch]
