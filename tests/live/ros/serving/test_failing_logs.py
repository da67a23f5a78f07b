"""Logs that fail under the server: goals are aborted, and it goes on when it can."""

from __future__ import annotations

import resource
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import semmap_log as sl
from semmap_log.errors import LogLockedError
from semmap_log.live.ros.serving.door_server import DoorServer
from semmap_log.live.ros.serving.saving import DoorSaver
from tests.live.ros.serving.door_servers import door_server
from tests.live.ros.serving.goals import DOOR, goal_of


@contextmanager
def _full_disk(room: int) -> Iterator[None]:
    """No file of this process may grow beyond so many bytes; a write stops in the middle."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_write_that_fails_aborts_the_goal_and_not_the_server(
    server: DoorServer, path: Path, root: Path
) -> None:
    """Nothing half is stored; the doors are still offered."""
    server.run(goal_of("AddDoor", "a", **DOOR))
    (segment,) = path.glob("*.mcap")
    goals = [goal_of("AddDoor", "b", **DOOR), goal_of("RemoveDoor", "r", door_id=1),
             goal_of("SaveDoorDB", "s", file_name="doors.yaml")]  # fmt: skip

    with _full_disk(segment.stat().st_size + 50):
        failed = [server.run(goal) for goal in goals]
        seen = [int(door) for door in server.door_map().doors]
    again = [server.run(goal) for goal in goals]

    assert [1] == seen
    assert [{"door_id": 0}, {"door_removed": False}] == [one.result for one in failed[:2]]
    assert not any(one.succeeded for one in failed)
    assert "Nothing of this goal is stored" in failed[0].text
    assert [{"door_id": 2}, {"door_removed": True}, {"stored_successful": True}] == [
        one.result for one in again
    ]
    server.close()
    assert [(0, 1), (1, 1), (2, 1), (3, 1)] == [
        (commit.first_event, commit.count) for commit in sl.read(path).commits()
    ]


def test_a_log_that_is_removed_under_the_server_takes_no_goal(server: DoorServer) -> None:
    """A file without a name would still take events, and be gone with the process."""
    path = server.log.path
    server.run(goal_of("AddDoor", "a", **DOOR))
    shutil.copytree(path, path.with_name("copy"))

    shutil.rmtree(path)
    failed = [server.run(goal_of("AddDoor", said, **DOOR)) for said in ("b", "c")]
    path.with_name("copy").rename(path)
    again = server.run(goal_of("AddDoor", "b", **DOOR))

    assert [{"door_id": 0}] * 2 == [one.result for one in failed]
    assert "it was removed while it was written" in failed[0].text
    assert {"door_id": 2} == again.result
    assert [1, 2] == list(sl.read(path).replay().doors)


def test_saving_stays_true_though_the_log_cannot_note_it(
    server: DoorServer, path: Path, root: Path
) -> None:
    """The file is there: the boolean says so, the goal is aborted, the text says why."""
    server.run(goal_of("AddDoor", "a", **DOOR))
    (segment,) = path.glob("*.mcap")

    with _full_disk(segment.stat().st_size + 50):
        outcome = server.run(goal_of("SaveDoorDB", "s", file_name="doors.yaml"))

    assert (root / "doors.yaml").exists()
    assert (False, {"stored_successful": True}) == (outcome.succeeded, outcome.result)
    assert "The file is written, but the log has no note of it" in outcome.text


def test_a_log_that_cannot_be_opened_again_is_tried_with_each_goal(path: Path) -> None:
    """Another process took the lock meanwhile: goals are aborted, until it lets go."""
    openings = iter([sl.append, _locked, _locked, sl.append])
    server = DoorServer(lambda: next(openings)(path), DoorSaver(None, path))
    server.run(goal_of("AddDoor", "a", **DOOR))
    (segment,) = path.glob("*.mcap")

    with _full_disk(segment.stat().st_size + 50):
        first = server.run(goal_of("AddDoor", "b", **DOOR))
    second = server.run(goal_of("AddDoor", "b", **DOOR))
    third = server.run(goal_of("AddDoor", "b", **DOOR))

    assert "Whether this goal is stored is not known" in first.text
    assert (False, True) == (second.succeeded, third.succeeded)
    assert {"door_id": 2} == third.result
    server.close()


def _locked(path: Path) -> sl.DoorLogWriter:
    raise LogLockedError(f"{path}: another process is writing.")


def test_doors_are_told_when_a_log_was_opened_anew(path: Path) -> None:
    """The write that failed may be stored after all: who shows the doors has to look."""
    changes: list[None] = []
    server = door_server(path, changed=lambda: changes.append(None))
    server.run(goal_of("AddDoor", "a", **DOOR))
    (segment,) = path.glob("*.mcap")

    with _full_disk(segment.stat().st_size + 50):
        server.run(goal_of("AddDoor", "b", **DOOR))

    assert 2 == len(changes)
    server.close()
