"""Taking events back: what it hides, from whom, and what cannot be taken back."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorObserved,
    DoorUpdated,
    LevelAdded,
    Retracted,
    RobotPose,
)
from semmap_log.errors import (
    CommandError,
    CommandReusedError,
    DoorExistsError,
    DoorRemovedError,
    UnexpectedEventError,
    UnknownDoorError,
)
from semmap_log.log.door_log.known_past import newly_hidden
from tests.conftest import SteadyClock
from tests.log.replay.test_fold import expected_numbers
from tests.test_replay import random_log


@pytest.fixture
def log(tmp_path: Path):
    """A log that is written: door 1 added and named (0, 1), seen closed, open, closed (2, 3, 4)."""
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock()) as log:
        door = log.add_door(name="front", state="unknown")
        for state in ("closed", "open", "closed"):
            log.observe(door, state)
        yield log


def test_it_is_one_event_in_a_commit_of_its_own(log: sl.DoorLogWriter) -> None:
    """With who and why."""
    commit = log.retract(3, 4, actor="porter", reason="dirty lens").commit

    event = log.event(5).event
    assert isinstance(event, Retracted)
    assert (5, 1) == (commit.first_event, commit.count)
    assert (3, 4) == (event.first_event, event.last_event)
    assert ("porter", "dirty lens") == (commit.note.actor, commit.note.reason)


def test_what_was_true_leaves_it_out_and_what_was_known_does_not(log: sl.DoorLogWriter) -> None:
    """`at` a moment between the events, `known_at` and `event` before and after the retraction."""
    seen = [log.event(number) for number in (2, 3, 4)]
    taken_back = log.retract(3).commit.recorded_ns
    between = seen[1].happened_ns + 1

    def state(**moment: int) -> DoorState:
        return log.replay(**moment)[DoorId(1)].state

    assert DoorState.CLOSED is state(at=between)
    assert DoorState.OPEN is state(at=between, known_at=taken_back - 1)
    assert DoorState.CLOSED is state(at=between, known_at=taken_back)
    assert DoorState.OPEN is state(known_at=seen[1].recorded_ns)
    assert DoorState.OPEN is state(event=3)
    assert DoorState.CLOSED is state(event=5, at=between)
    assert [False, False, False, True, False, False] == [e.retracted for e in log.history()]
    assert [None, None, None, 5, None, None] == [e.retracted_by for e in log.history()]


def test_a_door_whose_adding_is_taken_back_is_gone_for_good(log: sl.DoorLogWriter) -> None:
    """With its name; its id is not given again, its history stays and is found."""
    log.retract(0)

    assert {} == log.replay().doors
    assert 2 == log.add_door(name="front")
    with pytest.raises(DoorRemovedError, match="never used twice"):
        log.add_door(door_id=DoorId(1))
    with pytest.raises(UnknownDoorError, match="door 1 is not in the map"):
        log.observe(1, "open")
    log.close()
    with sl.append(log.path) as again:
        assert 3 == again.add_door()
        assert 1 == again.resolve_any_door(1)
        with pytest.raises(UnknownDoorError):
            again.resolve_any_door(9)
        assert [0, 1, 2, 3, 4] == [entry.number for entry in again.history(DoorId(1))]


def test_a_name_that_was_taken_back_leads_to_its_history(log: sl.DoorLogWriter) -> None:
    """The door and its name were in one commit, and are gone together."""
    log.retract(0, 1)

    assert 1 == sl.read(log.path).resolve_any_door("front")


def test_a_removal_taken_back_brings_the_door_back(log: sl.DoorLogWriter) -> None:
    """As it was; it takes events again."""
    log.remove_door(1)
    log.retract(5)
    log.observe(1, "open")

    assert DoorState.OPEN is log.replay()[DoorId(1)].state
    assert "front" == log.replay()[DoorId(1)].name


@pytest.mark.parametrize(
    ("first", "last", "why"),
    [
        (7, None, r"cannot retract event 7: the log holds 0\.\.6"),
        (4, 7, r"cannot retract events 4\.\.7: the log holds 0\.\.6"),
        (-1, 2, r"events -1\.\.2: the log holds"),
        (4, 3, r"events 4\.\.3: the range runs backwards; swap the two"),
        (2, None, "event 2: taken back already, by event 5"),
        (2, 3, r"events 2\.\.3: taken back already, by event 5"),
        (5, None, "event 5: event 5 is itself a retraction.*record again what is true"),
        (5, 6, r"events 5\.\.6: event 5 is itself a retraction"),
    ],
)
def test_what_cannot_be_taken_back(
    log: sl.DoorLogWriter, first: int, last: int | None, why: str
) -> None:
    """The message says what is there instead; nothing is written."""
    log.retract(2, 3)
    log.retract(1)

    with pytest.raises(sl.SemmapError, match=why):
        log.retract(first, last)

    assert 6 == log.state.event


def test_in_an_empty_log_there_is_nothing(tmp_path: Path) -> None:
    """Not even event 0."""
    with (
        sl.create(tmp_path / "empty", tz="UTC") as log,
        pytest.raises(CommandError, match="event 0: the log holds none yet"),
    ):
        log.retract(0)


@pytest.mark.usefixtures("patient_poses")
def test_poses_that_wait_are_no_events_yet(log: sl.DoorLogWriter) -> None:
    """They get their numbers in the retraction's own commit: it cannot mean them."""
    log.robot_pose(RobotPose(x=0.0, y=0.0, theta=0.0))

    with pytest.raises(CommandError, match=r"event 5: the log holds 0\.\.4"):
        log.retract(5)
    assert 6 == log.retract(4).first_event


def test_a_range_may_hold_what_is_hidden_and_retractions(log: sl.DoorLogWriter) -> None:
    """Only what is left of it is newly hidden; the retraction in it stays in force."""
    log.retract(2)
    log.observe(1, "open")
    number = log.retract(1, 6).first_event

    assert [1, 3, 4, 6] == [entry.number for entry in newly_hidden(log, number)]
    assert [0, 5, 7] == expected_numbers(log)
    assert log.replay()[DoorId(1)].name is None


def test_sent_again_it_is_stored_once(log: sl.DoorLogWriter) -> None:
    """Though by then all of it is taken back; the same id for other events is an error."""
    command_id = bytes(range(16))
    first = log.retract(3, command_id=command_id)

    again = log.retract(3, command_id=command_id)

    assert (False, True) == (first.repeated, again.repeated)
    assert first.commit == again.commit
    with pytest.raises(CommandReusedError):
        log.retract(4, command_id=command_id)


def test_only_if_the_log_is_as_expected(log: sl.DoorLogWriter) -> None:
    """The last event is the log's, since a range is about no door."""
    with pytest.raises(UnexpectedEventError, match="expected event 3 to be the last of the log"):
        log.retract(3, expected_event=3)

    assert 5 == log.retract(3, expected_event=4).first_event


@pytest.mark.slow
def test_what_each_retraction_hid_adds_up(tmp_path: Path) -> None:
    """In random logs: every hidden event was newly hidden by exactly one retraction."""
    random_log(tmp_path / "random", random.Random(8), commits=300)
    log = sl.read(tmp_path / "random")
    retractions = [e.number for e in log.history(kinds=[Retracted])]

    hidden = [entry.number for n in retractions for entry in newly_hidden(log, n)]

    assert len(retractions) > 3
    assert sorted(hidden) == [entry.number for entry in log.history() if entry.retracted]


def test_a_removal_that_is_taken_back_brings_the_door_back(tmp_path: Path) -> None:
    """Under its id, with all it was; in the same commit more can be said of it at once."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([LevelAdded(level=1, name="L1"), LevelAdded(level=2, name="L2")])
        door = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, level=2, name="front")
        log.add_door(x=5.0, y=2.0, theta=0.0, width=0.9, level=1)
        before = log.replay()[door]
        removed = log.remove_door(door).commit.first_event
        with pytest.raises(DoorRemovedError, match=f"semmap-log retract .*log {removed}$"):
            log.observe(str(door), "open")

        log.append(
            [
                Retracted(first_event=removed, last_event=removed),
                DoorUpdated(door_id=door, changed=Changed.WIDTH, width=0.8),
                DoorObserved(door_id=door, state=DoorState.OPEN),
            ]
        )
        log.observe("front", "closed")
        again = log.remove_door(door).commit.first_event
        refused = [Retracted(first_event=removed - 1, last_event=again)]
        with pytest.raises(DoorRemovedError, match=f"retract .*log {again}$"):
            log.append([*refused, DoorObserved(door_id=door, state=DoorState.OPEN)])
        log.retract(again)
        after = log.replay()[door]

        assert before.pose == after.pose
        assert ("front", 0.8, DoorState.CLOSED) == (after.name, after.width, after.state)
        assert repr(log.state.door(door)) == repr(after)
        with pytest.raises(DoorExistsError):
            log.add_door(door_id=door, level=2)


def test_an_unplaced_door_comes_back_unplaced(tmp_path: Path) -> None:
    """To place it, pose and width are wanted together, as before."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(name="reed contact")
        removed = log.remove_door(door).commit.first_event
        back = Retracted(first_event=removed, last_event=removed)

        with pytest.raises(CommandError, match="has no place yet"):
            log.append([back, DoorUpdated(door_id=door, changed=Changed.WIDTH, width=0.8)])


def test_what_is_said_of_a_removed_door(tmp_path: Path) -> None:
    """Who names it by its id is told of the removal, not that there never was such a door."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(at="2026-03-01T08:00")
        log.remove_door(door, at="2026-03-01T12:00")

        log.observe(str(door), "open", at="2026-03-01T10:00")
        for ask in (
            lambda: log.update_door("1", state="open"),
            lambda: log.annotate("1", "name", "front"),
            lambda: log.remove_door("1"),
            lambda: log.add_door(door_id=door),
        ):
            with pytest.raises(DoorRemovedError, match=r"door 1 was removed.* retract .*log 1$"):
                ask()
        with pytest.raises(UnknownDoorError, match="door 7 is not in the map"):
            log.observe("7", "open")
        assert DoorState.OPEN is log.replay(at="2026-03-01T11:00")[door].state
