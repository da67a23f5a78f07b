"""What is believed, written into the map."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.applying import apply_probabilities
from semmap_log.analysis.beliefs.door_beliefs import HOUR_NS, probabilities
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import Changed, DoorUpdated
from semmap_log.errors import CommandReusedError, UnexpectedEventError
from tests.analysis.beliefs.patrolled import ATTIC, FRONT, STORE, patrolled


@pytest.fixture
def path(tmp_path: Path) -> Path:
    patrolled(tmp_path / "log", days=10)
    return tmp_path / "log"


def test_one_commit_sets_both_numbers_of_the_known_doors(path: Path) -> None:
    """To six digits, with sum 1; the unknown door is left alone and named; no state is set."""
    believed = probabilities(sl.read(path))

    with sl.append(path) as log:
        done = apply_probabilities(log, note=sl.Note(actor="job"))

    after = sl.read(path)
    doors = after.replay().doors
    assert done.appended is not None
    assert 2 == done.appended.count
    assert [FRONT, STORE] == [belief.door.door_id for belief in done.written]
    assert [ATTIC] == [belief.door.door_id for belief in done.unknown]
    for belief in believed[:2]:
        door = doors[belief.door.door_id]
        assert round(belief.p_open, 6) == door.prob_open
        assert 1.0 == door.prob_open + door.prob_closed
    assert doors[ATTIC].prob_open != doors[ATTIC].prob_open  # NaN: not given
    events = [after.event(n).event for n in range(done.appended.first_event,
                                                  done.appended.first_event + 2)]  # fmt: skip
    assert all(isinstance(event, DoorUpdated) for event in events)
    assert {Changed.PROB_OPEN | Changed.PROB_CLOSED} == {event.changed for event in events}
    assert [DoorState.CLOSED] * 2 == [doors[d].state for d in (FRONT, STORE)]


def test_the_note_tells_where_the_numbers_are_from(path: Path) -> None:
    """Estimator, moment and evidence, beside who did it."""
    with sl.append(path) as log:
        done = apply_probabilities(log, estimator="schedule", note=sl.Note(actor="job"))
        assert done.appended is not None
        note = done.appended.commit.note

    assert ("job", "probabilities (schedule)") == (note.actor, note.source)
    assert "known at 2026-03-11 19:30:00+01:00: 2 doors, 260 sightings" in note.reason


def test_a_second_time_nothing_is_written(path: Path) -> None:
    """The numbers are no evidence: what is believed stays, and it is in the map already."""
    with sl.append(path) as log:
        first = apply_probabilities(log)
        second = apply_probabilities(log)

    assert first.appended is not None
    assert second.appended is None
    assert [] == second.written
    assert [(b.p_open, b.evidence.counts.words) for b in first.beliefs] == [
        (b.p_open, b.evidence.counts.words) for b in second.beliefs
    ]


def test_new_evidence_is_written_again(path: Path) -> None:
    """Only for the door that it changes anything for; the store's numbers go on to hold."""
    with sl.append(path) as log:
        apply_probabilities(log, estimator="last")
        log.observe(FRONT, "open", accuracy=0.9, at="2026-03-11T19:50")
        again = apply_probabilities(log, estimator="last", doors=["front"])

    assert [FRONT] == [belief.door.door_id for belief in again.written]


def test_the_same_command_is_stored_once(path: Path) -> None:
    """Sent again it is answered as the first time; for something else its id is refused."""
    command = bytes(range(16))
    with sl.append(path) as log:
        first = apply_probabilities(log, command_id=command)
        again = apply_probabilities(log, command_id=command)
        with pytest.raises(CommandReusedError):
            apply_probabilities(log, command_id=command, horizon_ns=HOUR_NS)

    assert first.appended is not None
    assert again.appended is not None
    assert again.appended.repeated
    assert first.appended.first_event == again.appended.first_event


def test_a_log_that_went_on_is_left_alone(path: Path) -> None:
    """If the caller expects another last event, nothing is written."""
    with sl.append(path) as log, pytest.raises(UnexpectedEventError):
        apply_probabilities(log, expected_event=3)

    assert [] == list(sl.read(path).history(kinds=[DoorUpdated]))
