"""ROS 1's topics as bytes: publishers, unsent messages, and a master that restarts.

It also adds what actionlib lacks (patience with clocks, answers to goals sent again, given ids),
and handles rospy's links between nodes: they are reported before they are up, and may be made
twice.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPConnection, HTTPException
from types import ModuleType
from typing import Any
from xmlrpc.client import Error, ServerProxy, Transport

from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import ros1_definition, short_name

QUEUED = 1000
"""Messages of a topic that wait for a slow subscriber; beyond, rospy drops the oldest."""

MASTER_EVERY_S = 1.0
"""How soon we register at a master that restarted."""


class Ros1Publisher:
    """A publisher of bytes: rospy asks a message's class for no more than name, md5 and text."""

    def __init__(self, rospy: ModuleType, topic: BagTopic) -> None:
        text, md5 = ros1_definition(topic.ros_type)
        self._class = type(
            "Bytes",
            (rospy.AnyMsg,),
            {
                "__slots__": (),
                "_type": short_name(topic.ros_type),
                "_md5sum": md5,
                "_full_text": text,
            },
        )
        self._publisher = rospy.Publisher(
            topic.name, self._class, latch=topic.is_latched, queue_size=QUEUED, tcp_nodelay=True
        )
        self._has_gone = rospy.ROSException

    def publish(self, data: bytes) -> None:
        """Send a message."""
        message = self._class()
        message._buff = data  # noqa: SLF001  its own
        with suppress(self._has_gone):  # ROS ends: nobody is left to hear it
            self._publisher.publish(message)

    def subscribers(self) -> int:
        """Return how many listen."""
        return int(self._publisher.get_num_connections())

    def wait(self, timeout_s: float) -> None:
        """Return once all is sent, or the time is over."""
        deadline = time.monotonic() + timeout_s
        while _is_sending(self._publisher.impl) and time.monotonic() < deadline:
            time.sleep(0.001)


def is_sending() -> bool:
    """Return whether anything of this process waits to be sent: messages, results of actions."""
    from rospy.topics import get_topic_manager

    return any(_is_sending(topic) for topic in list(get_topic_manager().pubs.values()))


def _is_sending(topic: Any) -> bool:
    """Return whether messages of a topic wait to be sent, or are just being sent."""
    return any(_is_busy(connection) for connection in topic.connections)


def _is_busy(connection: Any) -> bool:
    """Return whether the thread of a rospy QueuedConnection has anything to do.

    It takes all that is queued, then sends it: an empty queue alone does not say that it is out.
    """
    if connection.done or not hasattr(connection, "_queue"):
        return False
    with connection._lock:  # noqa: SLF001  rospy has no other way to know
        is_waiting = bool(connection._cond_data_available._waiters)  # noqa: SLF001
        return bool(connection._queue) or not is_waiting  # noqa: SLF001


def stay_known(node: str, known_to: int, ended: threading.Event) -> None:
    """Register this node at each master that restarts; rospy itself never does.

    Args:
        node: Its name.
        known_to: The process of the master that knows it.
        ended: Set when that is no longer needed.
    """
    import rosgraph
    from rospy.impl.registration import Registration, get_registration_listeners
    from rospy.topics import get_topic_manager

    ours, tell = get_topic_manager(), get_registration_listeners().notify_added
    while not ended.wait(MASTER_EVERY_S):
        try:
            master = rosgraph.Master(node).getPid()
        except (OSError, HTTPException, rosgraph.MasterException):  # away, for now
            continue
        if master != known_to:
            for name, kind in ours.get_publications():
                tell(name, kind, Registration.PUB)
            for name, kind in ours.get_subscriptions():
                tell(name, kind, Registration.SUB)
        known_to = master


def patient_server_class() -> Any:
    """Return actionlib's server, less two of its habits.

    It takes a cancel to be for all older goals to come, too: so a client whose clock is slow is
    never served once anybody has cancelled anything. And a goal that is sent again within five
    seconds of its answer is never answered.
    """
    import actionlib
    import rospy
    from actionlib_msgs.msg import GoalStatus

    ended = (GoalStatus.SUCCEEDED, GoalStatus.ABORTED)

    class PatientActionServer(actionlib.ActionServer):  # type: ignore[misc]
        def internal_cancel_callback(self, goal_id: Any) -> None:
            with self.lock:
                super().internal_cancel_callback(goal_id)
                self.last_cancel = rospy.Time()

        def internal_goal_callback(self, goal: Any) -> None:
            """Forget a goal of that id which has ended: the log has the command and its result."""
            with self.lock:
                self.status_list[:] = [
                    each
                    for each in self.status_list
                    if each.status.goal_id.id != goal.goal_id.id or each.status.status not in ended
                ]
                super().internal_goal_callback(goal)

    return PatientActionServer


def caller_of(handle: Any) -> str:
    """Return the node that sent a goal: its connection says it."""
    header = getattr(handle.status_tracker.goal, "_connection_header", None) or {}
    return str(header.get("callerid", ""))


@contextmanager
def given_id(client: Any, goal_id: bytes | None) -> Iterator[None]:
    """Let a client's goal have that id; actionlib itself draws one for each."""
    if goal_id is None:
        yield
        return
    import rospy
    from actionlib_msgs.msg import GoalID

    given = GoalID(id=goal_id.hex(), stamp=rospy.get_rostime())
    client.manager._generate_id = lambda: given  # noqa: SLF001
    try:
        yield
    finally:
        del client.manager._generate_id  # noqa: SLF001  its class has one


LISTENS_WITHIN_S = 5.0
"""How long a link may stand at one end only: a moment, and longer where all cores are busy."""
LOOK_EVERY_S = 0.001


def make_each_link_once() -> None:
    """Keep rospy from making a link to a publisher twice, where two of a topic come together.

    It looks whether there is one, and takes its time before it makes it; the second takes the
    first one's place, and what came in by the first is lost: a goal, and its client waits in vain.
    """
    from rospy.impl.registration import RegManager

    connect, one_at_a_time = RegManager._connect_topic_thread, _OneAtATime()  # noqa: SLF001

    def connect_once(manager: Any, topic: str, publisher: str) -> None:
        with one_at_a_time(topic, publisher):
            connect(manager, topic, publisher)

    RegManager._connect_topic_thread = connect_once  # noqa: SLF001


class _OneAtATime:
    """A lock for each of many things, which takes no room while nobody has it."""

    def __init__(self) -> None:
        self._held: set[Hashable] = set()
        self._changed = threading.Condition()

    @contextmanager
    def __call__(self, *what: Hashable) -> Iterator[None]:
        with self._changed:
            self._changed.wait_for(lambda: what not in self._held)
            self._held.add(what)
        try:
            yield
        finally:
            with self._changed:
                self._held.remove(what)
                self._changed.notify_all()


def wait_for_listener(server: Any, caller: str) -> None:
    """Wait until results can be sent to the caller, but not indefinitely.

    rospy reports to a subscriber that it is connected before it begins to send to it
    (TCPROSHandler: write_header, then add_connection). A client that has just come would wait for a
    result in vain.
    """
    results = server.result_pub.impl
    if not results.has_connection(caller) and _is_subscribed(
        caller, server.result_pub.resolved_name
    ):
        _wait_until(lambda: results.has_connection(caller), LISTENS_WITHIN_S)


def _is_subscribed(caller: str, topic: str) -> bool:
    """Return whether a node subscribes to a topic; True as well where the master does not answer.

    `rostopic pub` sends goals, and asks for no result.
    """
    import rosgraph
    import rospy

    with suppress(OSError, HTTPException, Error):
        with ServerProxy(rosgraph.get_master_uri(), transport=_HastyTransport()) as master:
            answer: Any = master.getSystemState(rospy.get_name())
        _, _, (_, subscribed, _) = answer
        return any(name == topic and caller in nodes for name, nodes in subscribed)
    return True


def wait_for_server(client: Any, timeout_s: float) -> bool:
    """Return whether a client's server is connected within that time, by the wall's clock.

    actionlib's own waiting goes by ROS's time: where a simulation stands still, for ever.
    """
    return _wait_until(lambda: _is_connected(client), timeout_s)


def _is_connected(client: Any) -> bool:
    """Return the state that `ActionClient.wait_for_server` checks."""
    if client.last_status_msg is None:
        return False
    server = _server_of(client)
    to_it, from_it = (client.pub_goal, client.pub_cancel), (client.result_sub, client.feedback_sub)
    return all(each.impl.has_connection(server) for each in to_it) and all(
        any(link.callerid_pub == server for link in each.impl.connections) for each in from_it
    )


def _server_of(client: Any) -> str:
    """Return the node that sent a client its server's status."""
    return str(client.last_status_msg._connection_header["callerid"])  # noqa: SLF001


def wait_to_be_sent_results(client: Any) -> None:
    """Return once a client's server, whosever it is, says that it sends results to this node.

    As far as it answers: its goal is sent after a while in any case.
    """
    import rosgraph
    import rospy

    us, topic = rospy.get_name(), client.result_sub.resolved_name
    server = _server_of(client)

    def is_sent() -> bool:
        links: Any = node.getBusInfo(us)
        return any(link[1:3] == [us, "o"] and link[4] == topic for link in links[2] or ())

    with suppress(OSError, HTTPException, rosgraph.MasterException, Error):
        uri = rosgraph.Master(us).lookupNode(server)
        with ServerProxy(uri, transport=_HastyTransport()) as node:
            _wait_until(is_sent, LISTENS_WITHIN_S)


class _HastyTransport(Transport):
    """Does not wait for ever for a node that hangs."""

    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = LISTENS_WITHIN_S
        return connection


def _wait_until(is_so: Callable[[], bool], timeout_s: float) -> bool:
    deadline = time.monotonic() + timeout_s
    while not (found := is_so()) and time.monotonic() < deadline:
        time.sleep(LOOK_EVERY_S)
    return found
