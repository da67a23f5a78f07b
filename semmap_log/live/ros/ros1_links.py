"""Links between nodes of ROS 1: rospy tells of them before they stand, and may make one twice."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPConnection, HTTPException
from typing import Any
from xmlrpc.client import Error, ServerProxy, Transport

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
