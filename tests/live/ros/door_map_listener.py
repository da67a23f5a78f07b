"""Subscribers as the thesis's components are: they know rospy or rclpy, and the message, no more.

Each prints a line of JSON for every DoorMap: its entries, and the node's time when it came.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from semmap_log.core.model.doors import DoorMap, reduced
from semmap_log.log.door_log.door_log import DoorLog
from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import Running

_ENTRY = """
import json, sys

def entries(message):
    return [[e.door_id, e.pos_x, e.pos_y, e.pos_theta, e.width, e.door_state, e.prob_open,
             e.prob_closed] for e in message.door_db]

def say(now_ns, doors):
    print(json.dumps({"now_ns": now_ns, "doors": doors}), flush=True)
"""

LISTENER = {
    1: _ENTRY
    + """
import rospy
from lta_semantic_map.msg import DoorMap

rospy.init_node("listener", anonymous=True)
rospy.Subscriber("/lta_semantic_map_door_db", DoorMap,
                 lambda message: say(rospy.get_rostime().to_nsec(), entries(message)))
print("ready", file=sys.stderr, flush=True)
rospy.spin()
""",
    2: _ENTRY
    + """
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from lta_semantic_map.msg import DoorMap

rclpy.init()
node = rclpy.create_node("listener")
node.create_subscription(DoorMap, "/lta_semantic_map_door_db",
                         lambda message: say(node.get_clock().now().nanoseconds, entries(message)),
                         QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL))
print("ready", file=sys.stderr, flush=True)
rclpy.spin(node)
""",
}
"""By the version of ROS."""


@dataclass(frozen=True, slots=True)
class Heard:
    """A DoorMap, as it came."""

    now_ns: int
    doors: str
    """The entries, as text: so a NaN equals a NaN."""


def listen(world: RosWorld, *arguments: str) -> Running:
    """Start a subscriber; it is ready when this returns."""
    listener = world.code(LISTENER[world.version], *arguments)
    listener.wait_for("ready")
    return listener


def heard(listener: Running) -> list[Heard]:
    """Return what came so far."""
    *lines, _ = listener.output.split("\n")
    return [Heard(said["now_ns"], str(said["doors"])) for said in map(json.loads, lines)]


def door_maps(
    log: DoorLog, since_ns: int | None = None, until_ns: int | None = None
) -> list[Heard]:
    """Return what is to be heard of a log: a replay at each event, if it is another.

    Args:
        log: The log.
        since_ns: The first is that of this moment; None: of the first event.
        until_ns: The last moment; None: the log's end.
    """
    times = {min(entry.happened_ns, entry.recorded_ns) for entry in log.history()}
    if since_ns is not None:
        times = {since_ns, *(at_ns for at_ns in times if at_ns > since_ns)}
    told: list[Heard] = []
    for at_ns in sorted(times):
        doors = _entries(log.replay(at=at_ns))
        if (until_ns is None or at_ns <= until_ns) and [doors] != [
            each.doors for each in told[-1:]
        ]:
            told.append(Heard(at_ns, doors))
    return told


def _entries(door_map: DoorMap) -> str:
    listed: list[list[Any]] = [
        [int(d.door_id), d.x, d.y, d.theta, d.width, reduced(d.state).name, d.prob_open,
         d.prob_closed]
        for d in door_map.doors.values()
        if d.is_placed
    ]  # fmt: skip
    return str(listed)
