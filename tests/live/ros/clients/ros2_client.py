"""A ROS 2 client as people write them: JSON lines in, JSON lines out."""

import os
import sys
import threading
import traceback

import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseArray
from lta_semantic_map import action as actions
from lta_semantic_map.msg import DoorMap
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from stock import DB, MEET_S, WITHIN_S, closed, doors, keep, places, serve
from unique_identifier_msgs.msg import UUID
from visualization_msgs.msg import MarkerArray

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
STATUS = {GoalStatus.STATUS_SUCCEEDED: "SUCCEEDED", GoalStatus.STATUS_ABORTED: "ABORTED"}

clients = {}


def from_executor(send):
    """Return what `send` returns, called by the executor's thread.

    rclpy of Jazzy forgets an answer that comes before the thread that asked has noted its number;
    that of Kilted may die of an action client that is being made by another thread.
    """
    sent = executor.create_task(send)
    done = threading.Event()
    sent.add_done_callback(lambda _: done.set())
    done.wait()
    return sent.result()


def wait_for(future, within):
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    return future.result() if done.wait(within) else None


def client(name, action, within):
    if name not in clients:
        from_executor(lambda: clients.update({name: made(name, action)}))
    return clients[name] if clients[name].wait_for_server(max(within, MEET_S)) else None


def made(name, action):
    # by the topic: an action client forgets a goal whose result overtook its progress
    kind = getattr(actions, action).Impl.FeedbackMessage
    heard = keep("progress of " + action, progress)
    node.create_subscription(kind, name + "/_action/feedback", heard, 10)
    return ActionClient(node, getattr(actions, action), name)


def progress(message):
    return [bytes(message.goal_id.uuid).hex(), message.feedback.percent_complete]


def goal(name, action, values, goal_id=None, within=WITHIN_S):
    asked = client(name, action, within)
    if asked is None:
        return {"status": "LOST"}

    def send():
        return asked.send_goal_async(
            getattr(actions, action).Goal(**values),
            goal_uuid=None if goal_id is None else UUID(uuid=list(bytes.fromhex(goal_id))),
        )

    accepted = wait_for(from_executor(send), within)
    if accepted is None or not accepted.accepted:
        return {"status": "LOST" if accepted is None else "REJECTED"}
    answer = wait_for(from_executor(accepted.get_result_async), within)
    if answer is None:
        return {"status": "LOST"}
    names = answer.result.get_fields_and_field_types()
    return {
        "status": STATUS.get(answer.status, answer.status),
        "result": {name: getattr(answer.result, name) for name in names},
    }


def spin():
    try:
        executor.spin()
    except Exception:  # noqa: BLE001
        traceback.print_exc()
        os._exit(1)  # nobody else would hear of it, and wait for ever


rclpy.init()
node = rclpy.create_node(sys.argv[1])
prefix = sys.argv[2] if len(sys.argv) > 2 else ""
for topic, kind, summary, profile in [
    (DB, DoorMap, doors, LATCHED),
    ("/semmap/doors", MarkerArray, lambda message: len(message.markers), LATCHED),
    ("/semmap/costmap", OccupancyGrid, closed, LATCHED),
    ("/semmap/patrol_plan", PoseArray, places, LATCHED),
    ("/semmap/costmap_updates", OccupancyGridUpdate, closed, 10),
]:
    node.create_subscription(kind, prefix + topic, keep(topic, summary), profile)
executor = rclpy.executors.SingleThreadedExecutor()
executor.add_node(node)
threading.Thread(target=spin, daemon=True).start()
serve(goal)
executor.shutdown()
rclpy.shutdown()
