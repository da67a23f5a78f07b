"""ROS 1's own tools around a server that our launch file has started."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.interop.formats.ros.ros_types import ros_types
from tests.live.ros.ros_world import ROOT, RosWorld
from tests.live.ros.running import Running

TOPIC = "/lta_semantic_map_door_db"
RECORDER = "/usr/lib/rosbag/record"
"""What `rosbag record` starts: in C++, without any of our messages."""


@dataclass(frozen=True, slots=True)
class Launched:
    """A server that roslaunch keeps alive."""

    world: RosWorld
    log: Path
    roslaunch: Running

    def said(self, tool: str, *arguments: object) -> str:
        """Return what a tool of ROS says."""
        with self.world.tool(tool, *arguments) as running:
            return running.finish()

    def pid(self) -> int:
        """Return the server's process, as the server itself tells `rosnode`."""
        found = re.search(r"^Pid: (\d+)$", self.said("rosnode", "info", "/doors"), re.MULTILINE)
        assert found
        return int(found[1])

    def call(self, *arguments: object) -> str:
        """Return what our client prints."""
        with self.world.semmap("call", *arguments, "--ros1", "--timeout", 60) as client:
            return client.finish()


@pytest.fixture(scope="module")
def launched(ros1: RosWorld, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    folder = tmp_path_factory.mktemp("launched")
    with sl.create(folder / "office", tz="UTC") as log:
        log.add_door(x=2.0, y=1.5, theta=0.0, width=0.9, state="closed", name="front")
    command = folder / "semmap-log"
    command.write_text(f'#!/bin/sh\nexec {ros1.interpreter} -m semmap_log "$@"\n')
    command.chmod(0o755)
    roslaunch = ros1.tool(
        "roslaunch", "lta_semantic_map", "server.launch", f"log:={folder / 'office'}",
        "name:=doors", "options:=--default-prob 0.5",
        environment={"ROS_PACKAGE_PATH": str(ROOT / "semmap_log" / "live" / "robot_files"),
                     "SEMMAP_LOG": str(command)},
    )  # fmt: skip
    with roslaunch:
        roslaunch.wait_for("/doors serves .*: 1 door[.]")
        yield Launched(ros1, folder / "office", roslaunch)
        assert 0 == roslaunch.stop()


def test_rostopic_shows_the_map_to_who_comes_late(launched: Launched) -> None:
    """Type, publisher, and the last message, which is latched."""
    echo = launched.said("rostopic", "echo", "-n1", TOPIC)  # waits until it is offered
    info = launched.said("rostopic", "info", TOPIC)

    assert "Type: lta_semantic_map/DoorMap" in info
    assert "/doors (http://" in info
    assert "door_id: 1" in echo
    assert 'door_state: "CLOSED"' in echo


def test_rosbag_records_each_change(launched: Launched, tmp_path: Path) -> None:
    """The C++ recorder, without our messages: the map as it was, and each that followed."""
    bag = tmp_path / "doors.bag"

    recording = ["--limit=3", "-O", bag, TOPIC, "__name:=bystander"]
    with launched.world.run(RECORDER, *recording) as recorder:
        launched.world.wait_until(
            lambda: "to: /bystander" in launched.said("rosnode", "info", "/doors"), "rosbag listens"
        )
        launched.call("update", 1, "--state", "open")
        launched.world.wait_until(  # changes that come together are shown as one
            lambda: '"OPEN"' in launched.said("rostopic", "echo", "-n1", TOPIC), "the open door"
        )
        launched.call("update", 1, "--state", "closed")
        recorder.finish()

    assert ["CLOSED", "OPEN", "CLOSED"] == _states(bag)


def _states(bag: Path) -> list[str]:
    from rosbags.rosbag1 import Reader

    with Reader(bag) as reader:
        return [
            ros_types(1).deserialize_ros1(data, connection.msgtype).door_db[0].door_state
            for connection, _, data in reader.messages()
        ]


def test_roslaunch_brings_a_killed_server_back(launched: Launched) -> None:
    """After its two seconds, with all that the killed one had answered."""
    launched.call("update", 1, "--prob-open", 0.75)
    killed = launched.pid()

    os.kill(killed, signal.SIGKILL)
    launched.world.wait_until(lambda: _pid_or_none(launched) not in {None, killed}, "a new server")

    assert "prob_open: 0.75" in launched.said("rostopic", "echo", "-n1", TOPIC)


def _pid_or_none(launched: Launched) -> int | None:
    try:
        return launched.pid()
    except AssertionError:
        return None
