"""ROS 1's topics as bytes: publishers, what is not out yet, and a master that is started anew."""

from __future__ import annotations

import threading
import time
from contextlib import suppress
from http.client import HTTPException
from types import ModuleType
from typing import Any

from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import ros1_definition, short_name

QUEUED = 1000
"""Messages of a topic that wait for a slow subscriber; beyond, rospy drops the oldest."""

MASTER_EVERY_S = 1.0
"""How soon a master that was started anew hears of us."""


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
    """Tell whether anything of this process waits to be sent: messages, and results of actions."""
    from rospy.topics import get_topic_manager

    return any(_is_sending(topic) for topic in list(get_topic_manager().pubs.values()))


def _is_sending(topic: Any) -> bool:
    """Tell whether messages of a topic wait to be sent, or are just being sent."""
    return any(_is_busy(connection) for connection in topic.connections)


def _is_busy(connection: Any) -> bool:
    """Tell whether the thread of a rospy QueuedConnection has anything to do.

    It takes all that is queued, then sends it: an empty queue alone does not say that it is out.
    """
    if connection.done or not hasattr(connection, "_queue"):
        return False
    with connection._lock:  # noqa: SLF001  rospy has no other way to know
        is_waiting = bool(connection._cond_data_available._waiters)  # noqa: SLF001
        return bool(connection._queue) or not is_waiting  # noqa: SLF001


def stay_known(node: str, known_to: int, ended: threading.Event) -> None:
    """Make this node known to each master that is started anew; rospy itself never does.

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
