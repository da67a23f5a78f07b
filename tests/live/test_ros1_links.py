"""Links of ROS 1 that stand only at one end: rospy says so before it sends, and drops what comes.

A subscriber is told that it is connected before the publisher sends to it. Between the two lies a
moment, which is long on a busy machine; here it is 0.7 s. This machine may be busy, too: so both
ends wait for it as long as it takes.
"""

from __future__ import annotations

from pathlib import Path

import semmap_log as sl
from tests.live.plain_server import SERVER as PLAIN
from tests.live.ros_world import RosWorld
from tests.live.stock_client import StockClient

PATIENT = """
from semmap_log.live import ros1_actions

ros1_actions.LISTENS_WITHIN_S = 1000
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

SERVER = "/lta_semantic_map_server"

SEMMAP_LOG = """
from semmap_log.cli import main
main()
"""


def test_a_client_that_has_just_come_gets_its_result(ros1: RosWorld, tmp_path: Path) -> None:
    """
    A stock client of our server, whose goal is done before its results are sent to it.
    """
    path = tmp_path / "log"
    sl.create(path, tz="UTC").close()

    with (
        ros1.code(PATIENT + LATE_LINKS + SEMMAP_LOG, "serve", path, "--ros1"),
        StockClient(ros1, "client") as client,
    ):
        refused = client.goal("RemoveDoor", door_id=77)

    assert "ABORTED" == refused["status"]
    assert "77" in refused["text"]


def test_who_asks_for_no_result_is_not_waited_for(ros1: RosWorld, tmp_path: Path) -> None:
    """
    A goal of `rostopic pub`, whose result is shown by another tool.
    """
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
    """
    Somebody's server, which knows nothing of late links.
    """
    with ros1.code(PATIENT + LATE_LINKS + PLAIN[1]) as server:
        server.wait_for("ready")
        called = ros1.semmap("call", "remove", 77, "--ros1", "--timeout", 60,
                              "_remove_door:=plain/RemoveDoor")  # fmt: skip

        assert 1 == called.wait()
    assert "removal of door 77: ABORTED: no such door" in called.errors
