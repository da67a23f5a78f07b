"""How likely doors are open, from the log alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import (
    HOUR_NS,
    LATER,
    default_estimator,
    probabilities,
)
from semmap_log.core.model.events import DoorObserved
from semmap_log.core.model.moments import parse_instant
from semmap_log.errors import EstimatorError, MomentError, UnknownDoorError
from tests.analysis.beliefs.patrolled import ATTIC, FRONT, STORE, VIENNA, patrolled
from tests.conftest import SteadyClock


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    return patrolled(tmp_path_factory.mktemp("beliefs") / "log")


def test_doors_get_what_their_evidence_says(log: sl.DoorLog) -> None:
    """The front door is likely open at noon of a working day, the store is not."""
    front, store, attic = probabilities(log, at="2026-03-27T12:00")

    assert (FRONT, STORE, ATTIC) == (front.door.door_id, store.door.door_id, attic.door.door_id)
    assert front.is_known
    assert front.p_open > 0.7
    assert front.low <= front.p_open <= front.high
    assert store.is_known
    assert store.p_open < 0.3
    assert store.low <= store.p_open <= store.high
    assert not attic.is_known
    assert attic.evidence.is_empty
    assert 1.0 == front.p_open + front.p_closed


def test_the_evidence_is_told(log: sl.DoorLog) -> None:
    """28 days of 13 looks and the adding; how many hours of the week are unseen; the last look."""
    (front,) = probabilities(log, doors=["front"])

    seen = front.evidence
    assert (28 * 13 + 1, 28 * 13) == (seen.counts.words, seen.counts.sightings)
    assert 28 * 13 == seen.counts.visits
    assert 28 * 13 / 24 == pytest.approx(seen.coverage.days)
    assert 7 * 11 == seen.coverage.hours_never_seen
    assert parse_instant("2026-03-29T19:30", tz=VIENNA) == seen.counts.last_seen_ns


def test_what_comes_later_does_not_count(tmp_path: Path, log: sl.DoorLog) -> None:
    """A moment's answer is that of a log which ended then."""
    shorter = patrolled(tmp_path / "short", days=14)

    then = probabilities(log, at="2026-03-15T21:00")
    ended = probabilities(shorter, at="2026-03-15T21:00")

    assert [(b.p_open, b.low, b.high, b.is_known) for b in ended] == [
        (b.p_open, b.low, b.high, b.is_known) for b in then
    ]
    assert 14 * 13 == then[0].evidence.counts.sightings


def test_at_counts_what_is_known_today_and_known_at_what_was_known_then(log: sl.DoorLog) -> None:
    """At a day's noon only the looks of the days before were known."""
    (known,) = probabilities(log, known_at="2026-03-03T12:00", doors=[FRONT])
    (true,) = probabilities(log, at="2026-03-03T12:00", doors=[FRONT])
    (both,) = probabilities(log, at="2026-03-03T12:00", known_at="2026-03-03T12:00", doors=[FRONT])
    looks = log.batches("2026-03-03", "2026-03-03T12:00:00.000000001", kinds=[DoorObserved],
                        doors=[FRONT])  # fmt: skip

    assert 13 == known.evidence.counts.sightings
    assert (known.p_open, known.low, known.high) == (both.p_open, both.low, both.high)
    assert 13 + sum(map(len, looks)) == true.evidence.counts.sightings > 13
    assert parse_instant("2026-03-03T12:00", tz=VIENNA) == known.known_ns == true.known_ns


def test_a_horizon_is_asked_for_from_the_moment(log: sl.DoorLog) -> None:
    """From Friday's noon: likely open in two hours, likely closed in two days."""
    soon, weekend = (
        probabilities(log, at="2026-03-27T12:00", horizon_ns=h * HOUR_NS, doors=[FRONT])[0]
        for h in (2, 48)
    )

    assert soon.known_ns + 2 * HOUR_NS == soon.time_ns
    assert soon.p_open > 0.7
    assert weekend.p_open < 0.3
    assert LATER == weekend.estimator == default_estimator(48 * HOUR_NS)


def test_hours_are_those_of_the_building(log: sl.DoorLog) -> None:
    """Told that its clocks are those of Honolulu, the log has other hours unseen."""
    (here,), (there,) = (
        probabilities(log, doors=[FRONT], tz=tz) for tz in (None, "Pacific/Honolulu")
    )

    np.testing.assert_array_equal(here.evidence.coverage.is_seen[:, 12], np.ones(7, bool))
    assert not there.evidence.coverage.is_seen[0, 12]


def test_an_empty_log_has_no_doors_to_tell_of(tmp_path: Path) -> None:
    """That is no error."""
    sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock()).close()

    assert [] == probabilities(sl.read(tmp_path / "log"))


def test_mistakes_are_named(log: sl.DoorLog) -> None:
    """A door, an estimator, a zone that there is not."""
    with pytest.raises(UnknownDoorError, match="nope"):
        probabilities(log, doors=["nope"])
    with pytest.raises(EstimatorError, match="'oracle': expected one of"):
        probabilities(log, estimator="oracle")
    with pytest.raises(MomentError, match="Nix/Da"):
        probabilities(log, tz="Nix/Da")


@pytest.mark.parametrize("days", [90_000, 10**12, -30_000])
def test_a_horizon_ends_where_times_do(log: sl.DoorLog, days: int) -> None:
    """A moment that no time of a log can be is named, not computed with."""
    with pytest.raises(MomentError, match=r"one that ends before 2262"):
        probabilities(log, horizon_ns=days * 24 * HOUR_NS)
