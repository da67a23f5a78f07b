"""The fold of evidence against a plain one: any events, in any order, up to any time."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.analysis.probabilities.evidence.evidence import (
    DoorEvidence,
    Evidence,
    EvidenceProjection,
)
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
    PatrolStarted,
)
from tests.analysis.probabilities.slow_evidence import (
    DAY_NS,
    SECOND_NS,
    SlowEvidence,
    Word,
    are_in_order,
    joined_up,
    sightings_of,
    stretches_of,
)
from tests.batches import batch_of

DOOR = DoorId(1)
LATE_NS = 10**18
"""When all is recorded: behind everything that happens."""
STEPS_NS = [
    *(seconds * SECOND_NS for seconds in (0, 0, 1, 30, 59, 60, 240, 300, 301)),
    *(days * DAY_NS for days in (1, 29, 30)),
    30 * DAY_NS + 1,
]

accuracies = st.sampled_from([(0.9, 0.9), (0.9, 0.9), (0.7, 0.95), (1.0, 1.0), (0.5, 0.5)])
some_states = st.sampled_from([*DoorState, DoorState.OPEN, DoorState.CLOSED])
doors = st.sampled_from([DOOR, DOOR, DOOR, DoorId(2)])


@st.composite
def words(draw: st.DrawFn) -> Event:
    kind = draw(st.sampled_from("SSSSSSUUUPRX"))
    door = draw(doors)
    if kind == "S":
        a, b = draw(accuracies)
        state = draw(some_states)
        return DoorObserved(door_id=door, state=state, accuracy_open=a, accuracy_closed=b)
    if kind == "U":
        changed = draw(st.sampled_from([Changed.STATE, Changed.STATE, Changed.PROB_OPEN]))
        return DoorUpdated(door_id=door, changed=changed, state=draw(some_states))
    if kind == "P":
        return DoorPassed(door_id=door, passed=draw(st.booleans()))
    if kind == "R":
        return DoorRemoved(door_id=DoorId(2))
    return PatrolStarted(patrol=1)


@st.composite
def told(draw: st.DrawFn) -> list[tuple[int, Event]]:
    """Draw (happened, event): the first of each door is its adding, as it is in logs."""
    drawn: list[Event] = draw(st.lists(words(), max_size=40))
    added = [DoorAdded(door_id=door, state=draw(some_states)) for door in (1, 2)]
    steps = draw(st.lists(st.sampled_from(STEPS_NS), min_size=42, max_size=42))
    times = (DAY_NS + np.cumsum(steps)).tolist()
    removed = False
    events = []
    for event in [*added, *drawn]:
        if not (isinstance(event, DoorRemoved) and removed):
            events.append(event)
        removed = removed or isinstance(event, DoorRemoved)
    return list(zip(times, events, strict=False))


def as_batch(happened: Sequence[tuple[int, Event]]) -> EventBatch:
    """Return events as a log has them that learns of them in this order."""
    events = [replace(event, happened_ns=ns) for ns, event in happened]
    return batch_of(events, recorded_ns=range(LATE_NS, LATE_NS + len(events)))


def as_words(batch: EventBatch) -> list[Word]:
    times = batch.folds_ns.tolist()
    listed = [Word(ns, one.number, one.event) for ns, one in zip(times, batch, strict=True)]
    return [word for word in listed if hasattr(word.event, "door_id")]


def folded(*batches: EventBatch) -> Evidence:
    evidence = Evidence()
    for batch in batches:
        evidence.apply(batch)
    return evidence


def same(one: DoorEvidence, other: DoorEvidence) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in DoorEvidence.__dataclass_fields__
    )


@pytest.mark.slow
@settings(max_examples=120, deadline=None)
@given(told(), st.randoms(use_true_random=False))
def test_at_any_time_it_is_what_a_plain_reading_of_the_events_up_to_then_says(
    happened: list[tuple[int, Event]], dice: random.Random
) -> None:
    """Late events, equal times, gaps, bursts, sensors that mix."""
    if dice.random() < 0.5:
        dice.shuffle(happened)
    batch = as_batch(happened)
    evidence = folded(batch)
    times = {ns + step for ns, _ in happened for step in (-1, 0, 1)} | {LATE_NS}

    for until_ns in times:
        for door in (DOOR, DoorId(2)):
            found = evidence.door(door, until_ns)
            plain = SlowEvidence().read(as_words(batch), door, until_ns)

            assert are_in_order(found)
            assert joined_up(plain.stretches) == joined_up(stretches_of(found))
            mine = sightings_of(found)
            assert [s._replace(llr=0) for s in plain.sightings] == [s._replace(llr=0) for s in mine]
            assert [s.llr for s in plain.sightings] == pytest.approx(
                [s.llr for s in mine], abs=1e-8
            )
            assert plain.visits == evidence.counts(door, until_ns).visits


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(told(), st.randoms(use_true_random=False))
def test_events_come_in_any_order_and_in_batches_of_any_size(
    happened: list[tuple[int, Event]], dice: random.Random
) -> None:
    """Live, replayed, in parts that are merged, through a checkpoint: the very same numbers."""
    batch = as_batch(happened)
    whole = folded(batch)
    parts = list(batch.parts(dice.randint(1, 7)))
    projection = EvidenceProjection()
    cut = dice.randint(0, len(parts))
    live = Evidence()
    for part in parts:
        live.apply(part)
        live.door(DOOR)
    shuffled = dice.sample(parts, len(parts))

    others = [
        live,
        folded(*shuffled),
        projection.merge(folded(*parts[:cut]), folded(*parts[cut:])),
        folded(),
    ]
    others[-1] = projection.load(projection.dump(folded(*parts[:cut])))
    for part in parts[cut:]:
        others[-1] = projection.apply(others[-1], part)

    for other in others:
        assert whole.door_ids == other.door_ids
        assert all(same(whole.door(door), other.door(door)) for door in whole.door_ids)
        assert whole.latest_ns == other.latest_ns


@settings(max_examples=50, deadline=None)
@given(told(), st.integers(0, 60))
def test_events_after_a_time_move_nothing_at_that_time(
    happened: list[tuple[int, Event]], place: int
) -> None:
    """The evidence up to T is bit for bit that of a log in which nothing ever happened after T."""
    until_ns = happened[min(place, len(happened) - 1)][0]

    before = folded(as_batch([(ns, event) for ns, event in happened if ns <= until_ns]))
    after = folded(as_batch(happened))

    for door in before.door_ids:
        assert same(before.door(door, until_ns), after.door(door, until_ns))
        assert before.counts(door, until_ns) == after.counts(door, until_ns)
