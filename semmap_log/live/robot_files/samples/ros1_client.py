#!/usr/bin/env python3
"""A client of the door server for ROS 1: adds a door, opens it, and sees that on the topic.

It knows nothing but the messages, which Python must find: in a built workspace, whose
devel/setup.sh was sourced, or in a folder on PYTHONPATH, made without a build by
`semmap-log ros-package DIR --messages`.
"""

import actionlib
import rospy
from lta_semantic_map import msg


def call(action, name, **goal):
    """Send a goal; return its result, or raise what the server says."""
    client = actionlib.SimpleActionClient(name, getattr(msg, f"{action}Action"))
    if not client.wait_for_server(rospy.Duration(60)):
        raise SystemExit(f"no action server {name}")
    client.send_goal_and_wait(getattr(msg, f"{action}Goal")(**goal), rospy.Duration(60))
    if client.get_state() != actionlib.GoalStatus.SUCCEEDED:
        raise SystemExit(f"{name}: {client.get_goal_status_text()}")
    return client.get_result()


doors = {}  # as the server published them last: it sends all of them, at each change


def on_door_map(door_map):
    """Take the doors; a client that comes late gets the last message, it is latched."""
    doors.clear()
    doors.update((entry.door_id, entry) for entry in door_map.door_db)


rospy.init_node("sample_door_client", anonymous=True)
rospy.Subscriber("/lta_semantic_map_door_db", msg.DoorMap, on_door_map)
place = {"pos_x": 2.0, "pos_y": 1.5, "pos_theta": 0.0, "width": 0.9}
door_id = call("AddDoor", "lta_semantic_map/add_door", door_state="CLOSED",
               prob_open=0.2, prob_closed=0.8, **place).door_id  # fmt: skip
call("UpdateDoor", "lta_semantic_map/update_door", door_id=door_id,
     change_open=True, door_state="OPEN")  # fmt: skip
while door_id not in doors or doors[door_id].door_state != "OPEN":
    rospy.sleep(0.05)
print(f"door {door_id} is {doors[door_id].door_state}")
