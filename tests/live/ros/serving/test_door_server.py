"""The server without ROS: what a client is told is what the log says."""

from __future__ import annotations

import math
import os
import threading
from pathlib import Path

import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.core.model.doors import Door, DoorId, DoorState
from semmap_log.core.model.events import Changed, DoorUpdated, LevelAdded
from semmap_log.live.ros.ros_node import Outcome
from semmap_log.live.ros.serving.door_server import DoorServer
from semmap_log.live.ros.serving.saving import DoorSaver
from tests.live.ros.serving.door_servers import door_server, events_in
from tests.live.ros.serving.goals import DOOR, FIELDS, goal_of

NAN, INF = math.nan, math.inf


def _placed(door: Door) -> tuple[float, ...]:
    return (door.x, door.y, door.theta, door.width)


def test_a_door_is_added_and_its_id_returned(server: DoorServer) -> None:
    """The goal is one commit: its id the command's, its client the actor."""
    told: list[float] = []
    goal = goal_of("AddDoor", "/tester-1-2.3", told.append, **DOOR)

    outcome = server.run(goal)

    door, commit = server.door_map().doors[DoorId(1)], server.log._reader.last_commit()
    assert Outcome(succeeded=True, result={"door_id": 1}) == outcome
    assert (2.0, 1.5, 0.0, 0.9) == _placed(door)
    assert (DoorState.CLOSED, 0.3, 0.7) == (door.state, door.prob_open, door.prob_closed)
    assert (goal.goal_id, "/tester", "action AddDoor", "/tester-1-2.3") == (
        commit.command_id, commit.note.actor, commit.note.source, commit.note.correlation,
    )  # fmt: skip
    assert [100.0] == told


@pytest.mark.parametrize("name", FIELDS)
def test_each_field_is_updated_alone(server: DoorServer, name: str) -> None:
    """The other values of the goal count for nothing, however wrong."""
    server.run(goal_of("AddDoor", "a", **DOOR))
    bit, values = FIELDS[name]
    wrong = {"pos_x": NAN, "width": -1.0, "door_state": "ajar", "prob_open": 7, "prob_closed": 7}

    outcome = server.run(goal_of("UpdateDoor", "u", door_id=1, **{name: True}, **wrong | values))

    event = server.log.event(1).event
    assert Outcome(succeeded=True, result={"door_updated": True}) == outcome
    assert isinstance(event, DoorUpdated)
    assert bit == event.changed
    door = server.door_map().doors[DoorId(1)]
    shown = {"pos_x": door.x, "pos_y": door.y, "pos_theta": door.theta, "width": door.width,
             "door_state": door.state.name, "prob_open": door.prob_open,
             "prob_closed": door.prob_closed}  # fmt: skip
    assert {**DOOR, **values} == shown


def test_all_fields_of_an_update_are_one_commit(server: DoorServer) -> None:
    """Nobody ever sees half of an update."""
    server.run(goal_of("AddDoor", "a", **DOOR))
    values = {key: value for _, some in FIELDS.values() for key, value in some.items()}

    server.run(goal_of("UpdateDoor", "u", door_id=1, **dict.fromkeys(FIELDS, True), **values))

    assert [0, 1] == [commit.first_event for commit in server.log.commits()]
    assert 31 == int(server.log.event(1).event.changed)


def test_an_update_that_changes_nothing_is_true_and_no_event(server: DoorServer) -> None:
    """Neither one without flags, nor one with the values that the door has."""
    server.run(goal_of("AddDoor", "a", **DOOR))

    without = server.run(goal_of("UpdateDoor", "u", door_id=1))
    same = server.run(goal_of("UpdateDoor", "v", door_id=1, **dict.fromkeys(FIELDS, True), **DOOR))

    assert [Outcome(succeeded=True, result={"door_updated": True})] * 2 == [without, same]
    assert 1 == events_in(server)


def test_what_an_update_does_not_change_is_not_said_to_change(server: DoorServer) -> None:
    """The event names only what is another now."""
    server.run(goal_of("AddDoor", "a", **DOOR))
    values = DOOR | {"width": 1.0}

    server.run(goal_of("UpdateDoor", "u", door_id=1, **dict.fromkeys(FIELDS, True), **values))

    assert Changed.WIDTH == server.log.event(1).event.changed


def test_a_removed_door_is_gone_and_its_id_too(server: DoorServer) -> None:
    """Removing once is true, twice is not; the next door gets another id."""
    server.run(goal_of("AddDoor", "a", **DOOR))

    first = server.run(goal_of("RemoveDoor", "r", door_id=1))
    second = server.run(goal_of("RemoveDoor", "s", door_id=1))
    updated = server.run(goal_of("UpdateDoor", "u", door_id=1, change_open=True))
    added = server.run(goal_of("AddDoor", "b", **DOOR))

    assert Outcome(succeeded=True, result={"door_removed": True}) == first
    assert (False, {"door_removed": False}) == (second.succeeded, second.result)
    assert "door 1 was removed" in second.text
    assert (False, {"door_updated": False}) == (updated.succeeded, updated.result)
    assert {"door_id": 2} == added.result


WRONG = [
    ("AddDoor", {"pos_x": NAN}, "pos_x: expected a finite number of metres, got nan"),
    ("AddDoor", {"pos_y": -INF}, "pos_y: expected a finite number of metres, got -inf"),
    ("AddDoor", {"pos_theta": INF}, "pos_theta: expected a finite number of radians, got inf"),
    ("AddDoor", {"width": -0.1}, "width: expected a finite number of metres, 0 or more, got -0.1"),
    ("AddDoor", {"width": NAN}, "width: expected"),
    ("AddDoor", {"prob_open": 1.2}, "expected a number from 0 to 1, or NaN where none is given"),
    ("AddDoor", {"prob_closed": -INF}, "prob_closed: expected a number from 0 to 1"),
    ("UpdateDoor", {"door_id": 9, "change_open": True}, "door 9 is not in the map"),
    ("UpdateDoor", {"door_id": 9}, "door 9 is not in the map"),
    ("UpdateDoor", {"door_id": 0}, "door_id: door 0 is not in the map"),
    ("UpdateDoor", {"door_id": 2**32 + 1, "change_open": True}, "got 4294967297"),
    ("UpdateDoor", {"change_pos": True, "pos_x": NAN}, "pos_x: expected"),
    ("UpdateDoor", {"change_width": True, "width": -1.0}, "width: expected"),
    ("UpdateDoor", {"change_prob_open": True, "prob_open": 1.2}, "prob_open: expected"),
    ("UpdateDoor", {"change_prob_closed": True, "prob_closed": -0.1}, "prob_closed: expected"),
    ("RemoveDoor", {"door_id": 9}, "door 9 is not in the map"),
    ("RemoveDoor", {"door_id": 2**64 - 1}, "got 18446744073709551615"),
]
NOTHING = {
    "AddDoor": {"door_id": 0},
    "UpdateDoor": {"door_updated": False},
    "RemoveDoor": {"door_removed": False},
}


@pytest.mark.parametrize(("action", "values", "text"), WRONG)
def test_a_wrong_goal_is_aborted_with_a_text(
    server: DoorServer, action: str, values: dict[str, object], text: str
) -> None:
    """Nothing is written, and the result says so."""
    server.run(goal_of("AddDoor", "a", **DOOR))
    before = DOOR if action == "AddDoor" else {"door_id": 1}

    outcome = server.run(goal_of(action, "w", **before | values))

    assert (False, NOTHING[action]) == (outcome.succeeded, outcome.result)
    assert text in outcome.text
    assert 1 == events_in(server)


def test_a_probability_that_is_nan_is_not_given(server: DoorServer) -> None:
    """A new door has none; that of a known door stays as it is, and the text says so."""
    added = server.run(goal_of("AddDoor", "a", **DOOR | {"prob_open": NAN}))
    updated = server.run(
        goal_of("UpdateDoor", "u", door_id=1, change_prob_closed=True, prob_closed=NAN)
    )

    door = server.door_map().doors[DoorId(1)]
    assert added.succeeded
    assert math.isnan(door.prob_open)
    assert 0.7 == door.prob_closed
    assert (True, {"door_updated": True}) == (updated.succeeded, updated.result)
    assert "prob_closed: NaN means not given" in updated.text


@pytest.mark.parametrize("text", ["ajar", "", "MOVING", "2"])
def test_a_state_that_is_none_is_unknown_with_a_warning(server: DoorServer, text: str) -> None:
    """As the thesis has it (4.2.2); the goal succeeds."""
    outcome = server.run(goal_of("AddDoor", "a", **DOOR | {"door_state": text}))

    assert (True, {"door_id": 1}) == (outcome.succeeded, outcome.result)
    assert f"expected one of OPEN, CLOSED, UNKNOWN, got {text!r}; taken for UNKNOWN" in outcome.text
    assert DoorState.UNKNOWN == server.door_map().doors[DoorId(1)].state


def test_a_state_may_be_written_in_any_case(server: DoorServer) -> None:
    """`open` is no less plain than `OPEN`."""
    outcome = server.run(goal_of("AddDoor", "a", **DOOR | {"door_state": " open"}))

    assert (True, "") == (outcome.succeeded, outcome.text)
    assert DoorState.OPEN == server.door_map().doors[DoorId(1)].state


def test_a_door_without_a_place_gets_pose_and_width_together(path: Path) -> None:
    """One of them alone is aborted with what to do."""
    with sl.append(path) as log:
        log.add_door(name="sensor")
    server = door_server(path)

    alone = server.run(goal_of("UpdateDoor", "u", door_id=1, change_pos=True, **DOOR))
    both = server.run(
        goal_of("UpdateDoor", "v", door_id=1, change_pos=True, change_width=True, **DOOR)
    )

    assert (False, {"door_updated": False}) == (alone.succeeded, alone.result)
    assert "set change_pos and change_width together" in alone.text
    assert both.succeeded
    assert (2.0, 1.5, 0.0, 0.9) == _placed(server.door_map().doors[DoorId(1)])
    server.close()


def test_the_same_goal_again_is_answered_and_not_applied(path: Path, root: Path) -> None:
    """Also after a restart, and though the door is gone meanwhile."""
    first = door_server(path, root)
    goals = [
        goal_of("AddDoor", "a", **DOOR),
        goal_of("UpdateDoor", "u", door_id=1, change_open=True, door_state="OPEN"),
        goal_of("SaveDoorDB", "s", file_name="doors.yaml"),
        goal_of("RemoveDoor", "r", door_id=1),
    ]
    outcomes = [first.run(goal) for goal in goals]
    first.close()
    (root / "doors.yaml").unlink()

    second = door_server(path, root)
    again = [second.run(goal) for goal in goals]

    assert all(outcome.succeeded for outcome in outcomes)
    assert outcomes == again
    assert 4 == events_in(second)
    assert not (root / "doors.yaml").exists()
    second.close()


def test_another_goal_of_the_same_id_is_aborted(server: DoorServer) -> None:
    """Two clients that draw the same id must not take one's answer for the other's."""
    server.run(goal_of("AddDoor", "a", **DOOR))

    outcome = server.run(goal_of("AddDoor", "a", **DOOR | {"width": 1.0}))

    assert (False, {"door_id": 0}) == (outcome.succeeded, outcome.result)
    assert outcome.text.startswith("goal id a: command ")
    assert "with other content; give a new command a new id" in outcome.text
    assert 1 == len(server.door_map())


def test_goals_count_though_the_clock_went_back(path: Path) -> None:
    """
    An update that happened before the last one by a wrong clock would leave the map as it was.
    """
    clock = SteadyClock()
    server = DoorServer(lambda: sl.append(path, clock=clock), DoorSaver(None, path))
    server.run(goal_of("AddDoor", "a", **DOOR))
    clock.now_ns -= 3600 * 10**9

    updated = server.run(goal_of("UpdateDoor", "u", door_id=1, change_width=True, width=2.0))
    seen = server.door_map().doors[DoorId(1)].width
    removed = server.run(goal_of("RemoveDoor", "r", door_id=1))

    assert (True, 2.0) == (updated.succeeded, seen)
    assert (True, 0) == (removed.succeeded, len(server.door_map()))
    server.close()


def test_with_several_levels_it_must_be_said_where_new_doors_are(path: Path) -> None:
    """The thesis's goal has no level."""
    with sl.append(path) as log:
        log.append([LevelAdded(level=1, name="ground"), LevelAdded(level=2, name="first")])
    silent = door_server(path)
    refused = silent.run(goal_of("AddDoor", "a", **DOOR))
    silent.close()

    server = door_server(path, level="first")
    added = server.run(goal_of("AddDoor", "a", **DOOR))

    assert (False, {"door_id": 0}) == (refused.succeeded, refused.result)
    assert "several levels: 1 (ground), 2 (first); say which" in refused.text
    assert (True, 2) == (added.succeeded, server.door_map().doors[DoorId(1)].level)
    server.close()


def test_goals_that_come_together_are_all_stored(path: Path) -> None:
    """From eight threads: each its own id, and the log holds them all."""
    changes: list[None] = []
    server = door_server(path, changed=lambda: changes.append(None))
    ids: list[int] = []

    def run(thread: int) -> None:
        goals = [goal_of("AddDoor", f"{thread}-{i}", **DOOR) for i in range(10)]
        ids.extend(server.run(goal).result["door_id"] for goal in goals)

    threads = [threading.Thread(target=run, args=(i,)) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()

    assert list(range(1, 81)) == sorted(ids)
    assert 80 == len(changes)
    server.close()
    assert 80 == len(sl.read(path).replay())


def test_who_cannot_hear_of_the_progress_hears_of_the_result(server: DoorServer) -> None:
    """ROS ends, or the client has gone: what was done is done."""

    def gone(_percent: float) -> None:
        raise RuntimeError("the context is not valid")

    outcome = server.run(goal_of("AddDoor", "a", gone, **DOOR))

    assert (True, {"door_id": 1}) == (outcome.succeeded, outcome.result)


def test_a_goal_is_on_the_disk_when_it_is_answered(
    server: DoorServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not soon after: the client may act on it before a power cut."""
    synced: list[int] = []
    real = os.fdatasync
    monkeypatch.setattr(os, "fdatasync", lambda fd: synced.append(events_in(server)) or real(fd))

    server.run(goal_of("AddDoor", "a", **DOOR))

    assert [1] == synced
    monkeypatch.undo()
