"""Who saw it: the notes of commits tell one robot's hundred sightings from two robots' two."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.probabilities.evidence.day_tables import day_tables
from semmap_log.analysis.probabilities.evidence.evidence import (
    DoorEvidence,
    Evidence,
    EvidenceProjection,
)
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorObserved
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.telling import DOOR, added, as_batch, known, ns_of, points, seen

LOG_9 = math.log(9)


def saw(seconds: float, accuracy: float = 0.9, state: str = "open") -> DoorObserved:
    said = DoorState.parse(state)
    return DoorObserved(
        door_id=DOOR,
        state=said,
        accuracy_open=accuracy,
        accuracy_closed=accuracy,
        happened_ns=ns_of(seconds),
    )


def seen_by(path: Path, *sightings: tuple[str, DoorObserved]) -> DoorEvidence:
    """Return the evidence of a log with these (source, sighting), each a commit."""
    return evidence_of(path, *sightings).door(DOOR)


def evidence_of(path: Path, *sightings: tuple[str, DoorObserved]) -> Evidence:
    with sl.create(path / "log", tz="UTC", durability="none") as log:
        log.append(as_batch([added()]))
        for source, sighting in sightings:
            log.append([sighting], note=Note(source=source))
    return sl.read(path / "log").fold(EvidenceProjection())


def test_two_robots_that_pass_in_one_minute_are_two_visits(tmp_path: Path) -> None:
    """Of the same kind of sensor, seconds apart; each looks ten times."""
    told = [("tug1" if i % 2 else "tug2", saw(i)) for i in range(20)]

    found = seen_by(tmp_path, *told)

    assert 2 == found.is_visit.sum()
    assert 2 * LOG_9 == pytest.approx(found.llr.sum())


def test_a_robot_that_is_not_always_as_sure_makes_one_visit(tmp_path: Path) -> None:
    """A confidence of its own for each picture: a hundred are not a hundred proofs."""
    told = [("tug1", saw(i / 10, 0.8 + i / 1000)) for i in range(100)]

    found = seen_by(tmp_path, *told)

    assert 1 == found.is_visit.sum()
    mean = sum(math.log(s.accuracy_open / (1 - s.accuracy_open)) for _, s in told) / 100
    assert mean == pytest.approx(found.llr.sum())


def test_unsure_sightings_of_a_visit_count_by_what_they_tell(tmp_path: Path) -> None:
    """One reading at 90 % and one at 70 %, in one pass: their hour gets the mean of both."""
    found = seen_by(tmp_path, ("tug1", saw(0, 0.9)), ("tug1", saw(1, 0.7, "closed")))

    tables = day_tables(found, LocalClock("UTC"))

    tell, said = (0.8**2 + 0.4**2) / 2, (0.8 * 0.9 - 0.4 * 0.3) / 2
    assert pytest.approx(tell) == tables.known_h[0, 0]
    assert pytest.approx(said) == tables.open_h[0, 0]


def test_without_a_source_the_accuracies_tell_sensors_apart(tmp_path: Path) -> None:
    """As well as they can: a log says the same as the events alone."""
    told = [seen("open", 0), seen("open", 1, 0.7), seen("closed", 2)]

    found = seen_by(tmp_path, *(("", event_at(word)) for word in told))

    alone = known(added(), *told)
    assert points(alone) == points(found)
    assert alone.visit.tolist() == found.visit.tolist()
    assert alone.llr.tolist() == found.llr.tolist()


def event_at(told: tuple[float, object]) -> DoorObserved:
    seconds, event = told
    assert isinstance(event, DoorObserved)
    return saw(seconds, event.accuracy_open, event.state.name)


def test_sources_go_through_a_checkpoint_and_into_other_evidence(tmp_path: Path) -> None:
    """Saved and loaded, and merged with what others made of other events."""
    told = [("tug1" if i % 2 else "tug2", saw(i)) for i in range(6)]
    evidence = evidence_of(tmp_path, *told)
    projection = EvidenceProjection()

    loaded = projection.load(projection.dump(evidence))
    log = sl.read(tmp_path / "log")
    merged = projection.merge(log.fold_part(projection, 0, 2), log.fold_part(projection, 3, 6))

    for other in (loaded, merged):
        assert evidence.door(DOOR).visit.tolist() == other.door(DOOR).visit.tolist()
        assert evidence.door(DOOR).llr.tolist() == other.door(DOOR).llr.tolist()
