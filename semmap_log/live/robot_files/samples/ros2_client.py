#!/usr/bin/env python3
"""A client of the door server for ROS 2: adds a door, opens it, and sees that on the topic.

It knows nothing but the messages, of a workspace that was built and whose setup.sh was sourced:
`semmap-log ros-package SRC` says how.
"""

import rclpy
from action_msgs.msg import GoalStatus
from lta_semantic_map.action import AddDoor, UpdateDoor
from lta_semantic_map.msg import DoorMap
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile


def call(node, action, name, **goal):
    """Send a goal; return its result, or raise. Why it was aborted, the server says on /rosout."""
    client = ActionClient(node, action, name)
    if not client.wait_for_server(60):
        raise SystemExit(f"no action server {name}")
    sent = client.send_goal_async(action.Goal(**goal))
    rclpy.spin_until_future_complete(node, sent, timeout_sec=60)
    answer = sent.result().get_result_async()
    rclpy.spin_until_future_complete(node, answer, timeout_sec=60)
    if answer.result().status != GoalStatus.STATUS_SUCCEEDED:
        raise SystemExit(f"{name}: goal aborted")
    return answer.result().result


doors = {}  # as the server published them last: it sends all of them, at each change


def on_door_map(door_map):
    """Take the doors; a client that comes late gets the last message: it is transient_local."""
    doors.clear()
    doors.update((entry.door_id, entry) for entry in door_map.door_db)


rclpy.init()
node = rclpy.create_node("sample_door_client")
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_subscription(DoorMap, "/lta_semantic_map_door_db", on_door_map, latched)
place = {"pos_x": 2.0, "pos_y": 1.5, "pos_theta": 0.0, "width": 0.9}
door_id = call(node, AddDoor, "lta_semantic_map/add_door", door_state="CLOSED",
               prob_open=0.2, prob_closed=0.8, **place).door_id  # fmt: skip
call(node, UpdateDoor, "lta_semantic_map/update_door", door_id=door_id,
     change_open=True, door_state="OPEN")  # fmt: skip
while door_id not in doors or doors[door_id].door_state != "OPEN":
    rclpy.spin_once(node, timeout_sec=0.1)
print(f"door {door_id} is {doors[door_id].door_state}")
