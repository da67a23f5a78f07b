"""Links of ROS 1 that stand only at one end, and those that rospy would make twice.

A subscriber is told that it is connected before the publisher sends to it. Between the two lies a
moment, which is long on a busy machine; here it is 0.7 s. This machine may be busy, too: so both
ends wait for it as long as it takes.
"""

from __future__ import annotations

import re
from pathlib import Path

import semmap_log as sl
from tests.live.ros.plain_server import SERVER as PLAIN
from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import Running
from tests.live.ros.stock_client import StockClient

PATIENT = """
from semmap_log.live.ros import ros1_topics

ros1_topics.LISTENS_WITHIN_S = 1000
"""

LATE_LINKS = """
import threading
from rospy import topics

link = topics._PublisherImpl.add_connection

def late_link(publisher, transport):
    late = publisher.resolved_name.endswith("/result")
    threading.Timer(0.7 if late else 0, link, [publisher, transport]).start()

topics._PublisherImpl.add_connection = late_link
"""

SLOW_LINKS = """
import os, time
from rospy import topics
from rospy.impl.tcpros_pubsub import TCPROSHandler

make, add = TCPROSHandler.create_transport, topics._SubscriberImpl.add_connection

def make_slowly(*asked):
    time.sleep(1)
    return make(*asked)

def add_aloud(subscriber, link):
    line = f"link {subscriber.resolved_name} {link.endpoint_id}\\n"
    os.write(2, line.encode())  # print writes word by word: two threads' words would mix
    return add(subscriber, link)

TCPROSHandler.create_transport = make_slowly
topics._SubscriberImpl.add_connection = add_aloud
"""

SERVER = "/lta_semantic_map_server"

SEMMAP_LOG = """
from semmap_log.cli import main
main()
"""


def test_a_client_that_has_just_come_gets_its_result(ros1: RosWorld, tmp_path: Path) -> None:
    """A stock client of our server, whose goal is done before its results are sent to it."""
    path = tmp_path / "log"
    sl.create(path, tz="UTC").close()

    with (
        ros1.code(PATIENT + LATE_LINKS + SEMMAP_LOG, "serve", path, "--ros1"),
        StockClient(ros1, "client") as client,
    ):
        refused = client.goal("RemoveDoor", door_id=77)

    assert "ABORTED" == refused["status"]
    assert "77" in refused["text"]


def test_clients_that_come_together_are_linked_once(ros1: RosWorld, tmp_path: Path) -> None:
    """Goal and cancel, from each; a second link would end the first, and what came in by it."""
    path = tmp_path / "log"
    sl.create(path, tz="UTC").close()
    goal = {"name": "/lta_semantic_map/remove_door", "action": "RemoveDoor",
            "values": {"door_id": 77}}  # fmt: skip

    with (
        ros1.code(SLOW_LINKS + SEMMAP_LOG, "serve", path, "--ros1") as server,
        StockClient(ros1, "one") as one,
        StockClient(ros1, "other") as other,
    ):
        server.wait_for(" serves ")
        for client in (one, other):
            client.send("goal", **goal)
        statuses = [client.answer()["status"] for client in (one, other)]
        ros1.wait_until(
            lambda: len(_links(server)) >= 4, lambda: f"two links of each client: {server}"
        )

    links = _links(server)
    assert ["ABORTED"] * 2 == statuses
    assert 4 == len(set(links)) == len(links), links


def _links(server: Running) -> list[str]:
    """Return what the server said of links so far; it may lag behind its answers."""
    return re.findall("^link .*$", server.errors, re.MULTILINE)


def test_who_asks_for_no_result_is_not_waited_for(ros1: RosWorld, tmp_path: Path) -> None:
    """A goal of `rostopic pub`, whose result is shown by another tool."""
    path, action = tmp_path / "log", "/lta_semantic_map/remove_door"
    sl.create(path, tz="UTC").close()
    goal = ["lta_semantic_map/RemoveDoorActionGoal", "{goal_id: {id: mine}, goal: {door_id: 77}}"]

    with (
        ros1.code(PATIENT + SEMMAP_LOG, "serve", path, "--ros1") as server,
        ros1.tool("rostopic", "echo", "-n1", f"{action}/result", "__name:=echo") as echo,
    ):
        server.wait_for(" serves ")
        ros1.wait_until(
            lambda: "to: /echo" in ros1.tool("rosnode", "info", SERVER).finish(), "an open ear"
        )
        with ros1.tool("rostopic", "pub", f"{action}/goal", *goal):
            assert "door 77 is not in the map" in echo.finish()


def test_call_sends_its_goal_once_results_are_sent_to_it(ros1: RosWorld) -> None:
    """Somebody's server, which knows nothing of late links."""
    with ros1.code(PATIENT + LATE_LINKS + PLAIN[1]) as server:
        server.wait_for("ready")
        called = ros1.semmap("call", "remove", 77, "--ros1", "--timeout", 60,
                              "_remove_door:=plain/RemoveDoor")  # fmt: skip

        assert 1 == called.wait()
    assert "removal of door 77: ABORTED: no such door" in called.errors
