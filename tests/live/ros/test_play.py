"""A log as it is heard in a real ROS: from our player, and from ROS's own by way of a bag."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.interop.exporting.log_files import record_bag
from tests.interop.exporting.lively import lively_log
from tests.live.ros.door_map_listener import Heard, door_maps, heard, listen
from tests.live.ros.ros_world import RosWorld
from tests.live.ros.running import Running, wait_until
from tests.views.rerun.some_logs import SECOND, START

PLAYER = "/usr/lib/rosbag/play"
"""What `rosbag play` starts."""
RATE = 10_000
"""Five hours pass in two seconds; messages a minute apart then come each 6 ms."""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    """Late and retracted events, moves and removals: five hours of doors on two levels."""
    return lively_log(tmp_path_factory.mktemp("played") / "log", seed=1)


@pytest.fixture(scope="module")
def expected(log: sl.DoorLog) -> list[str]:
    """What is to be heard of it."""
    found = [each.doors for each in door_maps(log)]
    assert len(found) > 50
    return found


def test_a_subscriber_hears_each_door_map_once(
    every_ros: RosWorld, log: sl.DoorLog, expected: list[str]
) -> None:
    """As replays give them, in their order; as fast as it goes, nothing is lost either."""
    with listen(every_ros) as listener:
        every_ros.semmap("play", log.path, every_ros.option, "--immediate", "--wait").finish()

        wait_until(lambda: len(heard(listener)) >= len(expected), "all door maps")
        assert expected == [each.doors for each in heard(listener)]


def test_rosbag_play_drives_the_same_subscriber(
    ros1: RosWorld, log: sl.DoorLog, expected: list[str], tmp_path: Path
) -> None:
    """ROS 1's own player takes our bag, and what is heard of it is the same."""
    record_bag(log, tmp_path / "log.bag")
    topic = "/lta_semantic_map_door_db"

    with (
        listen(ros1) as listener,
        # kept alive: it ends without looking whether its last message is out
        ros1.run(PLAYER, "--quiet", "--rate", RATE, "--wait-for-subscribers", "--keep-alive",
                 tmp_path / "log.bag", "--topics", topic),
    ):  # fmt: skip
        wait_until(lambda: len(heard(listener)) >= len(expected), "all door maps")
        assert expected == [each.doors for each in heard(listener)]


def test_a_late_subscriber_has_the_last_door_map(
    ros: RosWorld, log: sl.DoorLog, expected: list[str]
) -> None:
    """It is latched, and stays so behind the end with --keep-alive; Ctrl-C ends that well."""
    with ros.semmap("play", log.path, ros.option, "--immediate", "--keep-alive") as player:
        player.wait_for("plays /map")
        with listen(ros) as first:
            wait_until(lambda: [each.doors for each in heard(first)][-1:] == expected[-1:], "last")
        with listen(ros) as late:
            wait_until(lambda: heard(late), "a door map")

            assert expected[-1:] == [each.doors for each in heard(late)]
        assert 0 == player.stop(signal.SIGINT)


def test_with_a_clock_subscribers_live_in_the_logs_time(ros: RosWorld, log: sl.DoorLog) -> None:
    """Who has `use_sim_time` hears each door map when it became true, from --since to --until."""
    rate, since_ns, until_ns = 2000, START + 6000 * SECOND, START + 12_000 * SECOND
    expected = door_maps(log, since_ns, until_ns)
    assert len(expected) > 20

    with (
        _listen_in_sim_time(ros) as listener,
        ros.semmap("play", log.path, ros.option, "--rate", rate, "--wait", "--clock", "--loop",
                   "--since", f"@{since_ns // SECOND}",
                   "--until", f"@{until_ns // SECOND}") as player,
    ):  # fmt: skip
        wait_until(lambda: _late(expected[1:], heard(listener), rate * SECOND // 2) == [],
                   "each door map in time")  # fmt: skip
        assert 0 == player.stop()
        found = heard(listener)
    assert {each.doors for each in expected} == {each.doors for each in found}
    began = next(i for i, came in enumerate(found) if came.now_ns)  # 0: no word of /clock yet
    assert all(since_ns <= came.now_ns <= until_ns for came in found[began:])


def _late(expected: list[Heard], found: list[Heard], within_ns: int) -> list[Heard]:
    """Return what was never heard near its time."""
    return [
        told
        for told in expected
        if not any(
            came.doors == told.doors and abs(came.now_ns - told.now_ns) < within_ns
            for came in found
        )
    ]


def _listen_in_sim_time(ros: RosWorld) -> Running:
    """Start a subscriber that takes its time from /clock."""
    if ros.version == 2:
        return listen(ros, "--ros-args", "-p", "use_sim_time:=true")
    ros.tool("rosparam", "set", "/use_sim_time", "true").finish()
    try:
        return listen(ros)
    finally:
        ros.tool("rosparam", "delete", "/use_sim_time").finish()


@pytest.mark.slow
def test_a_loop_begins_with_the_state_of_its_beginning(
    ros: RosWorld, log: sl.DoorLog, expected: list[str]
) -> None:
    """Each round is told as the first, here in a namespace; SIGTERM ends it well."""
    topic = "/lta_semantic_map_door_db"
    heard_as, played_in = [f"{topic}:=/old{topic}"], ["__ns:=/old"]
    if ros.version == 2:
        heard_as, played_in = (["--ros-args", "-r", each] for (each,) in (heard_as, played_in))

    with listen(ros, *heard_as) as listener:
        arguments = ("--immediate", "--wait", "--loop", *played_in)
        with ros.semmap("play", log.path, ros.option, *arguments) as player:
            wait_until(lambda: len(heard(listener)) > 2 * len(expected), "the third round")

            assert 0 == player.stop(signal.SIGTERM)
        found = [each.doors for each in heard(listener)]
    assert 2 * expected == found[: 2 * len(expected)]
