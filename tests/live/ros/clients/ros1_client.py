"""A ROS 1 client as people write them: JSON lines in, JSON lines out."""

import sys
import threading
import uuid

import actionlib
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus
from geometry_msgs.msg import PoseArray
from lta_semantic_map import msg as messages
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid
from stock import DB, MEET_S, WITHIN_S, closed, doors, keep, places, serve
from visualization_msgs.msg import MarkerArray

clients = {}


def client(name, action, within):
    if name not in clients:
        # actionlib drops the progress of a goal whose result, on another socket, overtook it
        kind = getattr(messages, action + "ActionFeedback")
        rospy.Subscriber(name + "/feedback", kind, keep("progress of " + action, progress))
        clients[name] = actionlib.ActionClient(name, getattr(messages, action + "Action"))
    patience = rospy.Duration(max(within, MEET_S))
    return clients[name] if clients[name].wait_for_server(patience) else None


def progress(message):
    return [message.status.goal_id.id, message.feedback.percent_complete]


def goal(name, action, values, goal_id=None, within=WITHIN_S):
    done = threading.Event()
    made = client(name, action, within)
    if made is None:
        return {"status": "LOST"}
    made.manager._generate_id = lambda: GoalID(
        id=goal_id or uuid.uuid4().hex, stamp=rospy.get_rostime()
    )
    handle = made.send_goal(
        getattr(messages, action + "Goal")(**values),
        lambda h: done.set() if h.get_comm_state() == actionlib.CommState.DONE else None,
    )
    if not done.wait(within):
        return {"status": "LOST"}
    result = handle.get_result()
    return {
        "status": GoalStatus.to_string(handle.get_goal_status()),
        "result": {name: getattr(result, name) for name in result.__slots__},
        "text": handle.get_goal_status_text(),
    }


rospy.init_node(sys.argv[1])
prefix = sys.argv[2] if len(sys.argv) > 2 else ""
for topic, kind, summary in [
    (DB, messages.DoorMap, doors),
    ("/semmap/doors", MarkerArray, lambda message: len(message.markers)),
    ("/semmap/costmap", OccupancyGrid, closed),
    ("/semmap/patrol_plan", PoseArray, places),
    ("/semmap/costmap_updates", OccupancyGridUpdate, closed),
]:
    rospy.Subscriber(prefix + topic, kind, keep(topic, summary))
serve(goal)
