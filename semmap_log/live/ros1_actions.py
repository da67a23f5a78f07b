"""What actionlib lacks: patience with clocks and links, answers to goals sent again, given ids."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPConnection, HTTPException
from typing import Any
from xmlrpc.client import Error, ServerProxy, Transport

LISTENS_WITHIN_S = 5.0
"""How long a link may stand at one end only: a moment, and longer where all cores are busy."""
LOOK_EVERY_S = 0.001


def patient_server_class() -> Any:
    """Return actionlib's server, less two of its habits.

    It takes a cancel to be for all older goals to come, too: so a client whose clock is behind is
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
            """Forget a goal of that id which has ended: the log knows what was asked and done."""
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


def wait_for_listener(server: Any, caller: str) -> None:
    """Return once results are sent to a caller that asked for them, though not for ever.

    rospy tells a subscriber that it is connected before it begins to send to it (TCPROSHandler:
    write_header, then add_connection). A client that has just come would wait for a result in vain.
    """
    results = server.result_pub.impl
    if not results.has_connection(caller) and _has_asked(caller, server.result_pub.resolved_name):
        _wait_until(lambda: results.has_connection(caller), LISTENS_WITHIN_S)


def _has_asked(caller: str, topic: str) -> bool:
    """Tell whether a node subscribes to a topic; True as well where the master does not answer.

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
    """Tell whether a client's server is connected within that time, by the wall's clock.

    actionlib's own waiting goes by ROS's time: where a simulation stands still, for ever.
    """
    return _wait_until(lambda: _is_connected(client), timeout_s)


def _is_connected(client: Any) -> bool:
    """Tell what `ActionClient.wait_for_server` looks at."""
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
