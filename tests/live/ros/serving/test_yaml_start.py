"""A server's file of doors: it fills a log, and later agrees with it or says where not."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorRemoved, DoorUpdated
from semmap_log.errors import CommandError
from semmap_log.live.ros.ros_node import Outcome
from semmap_log.live.ros.serving.door_server import DoorServer
from semmap_log.live.ros.serving.saving import DoorSaver
from semmap_log.live.ros.serving.yaml_start import start_with_yaml
from tests.live.ros.serving.goals import DOOR, goal_of


def _entry(number: int, x: float = 2.0, status: str = "CLOSED", prob: float = 0.3) -> str:
    return (f"{number}:\n  position:\n    x: {x}\n    y: 1.5\n    theta: 0.0\n  width: 0.9\n"
            f"  status: {status}\n  closed_prob: 0.7\n  open_prob: {prob}\n")  # fmt: skip


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Two doors."""
    file = tmp_path / "doors.yaml"
    file.write_text(_entry(1) + _entry(2, x=5.0))
    return file


@pytest.fixture
def filled(path: Path, file: Path) -> Path:
    """A log that was filled from the file."""
    with sl.append(path) as log:
        start_with_yaml(log, file)
    return path


def _commits(path: Path) -> int:
    return len(list(sl.read(path).commits()))


def test_an_empty_log_is_filled_by_one_commit(path: Path, file: Path) -> None:
    """The doors keep their numbers; the note names the file."""
    with sl.append(path) as log:
        said = start_with_yaml(log, file)

    read = sl.read(path)
    (commit,) = read.commits()
    assert ["doors: 2 added"] == said
    assert [1, 2] == list(read.replay().doors)
    assert (2, "doors.yaml") == (commit.count, commit.note.source)


def test_a_log_without_doors_that_had_some_is_not_filled(path: Path, file: Path) -> None:
    """Somebody has removed them: a restart does not bring others in their place."""
    file.write_text(_entry(2))
    with sl.append(path) as log:
        log.remove_door(log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0))

        with pytest.raises(CommandError, match="door 2: in the file only"):
            start_with_yaml(log, file)


def test_a_file_that_agrees_changes_nothing(filled: Path, file: Path) -> None:
    """Also where it is written otherwise."""
    file.write_text(_entry(2, x=5.0) + "# the first\n" + _entry(1))

    with sl.append(filled) as log:
        said = start_with_yaml(log, file)

    assert [f"{file}: 2 doors, as in the log."] == said
    assert 1 == _commits(filled)


def test_a_file_that_differs_stops_the_server(filled: Path, file: Path) -> None:
    """The message says of each door what the log has and what the file, and what to do."""
    file.write_text(_entry(1, x=2.5, status="OPEN") + _entry(3))

    with sl.append(filled) as log, pytest.raises(CommandError) as raised:
        start_with_yaml(log, file)

    first, *differences, last = str(raised.value).splitlines()
    states = "state CLOSED in the log, OPEN in the file"
    assert f"{file} and the log differ: " == first
    assert [
        f"  line 2: door 1: x 2.0 in the log, 2.5 in the file, {states}",
        "  line 11: door 3: in the file only",
        "  door 2: in the log only",
    ] == differences
    assert "--yaml-replace" in last
    assert 1 == _commits(filled)


def test_replacing_commits_the_difference_at_once(filled: Path, file: Path) -> None:
    """Added, updated, removed; a door without a place is none of the file's business."""
    with sl.append(filled) as log:
        sensor = log.add_door(name="sensor")
    file.write_text(_entry(1, x=2.5, status="OPEN") + _entry(4))

    with sl.append(filled) as log:
        start_with_yaml(log, file, replace=True)
        again = start_with_yaml(log, file, replace=True)

    read = sl.read(filled)
    doors = read.replay().doors
    *_, commit = read.commits()
    assert [1, sensor, 4] == list(doors)
    assert (2.5, DoorState.OPEN) == (doors[1].x, doors[1].state)
    assert (3, "--yaml-replace") == (commit.count, commit.note.reason)
    assert [f"{file}: 2 doors, as in the log."] == again
    assert 3 == _commits(filled)


def test_replacing_brings_a_removed_door_back(filled: Path, file: Path) -> None:
    """Under its number, which plans name: its history goes on, and shows the removal."""
    with sl.append(filled) as log:
        log.observe(2, "open")
        for _ in range(2):
            removed = log.remove_door(2).commit
            said = start_with_yaml(log, file, replace=True)
        log.observe(2, "closed")

        assert [1, 2] == list(log.replay().doors) == list(log.state.door_map().doors)
        assert [1] == list(log.replay(known_at=removed.recorded_ns).doors)
        counts = [c.count for c in log.commits() if c.note.reason == "--yaml-replace"]
        told = [(type(entry.event), entry.retracted) for entry in log.history(2)]

    assert f"door 2: its removal, event {removed.first_event}, is taken back" == said[-1]
    assert [2, 1] == counts
    assert [
        (DoorAdded, False), (DoorObserved, False), (DoorRemoved, True), (DoorUpdated, False),
        (DoorRemoved, True), (DoorObserved, False),
    ] == told  # fmt: skip


def test_a_door_whose_adding_was_taken_back_does_not_come_back(filled: Path, file: Path) -> None:
    """A retraction cannot be taken back; the message says what can be done."""
    with sl.append(filled) as log:
        log.retract(1)

        with pytest.raises(CommandError, match=r"doors.yaml:11: the adding of door 2 was taken"):
            start_with_yaml(log, file, replace=True)


@pytest.mark.parametrize("replaced", [False, True])
def test_an_unchanged_file_lets_the_log_go_on(filled: Path, file: Path, replaced: bool) -> None:
    """Doors that changed since the log took the file in are no reason not to start again."""
    with sl.append(filled) as log:
        if replaced:
            file.write_text(_entry(1, x=3.0) + _entry(2))
            start_with_yaml(log, file, replace=True)
        log.observe(1, "open")
        log.remove_door(2)
        before = log.door_map()

        (said,) = start_with_yaml(log, file)

        assert before.doors.keys() == log.door_map().doors.keys()
        assert before.event == log.door_map().event
    assert "has gone on since, so the log counts" in said
    assert "door 1: state OPEN in the log, CLOSED in the file" in said
    assert "door 2: in the file only" in said


def test_a_file_that_the_server_saved_is_known_too(filled: Path, file: Path) -> None:
    """SaveDoorDB over the very file that it starts with, and goals behind it."""
    server = DoorServer(lambda: sl.append(filled), DoorSaver(file.parent, filled))
    server.run(goal_of("AddDoor", "a", **DOOR))
    server.run(goal_of("SaveDoorDB", "s", file_name="doors.yaml"))
    server.run(goal_of("RemoveDoor", "r", door_id=1))

    (said,) = start_with_yaml(server.log, file)

    assert "has gone on since" in said
    server.close()


def test_a_file_saved_with_a_default_is_known_with_the_same(filled: Path, file: Path) -> None:
    """Doors without probabilities: what stood for them in the file is no difference."""
    saver = DoorSaver(file.parent, filled, default_prob=0.5)
    server = DoorServer(lambda: sl.append(filled), saver)
    server.run(goal_of("AddDoor", "a", **DOOR | {"prob_open": math.nan, "prob_closed": math.nan}))
    server.run(goal_of("SaveDoorDB", "s", file_name="doors.yaml"))

    agreed = start_with_yaml(server.log, file, default_prob=0.5)
    with pytest.raises(CommandError, match="door 3: prob_open not given in the log, 0"):
        start_with_yaml(server.log, file)
    server.run(goal_of("RemoveDoor", "r", door_id=1))
    (known,) = start_with_yaml(server.log, file, default_prob=0.5)

    assert [f"{file}: 3 doors, as in the log."] == agreed
    assert "has gone on since" in known
    assert math.isnan(server.door_map().doors[DoorId(3)].prob_open)
    server.close()


def test_a_yaml_with_0_fills_a_server_whose_goals_reach_it(server: DoorServer, root: Path) -> None:
    """Saved again, the file is the same, byte for byte."""
    file = root / "doors.yaml"
    file.write_text(_entry(0) + _entry(1))
    start_with_yaml(server.log, file)

    saved = server.run(goal_of("SaveDoorDB", "s", file_name="saved.yaml"))
    updated = server.run(goal_of("UpdateDoor", "u", door_id=0, change_open=True, door_state="OPEN"))
    removed = server.run(goal_of("RemoveDoor", "r", door_id=1))

    assert saved.succeeded
    assert file.read_text() == (root / "saved.yaml").read_text()
    assert Outcome(succeeded=True, result={"door_updated": True}) == updated
    assert Outcome(succeeded=True, result={"door_removed": True}) == removed
    assert {0: DoorState.OPEN} == {i: d.state for i, d in server.door_map().doors.items()}
