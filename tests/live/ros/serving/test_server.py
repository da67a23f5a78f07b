"""The server on a node without a network: the map first, then the actions, then each change."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorMap
from semmap_log.errors import LogError
from semmap_log.live.ros.ros_node import DEFAULTS, Goal
from semmap_log.live.ros.serving.door_server import DoorServer
from semmap_log.live.ros.serving.saving import DoorSaver
from semmap_log.live.ros.serving.server import ServeOptions, Server
from tests.live.ros.collecting_node import CollectingNode
from tests.live.ros.running import DEADLINE_S, wait_until
from tests.live.ros.serving.goals import DOOR, goal_of

DB = "lta_semantic_map_door_db"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    sl.create(tmp_path / "log", tz="UTC", durability="none").close()
    return tmp_path / "log"


def _doors(path: Path, wake: threading.Event, kind: type[DoorServer] = DoorServer) -> DoorServer:
    return kind(lambda: sl.append(path, durability="none"), DoorSaver(None, path), changed=wake.set)


@contextmanager
def _running(
    node: CollectingNode, doors: Any, wake: threading.Event, options: ServeOptions
) -> Iterator[None]:
    """Serve in a thread until the block is over."""
    ending = threading.Event()
    server = Server(node, doors, wake, options)
    thread = threading.Thread(target=server.run, args=(ending.is_set,))
    thread.start()
    try:
        wait_until(lambda: len(node.actions) == 4, "the actions")
        yield
    finally:
        ending.set()
        thread.join()


def test_the_map_is_there_before_the_actions(path: Path) -> None:
    """Who finds the actions and asks for the map has one; all four are offered by their names."""
    node, wake = CollectingNode(), threading.Event()

    with _running(node, doors := _doors(path, wake), wake, ServeOptions(costmap=True)):
        order = list(node.order)

    doors.close()
    assert [DB, "semmap/doors", *DEFAULTS.values()] == order


def test_goals_are_followed_by_the_map_that_they_made(path: Path) -> None:
    """From many threads: no older map follows a newer one, and the last is that of the log."""
    node, wake = CollectingNode(), threading.Event()
    doors = _doors(path, wake)

    def add(thread: int) -> None:
        for i in range(10):
            node.actions[DEFAULTS["AddDoor"]](goal_of("AddDoor", f"{thread}-{i}", **DOOR))

    with _running(node, doors, wake, ServeOptions()):
        threads = [threading.Thread(target=add, args=(i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        wait_until(lambda: len(node.messages[DB][-1].door_db) == 40, "the last map")

    doors.close()
    sizes = [len(message.door_db) for message in node.messages[DB]]
    assert sorted(set(sizes)) == sizes


def test_a_change_while_the_map_is_shown_is_shown_too(path: Path) -> None:
    """It comes behind the look at the doors, and before the look is over."""

    class Interrupted(DoorServer):
        goals: list[Goal] = []  # noqa: RUF012 - of this test alone

        def door_map(self) -> DoorMap:
            doors = super().door_map()
            if self.goals:
                self.run(self.goals.pop())
            return doors

    node, wake = CollectingNode(), threading.Event()
    doors = _doors(path, wake, Interrupted)

    with _running(node, doors, wake, ServeOptions()):
        Interrupted.goals = [goal_of("AddDoor", "in between", **DOOR)]
        doors.run(goal_of("AddDoor", "first", **DOOR))
        wait_until(lambda: len(node.messages[DB][-1].door_db) == 2, "both")

    doors.close()


def test_doors_that_cannot_be_read_end_the_server(path: Path) -> None:
    """With the error: not a server that offers an old map for ever."""
    broken = threading.Event()

    class Damaged(DoorServer):
        def door_map(self) -> DoorMap:
            if broken.is_set():
                raise LogError("the log was exchanged")
            return super().door_map()

    node, wake = CollectingNode(), threading.Event()
    doors = _doors(path, wake, Damaged)
    server = Server(node, doors, wake, ServeOptions())

    with pytest.raises(LogError, match="the log was exchanged"):
        server.run(_once_served(node, wake, broken))

    doors.close()


def _once_served(
    node: CollectingNode, wake: threading.Event, then: threading.Event
) -> Callable[[], bool]:
    """Return what sets an event once the actions are there, and says stop at the deadline."""
    end = time.monotonic() + DEADLINE_S

    def stop() -> bool:
        if len(node.actions) == 4 and not then.is_set():
            then.set()
            wake.set()
        return time.monotonic() > end

    return stop
