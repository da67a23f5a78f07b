"""A server of the thesis's actions as anybody writes one, with nothing of ours: in its memory.

Its action servers are called `plain/AddDoor` and so on; it counts its doors from 0.
"""

from __future__ import annotations

from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import Running

_DATABASE = """
import sys

FIELDS = {"change_pos": ["pos_x", "pos_y", "pos_theta"], "change_width": ["width"],
          "change_open": ["door_state"], "change_prob_open": ["prob_open"],
          "change_prob_closed": ["prob_closed"]}
NEW = ["pos_x", "pos_y", "pos_theta", "width", "door_state", "prob_open", "prob_closed"]
doors = {}

def run(action, goal, entry):
    "Return whether it was done, and the result's only value."
    if action == "AddDoor":
        number = max(doors, default=-1) + 1
        doors[number] = entry(door_id=number, **{name: getattr(goal, name) for name in NEW})
        return True, number
    if action == "SaveDoorDB":
        return goal.file_name.endswith(".yaml"), goal.file_name.endswith(".yaml")
    if goal.door_id not in doors:
        return False, False
    if action == "RemoveDoor":
        del doors[goal.door_id]
    else:
        for change, names in FIELDS.items():
            for name in names if getattr(goal, change) else []:
                setattr(doors[goal.door_id], name, getattr(goal, name))
    return True, True

RESULTS = {"AddDoor": "door_id", "UpdateDoor": "door_updated", "RemoveDoor": "door_removed",
           "SaveDoorDB": "stored_successful"}
"""

SERVER = {
    1: _DATABASE
    + """
import actionlib, rospy
from lta_semantic_map import msg

rospy.init_node("plain_server")
publisher = rospy.Publisher("/lta_semantic_map_door_db", msg.DoorMap, queue_size=1, latch=True)

def serve(action):
    def got():
        goal = server.accept_new_goal()
        done, value = run(action, goal, msg.DoorEntry)
        publisher.publish(list(doors.values()))
        result = getattr(msg, action + "Result")(value)
        server.set_succeeded(result) if done else server.set_aborted(result, "no such door")
    kind = getattr(msg, action + "Action")
    server = actionlib.SimpleActionServer("plain/" + action, kind, auto_start=False)
    server.register_goal_callback(got)
    server.start()

publisher.publish([])
for each in RESULTS:
    serve(each)
print("ready", file=sys.stderr, flush=True)
rospy.spin()
""",
    2: _DATABASE
    + """
import rclpy
from lta_semantic_map import action as actions
from lta_semantic_map.msg import DoorEntry, DoorMap
from rclpy.action import ActionServer
from rclpy.qos import DurabilityPolicy, QoSProfile

rclpy.init()
node = rclpy.create_node("plain_server")
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
publisher = node.create_publisher(DoorMap, "/lta_semantic_map_door_db", latched)

def serve(action):
    kind = getattr(actions, action)
    def execute(handle):
        done, value = run(action, handle.request, DoorEntry)
        publisher.publish(DoorMap(door_db=list(doors.values())))
        handle.succeed() if done else handle.abort()
        return kind.Result(**{RESULTS[action]: value})
    return ActionServer(node, kind, "plain/" + action, execute)

publisher.publish(DoorMap())
servers = [serve(each) for each in RESULTS]
print("ready", file=sys.stderr, flush=True)
rclpy.spin(node)
""",
}
"""By the version of ROS."""


def plain_server(world: RosWorld) -> Running:
    """Start one; it is ready when this returns."""
    server = world.code(SERVER[world.version])
    server.wait_for("ready")
    return server
