"""No method looks ahead: an evaluation hands out a whole log's evidence, and trusts in that."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.batches.event_batch import EventBatch
from semmap_log.beliefs.patrol import Patrol, visited
from semmap_log.beliefs.trials import StateIntervals
from semmap_log.domain.doors import DoorId
from semmap_log.domain.events import DoorAdded, DoorUpdated
from semmap_log.probabilities.estimators import ESTIMATORS, by_name
from semmap_log.probabilities.evidence.evidence import Evidence
from semmap_log.probabilities.local_clock import LocalClock
from tests.probabilities.known import hours_ns, random_stretches

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
    """
    From a log's whole evidence, and from what it was at a moment, come the same forecasts.
    """
    evidence = SOURCES[source]
    whole = by_name(name).learn(evidence.up_to(), VIENNA)
    cut_ns = int(hours_ns(15 * 24 + 7.3))
    cut = by_name(name).learn(evidence.up_to(cut_ns), VIENNA)
    rng = np.random.default_rng(3)
    known_ns = np.append(hours_ns(rng.uniform(24, 15 * 24 + 7, 40)), cut_ns)
    times_ns = known_ns + hours_ns(rng.uniform(0, 30, 41)) - hours_ns(0)

    for door_id in DOORS:
        found, expected = (learnt.predict(door_id, times_ns, known_ns) for learnt in (whole, cut))

        np.testing.assert_allclose(found.p_open, expected.p_open, atol=1e-9)
        np.testing.assert_allclose(found.low, expected.low, atol=1e-9)
        np.testing.assert_allclose(found.high, expected.high, atol=1e-9)
        assert found.is_known.tolist() == expected.is_known.tolist()


@pytest.mark.parametrize("name", list(ESTIMATORS))
def test_a_method_bears_its_name(name: str) -> None:
    """
    What the command line calls it is what its figures are labelled with.
    """
    assert name == by_name(name).name
