"""Registers: of many writes to one, in a batch or before it, that with the last stamp stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorEvent,
    DoorObserved,
    DoorPassed,
    DoorUpdated,
    Event,
    PatrolStarted,
)
from tests.strategies import events

DOOR = DoorId(1)
ADDED = DoorAdded(happened_ns=1, door_id=DOOR)
OPENED = DoorPassed(happened_ns=5, door_id=DOOR, passed=True)
CLOSED = DoorUpdated(happened_ns=5, door_id=DOOR, changed=Changed.STATE, state=DoorState.CLOSED)
MOVING = DoorObserved(happened_ns=5, door_id=DOOR, state=DoorState.MOVING)


@pytest.mark.parametrize("parts", [1, 2, 4])
@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ((OPENED, CLOSED, MOVING), DoorState.MOVING),
        ((MOVING, OPENED, CLOSED), DoorState.CLOSED),
        ((CLOSED, MOVING, OPENED), DoorState.OPEN),
    ],
)
def test_of_writes_at_one_time_that_of_the_last_number_stays(
    told: tuple[Event, ...], expected: DoorState, parts: int
) -> None:
    """Whatever kinds of events they are, and whether they come together or one by one."""
    batch = EventBatch.from_events([ADDED, *told])
    state = DoorMapState()

    for part in batch.parts(len(batch) // parts):
        state.apply(part)

    assert expected == state.door_map().doors[DOOR].state


def test_an_earlier_part_that_comes_later_changes_nothing_newer() -> None:
    """The fold commutes: the parts of a batch in reverse give the same state."""
    latest = DoorPassed(happened_ns=9, door_id=DOOR, passed=True)
    batch = EventBatch.from_events([ADDED, latest, MOVING, CLOSED])
    forward, backward = DoorMapState(), DoorMapState()

    for part in batch.parts(1):
        forward.apply(part)
    for part in reversed(list(batch.parts(1))):
        backward.apply(part)

    assert _told(forward) == _told(backward)


def test_what_is_about_no_door_leaves_every_door_alone() -> None:
    """Its row is nobody's, also when doors have filled all others."""
    state = DoorMapState()
    for i in range(1, 60):
        added = DoorAdded(happened_ns=i, door_id=DoorId(i))
        batch = EventBatch.from_events([added, PatrolStarted(happened_ns=i, patrol=i)])
        numbers = np.arange(2 * i, 2 * i + 2)
        state.apply(EventBatch(numbers, batch.kind, batch.happened_ns, batch.happened_ns,
                               batch.columns, batch.objects))  # fmt: skip

        assert [2 * n for n in range(1, i + 1)] == [
            state.last_event(door_id) for door_id in range(1, i + 1)
        ]


def _told(state: DoorMapState) -> str:
    return str({name: np.asarray(values).tolist() for name, values in state.to_arrays().items()})


def _near(event: Event, door_id: int, happened_ns: int) -> Event:
    """Return it about one of few doors, at one of few times, so that events meet."""
    about = {"door_id": DoorId(door_id)} if isinstance(event, DoorEvent) else {}
    return replace(event, happened_ns=happened_ns, **about)


some = st.builds(_near, events, st.integers(0, 3), st.integers(0, 5))


@settings(max_examples=200, deadline=None)
@given(st.lists(some, max_size=30), st.randoms(use_true_random=False))
def test_events_one_by_one_in_any_order_make_the_state_of_their_batch(told, dice) -> None:
    """`apply_one` and `apply` say the same of every kind."""
    together, single = DoorMapState(), DoorMapState()
    together.apply(EventBatch.from_events(told))

    for number, event in dice.sample(list(enumerate(told)), len(told)):
        single.apply_one(event, number)

    np.testing.assert_equal(single.to_arrays(), together.to_arrays())
