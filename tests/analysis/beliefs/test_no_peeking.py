"""No method looks ahead: an evaluation hands out a whole log's evidence, and trusts in that."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.analysis.beliefs.protocol import Patrol, visited
from semmap_log.analysis.beliefs.trials import StateIntervals
from semmap_log.analysis.probabilities.belief_fold import ESTIMATORS, by_name
from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorUpdated
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import HOUR_NS, hours_ns, random_stretches

VIENNA = LocalClock("Europe/Vienna")
DAYS = 24
DOORS = (DoorId(1), DoorId(2))


def stretches(seed: int) -> StateIntervals:
    start, end, is_open = zip(
        *random_stretches(np.random.default_rng(seed), DAYS * 24), strict=True
    )
    return StateIntervals(hours_ns(start), hours_ns(end), np.array(is_open))


def known_all_through() -> Evidence:
    evidence = Evidence()
    for door_id in DOORS:
        truth = stretches(door_id)
        times_ns = np.stack([truth.start_ns, truth.end_ns], axis=1).ravel()
        states = np.stack([np.where(truth.is_open, 1, 2), np.zeros(len(truth.is_open))], axis=1)
        evidence.apply(EventBatch.of(DoorAdded, happened_ns=times_ns[:1], door_id=door_id))
        evidence.apply(
            EventBatch.of(
                DoorUpdated, happened_ns=times_ns, door_id=door_id, changed=4,
                state=states.ravel().astype(np.uint8),
            )
        )  # fmt: skip
    return evidence


SOURCES = {
    "known": known_all_through(),
    "visited": visited({door_id: stretches(door_id) for door_id in DOORS}, Patrol()),
}


@pytest.mark.parametrize("source", list(SOURCES))
@pytest.mark.parametrize("name", [*ESTIMATORS, "fremen2"])
def test_what_is_later_than_known_never_matters(name: str, source: str) -> None:
    """From a log's whole evidence, and from what it was at a moment, come the same forecasts."""
    evidence = SOURCES[source]
    whole = by_name(name).learn(evidence.up_to(), VIENNA)
    cut_ns = int(hours_ns(15 * 24 + 7.3))
    cut = by_name(name).learn(evidence.up_to(cut_ns), VIENNA)
    rng = np.random.default_rng(3)
    known_ns = np.append(hours_ns(rng.uniform(24, 15 * 24 + 7, 40)), cut_ns)
    times_ns = known_ns + hours_ns(rng.uniform(0, 30, 41)) - hours_ns(0)

    for door_id in DOORS:
        found, expected = (learnt.predict(door_id, times_ns, known_ns) for learnt in (whole, cut))

        assert_same(found, expected)


@st.composite
def told(draw: st.DrawFn) -> list[EventBatch]:
    """Draw what was said of a door over some days: set, unset, and seen, again and again.

    Years may lie between two of them.
    """
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    days, count = draw(st.integers(1, 20)), draw(st.integers(1, 400))
    share_set = draw(st.sampled_from([0.0, 0.1, 0.5, 1.0]))
    times_ns = np.sort(hours_ns(rng.uniform(0, 24 * days, count)))
    times_ns = np.sort(np.append(times_ns, times_ns[rng.random(count) < 0.3] + 7 * 10**9))
    for gap_d in draw(st.lists(st.sampled_from([60, 85, 86, 100, 700, 20_000]), max_size=2)):
        times_ns[rng.integers(len(times_ns)) :] += gap_d * 24 * HOUR_NS
    is_set = rng.random(len(times_ns)) < share_set
    states = rng.choice([0, 1, 2], len(times_ns), p=[0.1, 0.5, 0.4]).astype(np.uint8)
    accuracy = rng.choice([0.6, 0.9, 0.95, 1.0], len(times_ns))
    return [
        EventBatch.of(DoorAdded, happened_ns=times_ns[:1], door_id=DOORS[0]),
        EventBatch.of(DoorUpdated, happened_ns=times_ns[is_set], door_id=DOORS[0], changed=4,
                      state=states[is_set]),
        EventBatch.of(DoorObserved, happened_ns=times_ns[~is_set], door_id=DOORS[0],
                      state=states[~is_set], accuracy_open=accuracy[~is_set],
                      accuracy_closed=rng.permutation(accuracy)[~is_set]),
    ]  # fmt: skip


@pytest.mark.parametrize("name", [*ESTIMATORS, "fremen2", "fremen84"])
@settings(max_examples=8, deadline=None)
@given(batches=told(), share=st.floats(0, 1), seed=st.integers(0, 2**32 - 1))
def test_no_last_digit_depends_on_the_future(
    name: str, batches: list[EventBatch], share: float, seed: int
) -> None:
    """What is known at T by events up to T is bit for bit what all events say was known at T."""
    times = np.concatenate([batch.folds_ns for batch in batches])
    first_ns, last_ns = int(times.min()), int(times.max())
    cut_ns = min(first_ns + int(share * (last_ns - first_ns)), last_ns)  # which floats round
    by_then, ever = Evidence(), Evidence()
    for batch in batches:
        by_then.apply(batch.select(batch.folds_ns <= cut_ns))
        ever.apply(batch)
    rng = np.random.default_rng(seed)
    seen_ns = rng.choice(times[times <= cut_ns], 6) + rng.integers(0, 90 * 24 * HOUR_NS, 6)
    known_ns = np.concatenate(
        [rng.integers(first_ns, cut_ns + 1, 12), np.minimum(seen_ns, cut_ns), [cut_ns]]
    )
    times_ns = known_ns + (hours_ns(rng.choice([0.0, 0.7, 30.0, 500.0], 19)) - hours_ns(0))
    same = [by_name(name).learn(told.up_to(ns), VIENNA)
            for told, ns in ((by_then, cut_ns), (ever, None))]  # fmt: skip

    assert_same(*(learnt.predict(DOORS[0], times_ns, known_ns) for learnt in same))


@pytest.mark.parametrize("name", list(ESTIMATORS))
def test_before_a_door_was_seen_it_matters_to_nobody_when_it_will_be(name: str) -> None:
    """Days are counted from the first sighting: where there is none yet, only the prior speaks."""
    first_ns, cut_ns, seen_ns = (int(hours_ns(hours)) for hours in (9.5, 60.2, 80.7))
    evidence = Evidence()
    evidence.apply(EventBatch.of(DoorAdded, happened_ns=np.array([first_ns]), door_id=DOORS[0]))
    evidence.apply(
        EventBatch.of(DoorObserved, happened_ns=np.array([seen_ns]), door_id=DOORS[0], state=1,
                      accuracy_open=0.95, accuracy_closed=0.6)
    )  # fmt: skip
    known_ns = np.array([first_ns, first_ns + 10**9, cut_ns])
    times_ns = known_ns + 40 * 60 * 10**9
    whole, cut = (by_name(name).learn(evidence.up_to(ns), VIENNA) for ns in (None, cut_ns))

    assert_same(*(learnt.predict(DOORS[0], times_ns, known_ns) for learnt in (whole, cut)))


def assert_same(found: Forecast, expected: Forecast) -> None:
    """Assert that two forecasts are the same bit for bit."""
    for name in ("p_open", "low", "high", "is_known", "effective_days"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), name)


@pytest.mark.parametrize("name", list(ESTIMATORS))
def test_a_method_bears_its_name(name: str) -> None:
    """What the command line calls it is what its figures are labelled with."""
    assert name == by_name(name).name
