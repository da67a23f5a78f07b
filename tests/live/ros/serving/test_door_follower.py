"""A log that is only read: its doors are those of whoever writes it, and goals are refused."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import LogError, NotALogError
from semmap_log.live.ros.ros_node import Outcome
from semmap_log.live.ros.serving.yaml_start import DoorFollower
from tests.live.ros.running import wait_until
from tests.live.ros.serving.goals import DOOR, goal_of


@pytest.fixture
def path(tmp_path: Path) -> Path:
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0)
    return tmp_path / "log"


def test_the_doors_are_those_of_the_writer(path: Path) -> None:
    """A commit, and a retraction, are told and seen; the log is not locked."""
    wake = threading.Event()
    follower = DoorFollower(path, changed=wake.set, poll_s=0.001)
    first = len(follower.door_map())

    with sl.append(path) as log:
        log.add_door(x=2.0, y=1.0, theta=0.0, width=1.0)
        wait_until(lambda: len(follower.door_map()) == 2, "the new door")
        log.retract(1)
        wait_until(lambda: len(follower.door_map()) == 1, "the retraction")

    assert 1 == first
    assert wake.is_set()
    follower.close()


def test_goals_are_refused(path: Path) -> None:
    """All four, with the result that says that nothing was done."""
    follower = DoorFollower(path)

    outcomes = [
        follower.run(goal_of("AddDoor", "a", **DOOR)),
        follower.run(goal_of("SaveDoorDB", "s", file_name="x.yaml")),
    ]

    assert [(False, {"door_id": 0}), (False, {"stored_successful": False})] == [
        (one.succeeded, one.result) for one in outcomes
    ]
    assert isinstance(outcomes[0], Outcome)
    assert "--read-only" in outcomes[0].text
    follower.close()


def test_without_a_log_there_is_nothing_to_follow(tmp_path: Path) -> None:
    """Said at once, not by a thread."""
    with pytest.raises(NotALogError):
        DoorFollower(tmp_path)


def test_a_log_that_was_exchanged_is_told(path: Path, tmp_path: Path) -> None:
    """Who asks for the doors gets the error; it is not answered with old doors for ever."""
    wake = threading.Event()
    follower = DoorFollower(path, changed=wake.set, poll_s=0.001)
    sl.create(tmp_path / "other", tz="UTC").close()

    path.rename(tmp_path / "old")
    (tmp_path / "other").rename(path)

    def fails() -> bool:
        try:
            follower.door_map()
        except LogError:
            return True
        return False

    wait_until(fails, "the error")
    follower.close()
