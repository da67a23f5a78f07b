"""The worlds that the other tests here run in are real, and leave nothing behind."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.live.ros.network_namespace import NetworkNamespace, NoNamespaceError
from tests.live.ros.ros_world import NotSetUpError, RosWorld, interpreter
from tests.live.ros.running import Running, wait_until

TALK_AND_LISTEN = {
    1: """
import rospy
from lta_semantic_map.msg import DoorEntry, DoorMap
rospy.init_node("test")
publisher = rospy.Publisher("doors", DoorMap, latch=True, queue_size=1)
publisher.publish(DoorMap([DoorEntry(door_id=7)]))
print("heard", rospy.wait_for_message("doors", DoorMap, 60).door_db[0].door_id)
""",
    2: """
import rclpy
from lta_semantic_map.msg import DoorEntry, DoorMap
from rclpy.wait_for_message import wait_for_message
rclpy.init()
node = rclpy.create_node("test")
publisher = node.create_publisher(DoorMap, "doors", 1)
timer = node.create_timer(0.1, lambda: publisher.publish(DoorMap(door_db=[DoorEntry(door_id=7)])))
heard = []
node.create_subscription(DoorMap, "doors", heard.append, 1)
while not heard:
    rclpy.spin_once(node, timeout_sec=1)
print("heard", heard[0].door_db[0].door_id)
""",
}


def test_nodes_speak_the_messages_of_the_thesis(every_ros: RosWorld) -> None:
    """Its interpreter has a ROS that works, and the messages that were built for it."""
    said = every_ros.code(TALK_AND_LISTEN[every_ros.version]).finish()

    assert "heard 7" in said


@pytest.fixture
def network() -> NetworkNamespace:
    try:
        return NetworkNamespace.open()
    except NoNamespaceError as error:
        pytest.skip(str(error))


def test_nothing_survives_its_network(network: NetworkNamespace, tmp_path: Path) -> None:
    """Not even the children of a process that was started in it, nor one that heeds no signal."""
    script = "import os, signal, time; signal.signal(15, signal.SIG_IGN); os.fork(); "
    script += "print(os.getpid(), flush=True); time.sleep(600)"
    with (tmp_path / "stdout").open("wb") as out:
        process = subprocess.Popen(network.inside([sys.executable, "-c", script]), stdout=out)
    running = Running(process, "two sleepers", tmp_path)
    (tmp_path / "stderr").touch()
    running.wait_for(r"\d+\n\d+\n")
    pids = [int(pid) for pid in running.output.split()]

    network.close()

    process.wait(timeout=100)
    wait_until(lambda: not any(map(_is_alive, pids)), "two ends")


def _is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_what_is_not_set_up_is_named_with_its_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tests that skip say what to run."""
    monkeypatch.setenv("SEMMAP_ROS", str(tmp_path))

    with pytest.raises(NotSetUpError, match=r"ROS 1 is not set up.*tools/set_up_ros.py ros1"):
        interpreter("ros1")
