"""Publishes a log's stream as it happened: what `rosbag play` does of a bag, without the bag."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from threading import Event

from semmap_log.interop.exporting.stream import LogStream, StreamMessage
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import CLOCK, Messages, encoded
from semmap_log.live.ros.ros_node import Publisher, RosNode

CLOCK_TOPIC = BagTopic("/clock", CLOCK, is_latched=False)
CLOCK_HZ = 40.0
"""By the wall's clock; as `ros2 bag play --clock` has it."""

LONGEST_WAIT_S = 3600.0

LOOP_S = 1.0
"""How often a single moment comes that is played in a loop: it lasts no time at all."""

MOST_WAITING = 500
"""Messages of a topic that may be on their way, of the 1000 that nodes keep. Of a latched one in
ROS 2 only the last is kept: it would replace one that was not taken yet."""
TAKEN_WITHIN_S = 1.0
"""How long they may take; who hangs does not hold up the others for longer."""
ALL_TAKEN_WITHIN_S = 10.0
"""The same where nothing is due at a time: who is only slow loses nothing."""

LOOK_S = 0.05
"""How often it is looked whether somebody listens."""

Told = Callable[[int, int], None]
"""Takes the log's time of now, and that of the next message."""


@dataclass(frozen=True, slots=True)
class PlayOptions:
    """How it is played."""

    rate: float = 1.0
    """The log's seconds in one of the wall's; infinite: without waiting."""
    loop: bool = False
    """Begin again at the end: with the state of the beginning."""
    clock_hz: float | None = None
    """Publish the log's time on /clock, so often a second and with each message; None: do not."""
    longest_gap_s: float | None = None
    """Stretches of the log without messages that are longer are left out."""
    wait: bool = False
    """Begin when somebody subscribes to one of the topics."""
    keep_alive: bool = False
    """Keep running after the end, so that later subscribers get what is latched."""


def play(
    node: RosNode,
    stream: LogStream,
    options: PlayOptions = PlayOptions(),
    *,
    stop: Callable[[], bool],
    told: Told | None = None,
) -> int:
    """Publish the messages, each when it is due; return how many there were.

    Headers have the stamps that they have in the log: for subscribers with `use_sim_time`.

    Args:
        node: Where from; it runs meanwhile.
        stream: What.
        options: How.
        stop: Called some twenty times a second.
        told: Called some twenty times a second.

    Raises:
        RosError: The type of a topic is not installed.
        OutputError: A time cannot be a ROS stamp.
    """
    player = _Player(node, stream, options)

    def tell() -> None:
        if told is not None and player.pace is not None:
            told(player.pace.log_ns(), player.pace.next_ns)

    with ThreadPoolExecutor(1, thread_name_prefix="player") as threads:
        playing = threads.submit(player.run)
        try:
            node.run(lambda: playing.done() or stop(), tick=tell)
        finally:
            player.stopped.set()
    playing.result()
    return player.count


@dataclass(slots=True)
class _Topic:
    """A topic that is not sent to faster than its subscribers take it."""

    publisher: Publisher
    most_waiting: int
    """So many messages may be on their way."""
    taken_within_s: float
    """How long they may take."""
    waiting: int = 0

    def publish(self, data: bytes) -> None:
        if self.waiting >= self.most_waiting:
            self.publisher.wait(self.taken_within_s)
            self.waiting = 0
        self.publisher.publish(data)
        self.waiting += 1


class _Player:
    def __init__(self, node: RosNode, stream: LogStream, options: PlayOptions) -> None:
        self.stopped = Event()
        self.count = 0
        self.pace: Pace | None = None
        self._stream = stream
        self._options = options
        patience_s = ALL_TAKEN_WITHIN_S if math.isinf(options.rate) else TAKEN_WITHIN_S
        self._topics = {
            topic: _Topic(
                node.publisher(in_namespace(topic)),
                1 if topic.is_latched else MOST_WAITING,
                patience_s,
            )
            for topic in stream.topics
        }
        self._clock = None if options.clock_hz is None else _Clock(node)

    def run(self) -> None:
        """Play until the end, or until stopped."""
        span_ns = self._stream.span_ns
        if self._options.wait:
            self._wait_for_subscribers()
        while span_ns is not None and not self.stopped.is_set():
            self._play_once(span_ns[0])
            if not self._options.loop:
                break
            if span_ns[0] == span_ns[1]:
                self.stopped.wait(LOOP_S)
        if self._options.keep_alive:
            self.stopped.wait()

    def _play_once(self, begin_ns: int) -> None:
        gap_s = self._options.longest_gap_s
        gap_ns = None if gap_s is None else round(gap_s * 1e9)
        self.pace = pace = Pace(begin_ns, self._options.rate, longest_gap_ns=gap_ns)
        for message in self._stream.messages():
            self._wait(pace, message.at_ns)
            if self.stopped.is_set():
                return
            self._publish(message)

    def _publish(self, message: StreamMessage) -> None:
        if self._clock is not None:
            self._clock.show(message.at_ns)  # no stamp lies ahead of the clock
        self._topics[message.topic].publish(message.data)
        self.count += 1

    def _wait(self, pace: Pace, at_ns: int) -> None:
        """Return when a message is due, or when stopped; the clock goes on meanwhile."""
        due_ns = pace.due_ns(at_ns)
        every_s = (
            LONGEST_WAIT_S if self._clock is None else 1 / (self._options.clock_hz or CLOCK_HZ)
        )
        while (left_ns := due_ns - pace.now_ns()) > 0 and not self.stopped.is_set():
            if self._clock is not None:
                self._clock.show(pace.log_ns())
            self.stopped.wait(min(left_ns / 1e9, every_s))

    def _wait_for_subscribers(self) -> None:
        while not any(each.publisher.subscribers() for each in self._topics.values()):
            if self.stopped.wait(LOOK_S):
                return


def in_namespace(topic: BagTopic) -> BagTopic:
    """Return a bag's topic with a relative name, which follows the namespace of a node."""
    return replace(topic, name=topic.name.lstrip("/"))


class _Clock:
    """Publishes the log's time, once each."""

    def __init__(self, node: RosNode) -> None:
        self._version = node.ros_version
        self._messages = Messages(node.ros_version)
        self._publisher: Publisher = node.publisher(CLOCK_TOPIC)
        self._shown_ns: int | None = None

    def show(self, at_ns: int) -> None:
        """Publish a time, unless it is the last one."""
        if at_ns != self._shown_ns:
            clock = self._messages.new(CLOCK, clock=self._messages.stamp(at_ns))
            self._publisher.publish(encoded(self._version, clock, CLOCK))
            self._shown_ns = at_ns


NowNs = Callable[[], int]
"""A monotonic clock, ns."""


class Pace:
    """Maps the log's time to the wall clock's.

    What is due is reckoned from the beginning, never from the message before: being late once, or
    rounding, makes nothing later that follows.
    """

    def __init__(
        self,
        begin_ns: int,
        rate: float = 1.0,
        *,
        longest_gap_ns: int | None = None,
        now_ns: NowNs = time.monotonic_ns,
    ) -> None:
        """Begin now.

        Args:
            begin_ns: The log's time of now.
            rate: Its seconds in one of the wall's; infinite: everything is due at once.
            longest_gap_ns: Stretches of the log without messages that are longer are left out.
            now_ns: The wall's clock.
        """
        self.now_ns = now_ns
        self._rate = rate
        self._longest_gap_ns = longest_gap_ns
        self._log_ns = self._before_ns = self.next_ns = begin_ns
        self._wall_ns = now_ns()

    def due_ns(self, at_ns: int) -> int:
        """Return when, by the wall's clock, the next message is due; the one before is out.

        Args:
            at_ns: Its time in the log, not before that of the message before.
        """
        self._before_ns, self.next_ns = self.next_ns, at_ns
        gap_ns = at_ns - self._before_ns
        if self._longest_gap_ns is not None and gap_ns > self._longest_gap_ns:
            self._log_ns += gap_ns  # as if it came right after the one before
        return self._wall_ns + round((at_ns - self._log_ns) / self._rate)

    def log_ns(self) -> int:
        """Return the log's time of now: between those of the message before and of the next."""
        if math.isinf(self._rate):
            return self.next_ns
        passed_ns = round((self.now_ns() - self._wall_ns) * self._rate)
        return min(max(self._log_ns + passed_ns, self._before_ns), self.next_ns)
