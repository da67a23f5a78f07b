"""`record --clicked-points`: doors by hand, on a real ROS and in memory."""

from __future__ import annotations

import time
from pathlib import Path

import semmap_log as sl
from semmap_log.core.model.events import DoorAdded
from semmap_log.interop.topics.topic_rules import CLICKED, WELL_KNOWN
from semmap_log.live.ros.ros_recorder import LogSink, RosRecorder
from tests.interop.formats.bags.bags_of_others import Said
from tests.interop.topics.robots import START, S
from tests.interop.topics.test_clicked_doors import _click
from tests.live.ros.memory_node import MemoryNode
from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import wait_until
from tests.live.ros.test_record_ros import _talking


def test_each_door_is_a_commit_and_a_line_tells_it(tmp_path: Path) -> None:
    """The first click is answered, too, so that who clicks knows what is next."""
    told: list[str] = []

    def during(node: MemoryNode) -> None:
        for x in (0.0, 0.9, 3.0, 4.0):
            node.say(Said(CLICKED, *_click(x, 0, at_s=x), START + round(x * S)))

    with sl.create(tmp_path / "office", tz="UTC", compact=False) as log:
        node = MemoryNode(during, {})
        mapping = WELL_KNOWN.with_clicks()
        RosRecorder(node, mapping, LogSink(log), told.append).run()  # type: ignore[arg-type]
        commits = list(log.commits())

    assert [2, 2] == [commit.count for commit in commits]
    assert {CLICKED} == {commit.note.source for commit in commits}
    lines = [line for line in told if "now click" in line or "wide" in line]
    assert ["hinge", "door 1", "hinge", "door 2"] == [
        next(word for word in ("hinge", "door 1", "door 2") if word in line) for line in lines
    ]


def test_a_door_is_clicked_on_a_robot(ros: RosWorld, tmp_path: Path) -> None:
    """By a publisher of /clicked_point that is none of ours to the recorder."""
    office = tmp_path / "office"
    sl.create(office, tz="UTC").close()

    with (
        ros.semmap("record", office, ros.option, "--clicked-points") as recorder,
        _talking(ros) as talker,
    ):
        recorder.wait_for(f"{CLICKED}: recording")
        for x in (2.0, 2.9):
            since_s = (time.time_ns() - START) / S
            talker.say(CLICKED, _click(x, 1.0, at_s=since_s, version=ros.version))
            talker.wait()
        recorder.wait_for("door 1 from 2.00, 1.00 to 2.90, 1.00")
        assert 0 == recorder.stop()

    wait_until(lambda: len(sl.read(office).replay().doors) == 1, "a door")
    batches = sl.read(office).batches(kinds=[DoorAdded])
    (added,) = [each.event for batch in batches for each in batch]
    assert isinstance(added, DoorAdded)
    assert (added.x, added.y) == (2.0, 1.0)
