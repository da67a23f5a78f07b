"""The port of ROS nodes, on a real ROS 1 and a real ROS 2: what one side says is what comes out."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator

import pytest

from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import Running

PATIENCE = """
from semmap_log.live.ros import ros1, ros1_topics, ros2, ros2_topics
ros1.SENT_WITHIN_S = ros2.ACKNOWLEDGED_WITHIN_S = 100
ros1_topics.LISTENS_WITHIN_S = ros2_topics.KNOWN_WITHIN_S = 100
ros2.RESULT_KEPT_S = 600
"""
"""Who is waited for is there in the end, however busy this machine is."""

SERVER = (
    PATIENCE
    + """
import json, signal, sys, threading, time
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.live.ros.ros_node import Outcome
from semmap_log.live.ros.joining import open_node

version, *ros_args = sys.argv[1:]
node = open_node(int(version), "doors", ros_args)
words = node.publisher(BagTopic("words", "std_msgs/msg/String", is_latched=True))
running, at_once, others = 0, 0, threading.Condition()

def add(goal):
    global running, at_once
    with others:
        running += 1
        at_once = max(at_once, running)
        others.notify_all()
        if goal.values["pos_x"]:
            assert others.wait_for(lambda: at_once > 1, 60), "alone"
    goal.feedback(50.0)
    time.sleep(goal.values["pos_x"])
    with others:
        running -= 1
    said = [goal.action, goal.goal_id.hex(), goal.raw_goal_id, goal.caller, dict(goal.values)]
    print(json.dumps(said), flush=True)
    if goal.values["width"] < 0:
        return Outcome(False, {"door_id": 0}, "width: expected a width, got a gap.")
    if goal.values["width"] > 100:
        raise RuntimeError("no such wide door")
    return Outcome(True, {"door_id": 7}, "a warning")

node.serve_action("AddDoor", "add", add)
node.subscribe("numbers", "std_msgs/msg/Int32", lambda got: print(json.dumps(
    [got.topic, got.ros_type, got.data.hex(), got.sender, got.definition]), flush=True))
hello = b"\\x05\\x00\\x00\\x00hello" if node.ros_version == 1 else (
    b"\\x00\\x01\\x00\\x00\\x06\\x00\\x00\\x00hello\\x00")
words.publish(hello)
stop = threading.Event()
signal.signal(signal.SIGTERM, lambda *_: stop.set())
print("ready", node.name, node.parameter("greeting", "none"), flush=True)
node.run(stop.is_set)
words.publish(hello.replace(b"hello", b"adieu"))
node.close()
"""
)

CLIENT = """
import dataclasses, json, sys
from semmap_log.errors import RosError
from semmap_log.live.ros.joining import open_node

version, goals, *ros_args = sys.argv[1:]
node = open_node(int(version), "asker", ros_args)
for name, values, goal_id, *timeout_s in json.loads(goals):
    goal_id = None if goal_id is None else bytes.fromhex(goal_id)
    try:
        answer = node.call_action(
            "AddDoor", name, values, goal_id=goal_id, timeout_s=(timeout_s or [60.0])[0])
        print(json.dumps([answer.status, dict(answer.result), answer.text]))
    except RosError as error:
        print(json.dumps(str(error)))
node.close()
"""


@pytest.fixture(scope="module")
def ros(every_ros: RosWorld) -> RosWorld:
    return every_ros


@pytest.fixture(scope="module")
def server(ros: RosWorld) -> Iterator[Running]:
    """A node in a namespace, with a parameter."""
    with ros.code(SERVER, ros.version, *_ros_args(ros, greeting="servus")) as running:
        running.wait_for("^ready")
        yield running


def _ros_args(ros: RosWorld, **parameters: str) -> list[str]:
    if ros.version == 1:
        return ["__ns:=/robot1", *(f"_{name}:={value}" for name, value in parameters.items())]
    given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    return ["--ros-args", "-r", "__ns:=/robot1", *given]


def _ask(ros: RosWorld, *goals: tuple[object, ...]) -> list[object]:
    """Return the answers; a goal is a name, values, an id or None, and perhaps its patience."""
    said = ros.code(CLIENT, ros.version, json.dumps(goals), *_ros_args(ros)).finish()
    return [json.loads(line) for line in said.splitlines() if line.startswith(('["', '"'))]


def test_a_node_has_its_name_and_its_parameters_from_ros(server: Running) -> None:
    """The namespace is part of the name, and a parameter has the value that was given."""
    assert "ready /robot1/doors servus" in server.output


def test_a_goal_is_answered_as_it_was_run(ros: RosWorld, server: Running) -> None:
    """Values go in, status and result come out; ROS 1 has the text in the status, too."""
    answers = _ask(
        ros,
        ("add", {"width": 0.9, "door_state": "OPEN"}, None),
        ("add", {"width": -1.0}, "00112233445566778899aabbccddeeff"),
        ("add", {"width": 101.0}, None),
    )

    has_text = ros.version == 1
    assert [
        ["SUCCEEDED", {"door_id": 7}, "a warning" if has_text else ""],
        ["ABORTED", {"door_id": 0}, "width: expected a width, got a gap." if has_text else ""],
        ["ABORTED", {"door_id": 0}, "RuntimeError: no such wide door" if has_text else ""],
    ] == answers
    server.wait_for(r"Traceback \(most recent call last\)")  # a fault of ours is not swallowed
    server.wait_for("refused goal 00112233445566778899aabbccddeeff: width: expected a width")
    server.wait_for("refused goal .*: RuntimeError: no such wide door")
    server.wait_for("AddDoor: warning about goal .*: a warning")


def test_a_goal_says_who_sent_it_and_has_an_id(ros: RosWorld, server: Running) -> None:
    """
    The caller is the client's node, and the same id is the same 16 bytes each time it is sent.
    """
    same = "000102030405060708090a0b0c0d0e0f"

    _ask(ros, ("add", {"width": 0.5}, same))

    server.wait_for(same)
    goals = [json.loads(line) for line in server.output.splitlines() if same in line]
    (action, goal_id, raw_goal_id, caller, values) = goals[-1]
    assert ("AddDoor", "/robot1/asker", 0.5) == (action, caller, values["width"])
    assert (same if ros.version == 2 else 32) == (goal_id if ros.version == 2 else len(goal_id))
    assert same == raw_goal_id


def test_a_goal_that_is_sent_again_at_once_is_answered_again(
    ros: RosWorld, server: Running
) -> None:
    """actionlib itself would say nothing for five seconds, and rclpy refuse it for ten."""
    again, bad = ("add", {"width": 0.7}, "a1" * 16), ("add", {"width": -1.0}, "a2" * 16)

    answers = _ask(ros, again, again)
    aborted = _ask(ros, bad, bad)

    text = "a warning" if ros.version == 1 else ""
    assert [["SUCCEEDED", {"door_id": 7}, text]] * 2 == answers
    assert ["ABORTED", "ABORTED" if ros.version == 1 else "REJECTED"] == [one[0] for one in aborted]


def test_a_server_that_is_not_there_is_told(ros: RosWorld) -> None:
    """Whoever calls it hears so, with what to look at."""
    (answer,) = _ask(ros, ("nowhere", {}, None, 0.3))

    assert "no action server /robot1/nowhere answered within 0.3 s" in str(answer)


def test_messages_of_another_type_are_passed_over_aloud(ros: RosWorld, server: Running) -> None:
    """Those of the type that was expected come as their bytes, others are named."""
    tell = TELL_1 if ros.version == 1 else TELL_2

    with ros.code(tell, "String", "'forty-two'"):
        server.wait_for("/robot1/numbers: expected std_msgs/msg/Int32, got std_msgs/msg/String")
    with ros.code(tell, "Int32", "42"):
        server.wait_for(r'"/robot1/numbers", "std_msgs/msg/Int32"')
    got = [json.loads(line) for line in server.output.splitlines() if "Int32" in line]
    data = "2a000000" if ros.version == 1 else "000100002a000000"
    assert ["/robot1/numbers", "std_msgs/msg/Int32", data] == got[-1][:3]
    assert (["/teller", "int32 data"] if ros.version == 1 else ["", ""]) == got[-1][3:]


TELL_1 = """
import sys
import rospy
from std_msgs import msg
rospy.init_node("teller")
kind = getattr(msg, sys.argv[1])
publisher = rospy.Publisher("/robot1/numbers", kind, latch=True, queue_size=1)
publisher.publish(kind(eval(sys.argv[2])))
rospy.spin()
"""

TELL_2 = """
import sys
import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs import msg
rclpy.init()
node = rclpy.create_node("teller")
kind = getattr(msg, sys.argv[1])
best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
publisher = node.create_publisher(kind, "/robot1/numbers", best_effort)
node.create_timer(0.1, lambda: publisher.publish(kind(data=eval(sys.argv[2]))))
rclpy.spin(node)
"""

MANY_GOALS_1 = """
import actionlib, rospy, threading
from lta_semantic_map.msg import AddDoorAction, AddDoorGoal
from actionlib_msgs.msg import GoalID
rospy.init_node("many")
client = actionlib.ActionClient("/robot1/add", AddDoorAction)
assert client.wait_for_server(rospy.Duration(60))
handles = [client.send_goal(AddDoorGoal(width=1.0, pos_x=0.2)) for _ in range(4)]
rospy.sleep(0.05)
client.cancel_all_goals()
late = GoalID(id="late", stamp=rospy.Time(1))  # from a robot whose clock is behind
client.cancel_goals_at_and_before_time(rospy.get_rostime())
rospy.sleep(0.1)
client.manager._generate_id = lambda: late
handles.append(client.send_goal(AddDoorGoal(width=1.0)))
end = rospy.get_rostime() + rospy.Duration(60)
while any(h.get_comm_state() != actionlib.CommState.DONE for h in handles):
    assert rospy.get_rostime() < end
    rospy.sleep(0.02)
print("all", {h.get_terminal_state() for h in handles} == {actionlib.TerminalState.SUCCEEDED})
"""

MANY_GOALS_2 = """
import rclpy
from rclpy.action import ActionClient
from lta_semantic_map.action import AddDoor
rclpy.init()
node = rclpy.create_node("many")
client = ActionClient(node, AddDoor, "/robot1/add")
assert client.wait_for_server(60)
def done(future):
    rclpy.spin_until_future_complete(node, future, timeout_sec=60)
    return future.result()
sent = [client.send_goal_async(AddDoor.Goal(width=1.0, pos_x=0.2)) for _ in range(4)]
handles = [done(future) for future in sent]
results = [handle.get_result_async() for handle in handles]
cancels = [handle.cancel_goal_async() for handle in handles]
print("cancelled", sum(len(done(future).goals_canceling) for future in cancels))
print("all", {done(future).status for future in results} == {4})
"""


def test_goals_run_side_by_side_and_a_cancel_comes_too_late(ros: RosWorld, server: Running) -> None:
    """Several at once, so that they can share a sync."""
    said = ros.code(MANY_GOALS_1 if ros.version == 1 else MANY_GOALS_2).finish()

    assert "all True" in said


LISTEN_1 = """
import rospy
from std_msgs.msg import String
rospy.init_node("listener")
rospy.Subscriber("/robot1/words", String, lambda got: print("heard", got.data, flush=True))
rospy.spin()
"""

LISTEN_2 = """
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("listener")
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_subscription(
    String, "/robot1/words", lambda got: print("heard", got.data, flush=True), latched)
rclpy.spin(node)
"""


def test_what_is_published_last_is_heard(ros: RosWorld, server: Running) -> None:
    """A late listener hears what is latched."""
    with ros.code(LISTEN_1 if ros.version == 1 else LISTEN_2) as listener:
        listener.wait_for("heard hello")

        server.stop(signal.SIGTERM)

        listener.wait_for("heard adieu")


LATE_READER = (
    PATIENCE
    + """
from rclpy.impl.implementation_singleton import rclpy_implementation
from semmap_log.live.ros.joining import open_node
from semmap_log.live.ros.ros_node import Outcome

class Late:
    "What sends a server's answers, and at first does not find their reader."

    def __init__(self, handle):
        self.handle, self.failures = handle, [1, 1, 1, 0] + 11 * [1]

    def __getattr__(self, name):
        return getattr(self.handle, name)

    def __enter__(self):
        return self.handle.__enter__()

    def __exit__(self, *error):
        return self.handle.__exit__(*error)

    def send_goal_response(self, *answer):
        if self.failures and self.failures.pop(0):
            raise rclpy_implementation.RCLError("client will not receive response")
        self.handle.send_goal_response(*answer)

node, ran = open_node(2, "late"), []

def add(goal):
    ran.append(goal.raw_goal_id)
    return Outcome(True, {"door_id": len(ran)})

node.serve_action("AddDoor", "/robot1/late", add)
(server,) = [each for each in node._node.waitables if hasattr(each, "_goal_handles")]
server._handle = Late(server._handle)
print("ready", flush=True)
node.run(lambda: False)
"""
)


def test_a_goal_whose_client_is_not_known_yet_is_run_and_answered(jazzy: RosWorld) -> None:
    """rclpy would keep it for ever without running it."""
    first = ("/robot1/late", {"width": 0.7}, "b1" * 16)
    second = ("/robot1/late", {"width": 0.7}, "b2" * 16)

    with jazzy.code(LATE_READER) as server:
        server.wait_for("^ready")
        soon, lost, again = _ask(jazzy, first, (*second, 2.0), second)  # the client knows it by now

    assert ["SUCCEEDED", {"door_id": 1}, ""] == soon
    assert "no result within 2 s" in str(lost)
    assert ["SUCCEEDED", {"door_id": 2}, ""] == again


SLOW_LINE = (
    PATIENCE
    + """
import time
from rospy.impl.tcpros_base import TCPROSTransport
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.live.ros.joining import open_node

send = TCPROSTransport.write_data

def send_late(line, data):
    time.sleep(0.5)
    send(line, data)

TCPROSTransport.write_data = send_late
node = open_node(1, "slow")
words = node.publisher(BagTopic("/robot1/words", "std_msgs/msg/String", is_latched=False))
while not words.subscribers():
    time.sleep(0.02)
words.publish(b"\\x05\\x00\\x00\\x00adieu")
node.close()
"""
)


def test_what_is_just_being_sent_is_waited_for(ros1: RosWorld) -> None:
    """The thread that sends has taken it from the queue, and got no further."""
    with ros1.code(LISTEN_1) as listener:
        ros1.code(SLOW_LINE).finish()

        listener.wait_for("heard adieu")


def test_a_missing_ros_is_told_with_what_to_do(ros: RosWorld) -> None:
    """The other ROS is not in this Python, and without a master ROS 1 cannot be joined."""
    code = """
import sys
from semmap_log.live.ros.joining import open_node
for version in (1, 2):
    try:
        open_node(version, "x")
    except Exception as error:
        print(type(error).__name__, error)
"""

    no_master = {"ROS_MASTER_URI": "http://127.0.0.1:1"}
    said = ros.code(code, environment=no_master).finish()

    expected = "ROS 2 is not there for this Python" if ros.version == 1 else "ROS 1 is not there"
    assert f"RosError {expected}" in said
    assert ros.version == 2 or "RosError no ROS master answers at http://127.0.0.1:1" in said


def test_a_server_is_known_to_a_master_that_was_started_anew(ros1: RosWorld) -> None:
    """Who joins after that finds its actions; rospy itself would stay unknown for ever."""
    with ros1.code(SERVER, 1, *_ros_args(ros1)) as running:
        running.wait_for("^ready")
        _ask(ros1, ("add", {"width": 0.7}, None))  # by then it has seen the first master
        ros1.stop_master()
        ros1.start_master()

        (answer,) = _ask(ros1, ("add", {"width": 0.7}, None))

        assert ["SUCCEEDED", {"door_id": 7}, "a warning"] == answer


def test_a_node_whose_name_is_taken_says_so(ros1: RosWorld) -> None:
    """ROS 1 ends the older of two nodes of one name: that is no end as by Ctrl-C."""
    with ros1.code(SERVER, 1, *_ros_args(ros1)) as first:
        first.wait_for("^ready")

        with ros1.code(SERVER, 1, *_ros_args(ros1)) as second:
            second.wait_for("^ready")

            assert 1 == first.wait()
    assert "/robot1/doors was ended by ROS: another node has taken its name" in first.errors
