"""`record` on a real ROS: what a robot publishes is in the log, or it is told why not."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorObserved, DoorRequested, PatrolStarted, RobotPose
from tests.interop.topics.robots import Robot
from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import Running, wait_until

TALKER = Path(__file__).with_name("talker.py")
MAPPING = """
topics:
  /doors: door_map
  /door_states: rmf_door_state
  /door_requests: rmf_door_request
  /contact: {read: sensor, door: office, states: {open: false, closed: true}, accuracy: 0.97}
  /amcl_pose: pose
  /tf: tf
  /tf_static: tf
  /map: floor_map
  /rounds: {read: patrol, name: evening round}
well_known: true
"""


class Talker:
    """A robot that is told what to publish, and says when somebody has it."""

    def __init__(self, running: Running) -> None:
        self._running = running
        self._sent = 0

    def say(self, topic: str, message: tuple[str, bytes], *, latched: bool = False) -> None:
        ros_type, data = message
        self._running.write(json.dumps([topic, ros_type, latched, data.hex()]) + "\n")
        self._sent += 1

    def wait(self) -> None:
        if self._sent:
            self._running.wait_for(f"^sent {self._sent - 1}$")


@contextmanager
def _talking(ros: RosWorld, name: str = "talker") -> Iterator[Talker]:
    with ros.python(TALKER, ros.version, name) as running:
        yield Talker(running)


@pytest.fixture
def office(tmp_path: Path) -> Path:
    sl.create(tmp_path / "office", tz="UTC").close()
    (tmp_path / "robot.yaml").write_text(MAPPING)
    return tmp_path / "office"


def _record(ros: RosWorld, office: Path, *options: object) -> Running:
    mapping = office.parent / "robot.yaml"
    return ros.semmap("record", office, ros.option, "--mapping", mapping, *options)


def _wait_for_events(office: Path, count: int) -> None:
    wait_until(lambda: _count(office) >= count, f"{count} events in {office}")


def _count(office: Path) -> int:
    return sl.read(office).replay().event + 1


def _states(office: Path) -> dict[int | str, str]:
    doors = sl.read(office).replay().doors.values()
    return {door.name or door.door_id: door.state.name for door in doors}


def _kinds(office: Path, kind: type[Any]) -> list[Any]:
    return [e.event for batch in sl.read(office).batches(kinds=[kind]) for e in batch]


def test_all_that_a_robot_says_of_doors_is_in_the_log(every_ros: RosWorld, office: Path) -> None:
    """A server's map, Open-RMF, a contact, pose, TF, floor plan and rounds; who said it."""
    robot, started_ns = Robot(1 if every_ros.version == 1 else 2), time.time_ns()
    cells = np.array([[0, 100, -1], [0, 0, 100]], np.int8)

    with _talking(every_ros) as talker, _record(every_ros, office) as recorder:
        recorder.wait_for("/rounds: recording|/door_requests: recording")
        talker.say("/doors", robot.door_map([{"door_id": 4}]), latched=True)
        talker.say("/door_states", robot.door_state("lab", 3))
        talker.say("/door_requests", robot.door_request("lab", 2, "tug1"))
        talker.say("/contact", robot.said("Bool", True))
        talker.say("/tf_static", robot.transforms(("base_footprint", "base_link", 0, 0, 0)),
                   latched=True)  # fmt: skip
        talker.say(
            "/tf", robot.transforms(("map", "odom", 1, 0, 0), ("odom", "base_footprint", 2, 0, 0))
        )
        talker.wait()
        wait_until(lambda: len(_kinds(office, RobotPose)) == 1, "the pose by TF")
        talker.say("/amcl_pose", robot.pose(7, 8, 0.5, variances=(0.04, 0.01)))
        talker.say("/amcl_pose", robot.pose(9, 9, 0, frame="odom", variances=(0.04, 0.01)))
        talker.say("/map", robot.grid(cells), latched=True)
        talker.say("/rounds", robot.said("String", "start"))
        talker.wait()
        wait_until(lambda: _kinds(office, PatrolStarted), "the round")
        wait_until(lambda: sl.read(office).floor_map() is not None, "the floor plan")
        recorder.wait_for("/amcl_pose: a pose in another frame than map; passed over: 'odom'")
        wait_until(lambda: len(_kinds(office, RobotPose)) == 2, "the pose by AMCL")
        wait_until(lambda: _kinds(office, DoorRequested), "the request")
        wait_until(lambda: len(_states(office)) == 3, "three doors")
        wait_until(lambda: {"OFFLINE", "CLOSED"} <= set(_states(office).values()), "their states")
        assert 0 == recorder.stop()

    log = sl.read(office)
    assert {4: "OPEN", "lab": "OFFLINE", "office": "CLOSED"} == _states(office)
    assert [(3.0, 0.0), (7.0, 8.0)] == [(pose.x, pose.y) for pose in _kinds(office, RobotPose)]
    assert {1.0, 0.97} == {seen.accuracy_open for seen in _kinds(office, DoorObserved)}
    (request,) = [entry for entry in log.history() if isinstance(entry.event, DoorRequested)]
    sender = " of /talker" if every_ros.version == 1 else ""
    assert ("tug1", f"/door_requests{sender}") == (request.actor, request.source)
    assert all(started_ns < batch.happened_ns.min() for batch in log.batches())
    assert np.array_equal(cells, log.floor_map().cells)  # type: ignore[union-attr]


def _said_by(doors: Iterable[int], robot: Robot, talker: Talker, topic: str) -> None:
    for number in doors:
        talker.say(topic, robot.door_state(f"door{number}", 2))


def test_what_was_received_is_written_when_it_is_told_to_stop(
    jazzy: RosWorld, office: Path
) -> None:
    """With SIGTERM, amid a burst: every message that came is in the log."""
    robot = Robot(2)

    with _talking(jazzy) as talker, _record(jazzy, office) as recorder:
        recorder.wait_for("/door_states: recording")
        _said_by(range(500), robot, talker, "/door_states")
        _wait_for_events(office, 1)
        assert 0 == recorder.stop(signal.SIGTERM)

    said = recorder.wait_for(r": ([0-9,]+) messages, ([0-9,]+) events\.")
    messages, events = (int(count.replace(",", "")) for count in said.groups())
    assert 1 <= messages == len(sl.read(office).replay())
    assert (3 * messages, events) == (events, _count(office))


def test_a_recorder_that_was_killed_goes_on(ros: RosWorld, office: Path) -> None:
    """What it had is whole; the map that a server latched is compared."""
    robot = Robot(1 if ros.version == 1 else 2)

    with _talking(ros) as talker:
        with _record(ros, office) as recorder:
            recorder.wait_for("/doors: recording")
            talker.say("/doors", robot.door_map([{"door_id": 1}, {"door_id": 2}]), latched=True)
            talker.wait()
            _wait_for_events(office, 4)
            recorder.kill()
        talker.say("/door_states", robot.door_state("lab", 2))  # waits for a subscriber
        with _record(ros, office) as recorder:
            talker.say("/doors", robot.door_map([{"door_id": 2, "width": 2.0}]), latched=True)
            _wait_for_events(office, 9)
            assert 0 == recorder.stop()

    doors = sl.read(office).replay().doors
    assert [(2, 2.0), (3, "lab")] == [(d.door_id, d.name or d.width) for d in doors.values()]
    assert 9 == _count(office)


def test_a_dry_run_shows_events_as_they_come(ros1: RosWorld, office: Path) -> None:
    """Lines with their sources; the log stays as it is."""
    robot = Robot(1)

    with _talking(ros1) as talker, _record(ros1, office, "--dry-run") as recorder:
        recorder.wait_for("/door_states: recording")
        talker.say("/door_states", robot.door_state("lab", 0))
        recorder.wait_for('"DoorObserved"')
        assert 0 == recorder.stop()

    lines = [json.loads(line) for line in recorder.output.splitlines()]
    assert ["DoorAdded", "DoorAnnotated", "DoorObserved"] == [line["kind"] for line in lines]
    assert lines[-1]["source"].startswith("/door_states")
    assert 0 == _count(office)


def test_a_topic_whose_type_is_not_installed_is_left_out_aloud(
    jazzy: RosWorld, office: Path
) -> None:
    """With how to get it; the others are recorded."""
    (office.parent / "robot.yaml").write_text(
        "topics:\n"
        "  /odd: {read: sensor, door: odd, type: odd_msgs/Odd}\n"
        "  /contact: {read: sensor, door: office, type: std_msgs/Bool}\n"
    )

    with _talking(jazzy) as talker, _record(jazzy, office) as recorder:
        recorder.wait_for("/odd: left out: odd_msgs/msg/Odd: the package odd_msgs is not there")
        talker.say("/contact", Robot().said("Bool", True))
        _wait_for_events(office, 3)
        assert 0 == recorder.stop()


def test_a_master_that_is_started_anew_ends_no_recording(ros1: RosWorld, office: Path) -> None:
    """While it is away, what is connected goes on; behind it, new nodes are found again."""
    robot = Robot(1)

    with _talking(ros1) as talker, _record(ros1, office) as recorder:
        recorder.wait_for("/door_requests: recording")
        talker.say("/door_states", robot.door_state("lab", 0))
        _wait_for_events(office, 3)
        ros1.stop_master()
        recorder.wait_for("the ROS master does not answer")
        talker.say("/door_states", robot.door_state("lab", 1))
        _wait_for_events(office, 4)
        ros1.start_master()
        recorder.wait_for("ROS answers again")
        with _talking(ros1, "other") as other:  # of one name, a master ends the one that came first
            other.say("/contact", robot.said("Bool", True))
            _wait_for_events(office, 7)
        assert 0 == recorder.stop()
