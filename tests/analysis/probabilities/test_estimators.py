"""What holds of every estimator, whatever the evidence and whatever it is asked."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.belief_fold import ESTIMATORS, by_name
from semmap_log.analysis.probabilities.estimator import LearntModel
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import LEAST, MOST
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.errors import EstimatorError
from tests.analysis.probabilities.known import DOOR, evidence, hours_ns, random_stretches

VIENNA = LocalClock("Europe/Vienna")
HOURS = 24 * 40
STRANGER = DoorId(77)


def watched(seed: int) -> DoorEvidence:
    rng = np.random.default_rng(seed)
    return evidence(random_stretches(rng, HOURS, mean_h=rng.uniform(0.2, 20), hole=0.2))


def visited(seed: int) -> DoorEvidence:
    rng = np.random.default_rng(seed)
    times = np.unique(np.round(rng.uniform(0, HOURS, 900), 3))
    reads = rng.random(len(times)) < rng.random()
    return evidence(visits=list(zip(times.tolist(), reads.tolist(), strict=True)))


def always(*, is_open: bool) -> DoorEvidence:
    return evidence([(0.0, float(HOURS), is_open)])


DOORS = {
    "watched": watched(1), "watched, too": watched(2), "visited": visited(3),
    "both": evidence([(5.0, 50.0, True), (90.0, 300.0, False)], [(60.0, True), (70.0, False)]),
    "open": always(is_open=True), "closed": always(is_open=False),
    "seen once": evidence(visits=[(30.2, True)]), "nothing": evidence(),
}  # fmt: skip
"""Evidence of many kinds; what is known ends at `HOURS`."""


def learnt(name: str, told: str) -> LearntModel:
    return by_name(name).learn({DOOR: DOORS[told].up_to(int(hours_ns(HOURS)))}, VIENNA)


def questions(seed: int, count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Return times, and what is known at each: before, in, and after the evidence."""
    rng = np.random.default_rng(seed)
    known_h = rng.uniform(-30, HOURS + 30, count)
    ahead_h = rng.choice([0.0, 0.3, 1.0, 30.0, 900.0], count)
    return hours_ns(known_h + ahead_h), hours_ns(known_h)


@pytest.mark.parametrize("told", list(DOORS))
@pytest.mark.parametrize("name", list(ESTIMATORS))
def test_forecasts_are_probabilities_within_their_interval(name: str, told: str) -> None:
    """LEAST <= low <= P(open) <= high <= MOST; open and closed sum up to 1."""
    found = learnt(name, told).predict(DOOR, *questions(1))

    assert 60 == len(found)
    assert (found.low >= LEAST).all()
    assert (found.low <= found.p_open).all()
    assert (found.p_open <= found.high).all()
    assert (found.high <= MOST).all()
    np.testing.assert_allclose(found.p_open + found.p_closed, 1.0, rtol=1e-15)
    assert (found.effective_days >= 0).all()

    nothing = np.zeros(0, np.int64)
    assert [0, 0] == [
        len(learnt(name, told).predict(door, nothing, nothing)) for door in (DOOR, STRANGER)
    ]


@pytest.mark.parametrize("name", list(ESTIMATORS))
@pytest.mark.parametrize(("told", "door_id"), [("watched", STRANGER), ("nothing", DOOR)])
def test_a_door_never_seen_is_unknown(name: str, told: str, door_id: DoorId) -> None:
    """One half, the widest interval, no days."""
    found = learnt(name, told).predict(door_id, *questions(2))

    assert not found.is_known.any()
    np.testing.assert_allclose(found.p_open, 0.5)
    assert (found.effective_days == 0).all()
    assert found.low.max() < 0.05
    assert found.high.min() > 0.95


@pytest.mark.parametrize("told", ["watched", "visited", "both"])
@pytest.mark.parametrize("name", list(ESTIMATORS))
def test_questions_do_not_move_each_other(name: str, told: str) -> None:
    """In one call, in many, in another order, or learnt anew."""
    times_ns, known_ns = questions(3, 20)
    together = learnt(name, told).predict(DOOR, times_ns, known_ns)
    order = np.random.default_rng(4).permutation(len(times_ns))

    mixed = learnt(name, told).predict(DOOR, times_ns[order], known_ns[order])
    again = learnt(name, told)
    alone = [again.predict(DOOR, times_ns[i : i + 1], known_ns[i : i + 1]) for i in order]

    for column in ("p_open", "low", "high", "is_known"):
        expected = getattr(together, column)[order]
        np.testing.assert_allclose(getattr(mixed, column), expected, atol=1e-12)
        found = [getattr(one, column)[0] for one in alone]
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("told", ["open", "closed"])
@pytest.mark.parametrize("name", list(ESTIMATORS))
def test_a_door_that_never_changed_is_expected_to_stay_so(name: str, told: str) -> None:
    """After forty days no prior holds it back: within three per cent, known, at any hour."""
    times_ns = hours_ns(HOURS - 1 + np.arange(0, 24, 0.5))

    found = learnt(name, told).predict(DOOR, times_ns, np.full(48, hours_ns(HOURS - 1)))

    stays = found.p_open if told == "open" else found.p_closed
    assert stays.min() > 0.97
    assert found.is_known.all()


def test_fremen_is_there_in_all_its_orders() -> None:
    """By name from 1 to 84, each bearing its own; others are refused, and what there is is said."""
    assert ["fremen1", "fremen84"] == [by_name(name).name for name in ("fremen1", "fremen84")]

    for name in ("fremen0", "fremen85", "fremen", "Filter", ""):
        with pytest.raises(EstimatorError, match=r"schedule, count.* fremen1\.\.fremen84"):
            by_name(name)
