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

LATE_LINKS = """
import threading
from rospy import topics
from semmap_log.live import ros1_actions

ros1_actions.LISTENS_WITHIN_S = 100

link = topics._PublisherImpl.add_connection

def late_link(publisher, transport):
    late = publisher.resolved_name.endswith("/result")
    threading.Timer(0.7 if late else 0, link, [publisher, transport]).start()

topics._PublisherImpl.add_connection = late_link
"""

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
        ros1.code(LATE_LINKS + SEMMAP_LOG, "serve", path, "--ros1"),
        StockClient(ros1, "client") as client,
    ):
        refused = client.goal("RemoveDoor", door_id=77)

    assert "ABORTED" == refused["status"]
    assert "77" in refused["text"]


def test_call_sends_its_goal_once_results_are_sent_to_it(ros1: RosWorld) -> None:
    """
    Somebody's server, which knows nothing of late links.
    """
    with ros1.code(LATE_LINKS + PLAIN[1]) as server:
        server.wait_for("ready")
        called = ros1.semmap("call", "remove", 77, "--ros1", "--timeout", 60,
                              "_remove_door:=plain/RemoveDoor")  # fmt: skip

        assert 1 == called.wait()
    assert "removal of door 77: ABORTED: no such door" in called.errors
