"""The player on a node without a network: what is published, in which order, and when."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.errors import RosError
from semmap_log.interop.exporting.stream import LogStream, log_stream
from semmap_log.live.ros import player
from semmap_log.live.ros.player import PlayOptions, play
from tests.live.ros.collecting_node import CollectingNode
from tests.live.ros.running import DEADLINE_S
from tests.views.rerun.some_logs import small_log

AT_ONCE = PlayOptions(rate=math.inf)
IN_A_TENTH = PlayOptions(rate=36_000.0)
"""The hour of the log in a tenth of a second."""


def at_last() -> Callable[[], bool]:
    """Return what says yes in the end: of what plays for ever, a test shall fail."""
    end = time.monotonic() + DEADLINE_S
    return lambda: time.monotonic() > end


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    return small_log(tmp_path_factory.mktemp("player") / "log")


@pytest.fixture(scope="module")
def stream(log: sl.DoorLog) -> LogStream:
    return log_stream(log, ros_version=2)


def _names(stream: LogStream) -> list[str]:
    """Return the relative topic of each message."""
    return [message.topic.name.removeprefix("/") for message in stream.messages()]


def _clock_ns(message: Any) -> int:
    return int(message.clock.sec) * 10**9 + int(message.clock.nanosec)


def test_all_messages_are_published_once_in_their_order(stream: LogStream) -> None:
    """Under names that follow the node's namespace."""
    node = CollectingNode()

    count = play(node, stream, AT_ONCE, stop=at_last())

    assert _names(stream) == node.order
    assert len(node.order) == count


def test_no_message_comes_before_it_is_due(stream: LogStream) -> None:
    """By the log's time from its beginning, at the rate that was asked for."""
    node = CollectingNode()
    begin_ns, _ = stream.span_ns or (0, 0)
    due_s = [(message.at_ns - begin_ns) / 1e9 / IN_A_TENTH.rate for message in stream.messages()]

    before_s = time.monotonic()
    play(node, stream, IN_A_TENTH, stop=at_last())

    late_s = [sent - before_s - due for sent, due in zip(node.sent_s, due_s, strict=True)]
    assert min(late_s) >= 0
    assert max(due_s) > 0.05


def test_each_round_of_a_loop_takes_its_time(stream: LogStream) -> None:
    """The second as the first, with the same messages from the beginning."""
    node = CollectingNode()
    names = _names(stream)
    options = PlayOptions(rate=IN_A_TENTH.rate, loop=True)

    play(node, stream, options, stop=lambda: len(node.order) >= 2 * len(names))

    begin_ns, end_ns = stream.span_ns or (0, 0)
    took_s = node.sent_s[2 * len(names) - 1] - node.sent_s[len(names) - 1]
    assert names * 2 == node.order[: 2 * len(names)]
    assert took_s >= (end_ns - begin_ns) / 1e9 / options.rate


def test_a_latched_message_waits_for_the_one_before(stream: LogStream) -> None:
    """ROS 2 keeps one of them: it would take the place of one that nobody has yet."""
    node = CollectingNode()
    sent = [message.topic for message in stream.messages()]
    latched = [topic.name.removeprefix("/") for topic in sent if topic.is_latched]

    play(node, stream, AT_ONCE, stop=at_last())

    expected = [name for i, name in enumerate(latched) if name in latched[:i]]
    assert expected
    assert expected == node.waited


def test_without_a_rate_who_is_slow_is_waited_for(stream: LogStream) -> None:
    """Nothing is due at a time, so nobody has to lose a message to a second in which it hung."""
    at_once, paced = CollectingNode(), CollectingNode()

    play(at_once, stream, AT_ONCE, stop=at_last())
    play(paced, stream, IN_A_TENTH, stop=at_last())

    assert ({10.0}, {1.0}) == (at_once.patience_s, paced.patience_s)


def test_others_wait_once_many_are_on_their_way(
    stream: LogStream, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before a node's queue is full: nothing is dropped without waiting."""
    monkeypatch.setattr(player, "MOST_WAITING", 3)
    node = CollectingNode()
    poses = _names(stream).count("semmap/robot_pose")

    play(node, stream, AT_ONCE, stop=at_last())

    assert poses > 3
    assert (poses - 1) // 3 == node.waited.count("semmap/robot_pose")


def test_no_stamp_lies_ahead_of_the_clock(stream: LogStream) -> None:
    """The clock has shown a message's time when it comes."""
    node = CollectingNode()

    play(node, stream, PlayOptions(rate=math.inf, clock_hz=40.0), stop=at_last())

    shown = [_clock_ns(message) for message in node.messages["/clock"]]
    clocks = 0
    times = iter(message.at_ns for message in stream.messages())
    for name in node.order:
        if name == "/clock":
            clocks += 1
        else:
            assert shown[clocks - 1] == next(times)
    assert sorted(set(shown)) == shown


def test_between_messages_the_clock_goes_on(stream: LogStream) -> None:
    """As often as was asked for, by the wall's clock."""
    node = CollectingNode()
    ends = at_last()

    play(
        node,
        stream,
        PlayOptions(rate=1.0, clock_hz=1000.0),
        stop=lambda: ends() or len(node.messages["/clock"]) > 20,
    )

    shown = [_clock_ns(message) for message in node.messages["/clock"]]
    moments = {message.at_ns for message in stream.messages()}
    assert len(set(shown) - moments) > 10
    assert sorted(set(shown)) == shown


def test_who_is_stopped_says_no_more(stream: LogStream) -> None:
    """What was not due yet is not published in a hurry at the end."""
    node = CollectingNode()

    count = play(node, stream, PlayOptions(rate=1.0), stop=lambda: bool(node.order))

    assert 0 < count < len(_names(stream))
    assert len(node.order) == count


def test_playing_begins_when_somebody_listens(stream: LogStream) -> None:
    """Nothing is published before."""
    node = CollectingNode(listeners=0)
    asked = 0
    unheard: list[int] = []
    ends = at_last()

    def stop() -> bool:
        nonlocal asked
        asked += 1
        if asked == 100:
            unheard.append(len(node.order))
            node.listeners = 1
        return ends()

    count = play(node, stream, PlayOptions(rate=math.inf, wait=True), stop=stop)

    assert [0] == unheard
    assert len(_names(stream)) == count


def test_who_is_stopped_while_nobody_listens_has_published_nothing(stream: LogStream) -> None:
    """Ctrl-C ends the waiting."""
    asked = iter(range(20))

    count = play(
        CollectingNode(listeners=0),
        stream,
        PlayOptions(rate=math.inf, wait=True),
        stop=lambda: next(asked, None) is None,
    )

    assert 0 == count


def test_who_is_to_stay_stays_behind_the_end(stream: LogStream) -> None:
    """Until stopped: a subscriber that comes later has what is latched."""
    node = CollectingNode()
    count = len(_names(stream))
    asked_behind_the_end = 0

    def stop() -> bool:
        nonlocal asked_behind_the_end
        asked_behind_the_end += len(node.order) == count
        return asked_behind_the_end > 20

    play(node, stream, PlayOptions(rate=math.inf, keep_alive=True), stop=stop)

    assert asked_behind_the_end > 20


def test_what_fails_while_playing_is_raised(stream: LogStream) -> None:
    """Not kept in a thread that nobody asks."""

    class Broken(CollectingNode):
        def take(self, topic: Any, data: bytes) -> None:
            raise RosError("the network is gone")

    with pytest.raises(RosError, match="the network is gone"):
        play(Broken(), stream, AT_ONCE, stop=at_last())


def test_an_empty_stream_publishes_nothing(tmp_path: Path) -> None:
    """And comes to its end."""
    sl.create(tmp_path / "log", tz="UTC").close()
    empty = log_stream(sl.read(tmp_path / "log"), ros_version=2)

    assert 0 == play(CollectingNode(), empty, AT_ONCE, stop=at_last())


def test_a_single_moment_in_a_loop_does_not_flood(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It lasts no time, so it comes once a second."""
    assert 1.0 == player.LOOP_S
    monkeypatch.setattr(player, "LOOP_S", 0.25)
    node = CollectingNode()
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(x=1, y=2, theta=0, width=0.9)
        moment = log_stream(log, ros_version=2)

        play(node, moment, PlayOptions(loop=True), stop=lambda: len(node.sent_s) > 2)

    assert all(later - sent >= 0.25 for sent, later in pairwise(node.sent_s))
