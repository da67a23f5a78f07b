"""A log folded to messages on topics: what a player, or RViz, receives over time.

At each moment of the stream the last message of each topic is what `replay(at=…)` returns for that
moment: what was true, with all that is known today. So a player can seek in it. It goes into a bag
(`log_bag`) or to live subscribers (`live.player`). A `StreamPlan` has what must be known before
the first message.

Events come in the order in which they count, with who and why. The log has them in the order of
recording; late ones are put in their place slice by slice of happened time. Only the times
themselves, 8 bytes an event, are held all at once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import Retractions
from semmap_log.core.folds.history import HistoryEntry, history
from semmap_log.core.io.progress import Progress
from semmap_log.core.model import events as ev
from semmap_log.core.model.doors import DOOR, DoorId, DoorMap
from semmap_log.core.model.moments import Time, check_ordered
from semmap_log.interop.exporting import stream_topics
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros import ros_types
from semmap_log.interop.formats.ros.door_messages import DoorMarkers, ThesisMessages, grid_message
from semmap_log.log import DoorLog, Window, warn_of_clock
from semmap_log.views.event_words import printable, words_of
from semmap_log.views.palette import DEFAULT, Palette


@dataclass(frozen=True, slots=True)
class StreamOptions:
    """What is exported, and how."""

    markers: bool = False
    """Doors as markers and events in words, too; else the thesis's DoorMap, the robot's poses and
    the floor plans: what a robot would have published."""
    palette: Palette = DEFAULT
    """Of the markers."""
    default_prob: float | None = None
    """Stands for probabilities that were not given, in the thesis's messages; None: NaN does."""
    every_s: float | None = None
    """The arrays of doors come at most so often, each topic's; 0: at each change. None: at each
    change, and with markers as often as a log of that size allows: see `EVERY_S`."""


@dataclass(frozen=True, slots=True)
class StreamMessage:
    """A message, as ROS sends it."""

    topic: BagTopic
    at_ns: int
    """When it became true, in the log's happened time."""
    data: bytes


@dataclass(frozen=True, slots=True)
class LogStream:
    """A span of a log as messages; it can be gone through again and again."""

    log: DoorLog
    options: StreamOptions
    plan: StreamPlan
    ros_version: ros_types.RosVersion
    since_ns: int | None
    """The first messages show this moment; None: the first event's, of a log without a horizon."""
    before: DoorMap
    """The doors of that moment."""
    times: Times
    """When the later events count."""

    @property
    def topics(self) -> list[BagTopic]:
        """All that there are messages on, and those that stay empty."""
        return self.plan.topics

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """When the first and the last message come; None: there is none."""
        ends = [*self.times[[0, -1]].tolist()] if len(self.times) else []
        if self.since_ns is not None:
            ends.insert(0, self.since_ns)
        return (ends[0], ends[-1]) if ends else None

    def messages(self, progress: Progress | None = None) -> Iterator[StreamMessage]:
        """Yield the messages, their times ascending, in memory of a slice of the log.

        Args:
            progress: Called with how many of the events are done.

        Raises:
            OutputError: A time cannot be a ROS stamp.
        """
        out: list[StreamMessage] = []
        fold = _Fold(self, out)
        if self.since_ns is not None:
            fold.begin(self.since_ns)
            yield from _taken(out)
        for at_ns, entries in moments(self.log, self.times, progress):
            fold.take(at_ns, entries)
            yield from _taken(out)
        fold.finish()
        yield from _taken(out)


def _taken(out: list[StreamMessage]) -> Iterator[StreamMessage]:
    yield from out
    out.clear()


def log_stream(
    log: DoorLog,
    options: StreamOptions = StreamOptions(),
    *,
    ros_version: ros_types.RosVersion,
    since: Time = None,
    until: Time = None,
) -> LogStream:
    """Return a log's stream, after a look at all of it.

    Args:
        log: The log.
        options: What is exported.
        ros_version: Whose messages.
        since: The first messages show this moment; default: the first event's, or the horizon.
        until: The last moment; default: the log's end.

    Raises:
        MomentError: `since` comes after `until`.
        HorizonError: It begins, or ends, before the log's horizon.
    """
    since_ns, until_ns = log.instant(since), log.instant(until)
    warn_of_clock(log, since_ns)
    check_ordered(since_ns, until_ns)
    later_ns = log.shown_from_ns(
        None if since_ns is None else since_ns + 1, None if until_ns is None else until_ns + 1
    )
    since_ns = None if later_ns is None else later_ns - 1
    before = DoorMap({}, {}) if since_ns is None else log.replay(at=since_ns)
    times = times_of(log, later_ns, until_ns)
    plan = plan_of(
        log,
        before,
        times,
        ros_version=ros_version,
        markers=options.markers,
        every_s=options.every_s,
    )
    return LogStream(log, options, plan, ros_version, since_ns, before, times)


class _Fold:
    """Folds the events, and puts out what they change."""

    def __init__(self, stream: LogStream, out: list[StreamMessage]) -> None:
        log, plan, before = stream.log, stream.plan, stream.before
        version, options = stream.ros_version, stream.options
        self._out = out
        self._counts: Counter[BagTopic] = Counter()
        self._plan = plan
        self._version = version
        self._messages = ros_types.Messages(version)
        self._table = stream_topics.LatestDoors.of(before)
        self._heights = stream_topics.heights_of(self._table, plan.levels)
        self._floors = {level: floor for level in plan.floors
                        if (floor := log.floor_of(before, level)) is not None}  # fmt: skip
        markers = DoorMarkers(version)
        shown = plan.doors if plan.markers else ()
        self._levels = [
            stream_topics.LevelDoors(markers, level, options.palette) for level in shown
        ]
        self._thesis = stream_topics.ThesisDoors(ThesisMessages(version, options.default_prob))
        every_ns = round(plan.every_s * 1e9)
        self._of_levels = [
            stream_topics.WholeTopic(self._send, plan.doors[doors.level], every_ns, doors.message)
            for doors in self._levels
        ]
        self._of_thesis = stream_topics.WholeTopic(
            self._send, THESIS, every_ns, self._thesis.message
        )
        self._names = log.door_names()
        self._new_floors = set(self._floors)
        """Levels of which the plan is another than the last that was sent, or lies elsewhere."""
        self._last_ns = 0
        self._show_all()

    def begin(self, at_ns: int) -> None:
        """Send what is there before the first event."""
        self._send_due(at_ns)

    def take(self, at_ns: int, entries: Sequence[HistoryEntry]) -> None:
        """Send what happened at a moment."""
        self._catch_up(at_ns)
        for entry in entries:
            self._take(at_ns, entry)
        self._send_due(at_ns)

    def finish(self) -> None:
        """Send what still waits for its time, as of the last moment."""
        for waiting in self._arrays():
            if waiting.has_changed and self._last_ns:
                waiting.send(self._last_ns)

    def _take(self, at_ns: int, entry: HistoryEntry) -> None:
        event = entry.event
        if isinstance(event, ev.RobotPose):
            self._send_robot(at_ns, event)
            return
        if self._plan.markers:
            self._send_words(at_ns, entry)
        has_changed = self._table.take(event)
        if isinstance(event, ev.FloorMap):
            self._floors[event.level] = event
            self._new_floors.add(event.level)
        elif has_changed and isinstance(event, ev.DoorEvent):
            self._show(event.door_id)
        elif isinstance(event, ev.ClassDefined):
            self._show_all()
        elif isinstance(event, ev.LevelAdded):
            self._raise_levels()

    def _show_all(self) -> None:
        for door_id in self._table.doors:
            self._show(door_id)

    def _show(self, door_id: DoorId) -> None:
        door = self._table.doors.get(door_id)
        for shown, topic in zip(self._levels, self._of_levels, strict=True):
            topic.has_changed |= shown.show(door_id, door, self._heights[shown.level])
        self._of_thesis.has_changed |= self._thesis.show(door_id, door)

    def _raise_levels(self) -> None:
        """Put levels of which the height became known where they belong."""
        before, self._heights = (
            self._heights,
            stream_topics.heights_of(self._table, self._plan.levels),
        )
        self._new_floors |= {n for n in self._floors if self._heights[n] != before[n]}
        if self._heights != before:
            self._show_all()

    def _catch_up(self, at_ns: int) -> None:
        """Send what has waited long enough before a moment, each at its time."""
        late = [(due_ns, topic) for topic in self._arrays()
                if (due_ns := topic.overdue_ns) is not None and due_ns < at_ns]  # fmt: skip
        for due_ns, topic in sorted(late, key=lambda each: each[0]):
            topic.send(due_ns)

    def _send_due(self, at_ns: int) -> None:
        for level in sorted(self._new_floors):
            self._send_floor(at_ns, level)
        self._new_floors.clear()
        for topic in self._arrays():
            topic.send_if_due(at_ns)
        self._last_ns = at_ns

    def _arrays(self) -> Iterator[stream_topics.WholeTopic]:
        yield from self._of_levels
        yield self._of_thesis

    def _send_floor(self, at_ns: int, level: int) -> None:
        floor, topic = self._floors[level], self._plan.floors[level]
        z = self._heights[level]
        origin = self._messages.pose(floor.origin_x, floor.origin_y, z, floor.origin_theta)
        number = self._counts[topic]
        grid = grid_message(
            self._messages, at_ns, number, floor.cells, resolution=floor.resolution, origin=origin
        )
        self._send_message(topic, at_ns, grid)

    def _send_robot(self, at_ns: int, pose: ev.RobotPose) -> None:
        number, z = self._counts[ROBOT], self._heights.get(pose.level, 0.0)
        self._send_message(
            ROBOT, at_ns, ros_types.pose_message(self._messages, at_ns, number, pose, z)
        )

    def _send_words(self, at_ns: int, entry: HistoryEntry) -> None:
        topic = self._plan.events
        number = self._counts[topic]
        self._send_message(
            topic, at_ns, ros_types.log_message(self._messages, at_ns, number, self._line(entry))
        )

    def _line(self, entry: HistoryEntry) -> ros_types.LogLine:
        """Return an event in words: the door is the node, the event's kind the function."""
        said = ": ".join(text for text in (entry.actor, entry.reason) if text)
        door_id = entry.door_id
        known = None if door_id is None else self._table.doors.get(door_id)
        words = words_of(entry.event, DOOR if known is None else known.object_class)
        text = words + (f" [{said}]" if said else "")
        name = "semmap" if door_id is None else self._names.get(door_id, f"door {door_id}")
        return ros_types.LogLine(
            printable(name), printable(text), entry.source, entry.kind, entry.number
        )

    def _send_message(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        self._send(topic, at_ns, ros_types.encoded(self._version, message, topic.ros_type))

    def _send(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        self._out.append(StreamMessage(topic, at_ns, data))
        self._counts[topic] += 1


ROBOT = BagTopic("/semmap/robot_pose", ros_types.POSE_STAMPED, is_latched=False)
THESIS = BagTopic("/lta_semantic_map_door_db", ros_types.DOOR_MAP, is_latched=True)

EVERY_S = (0, 1, 10, 60, 600, 3600, 86_400)
"""How far whole arrays may lie apart: of these the first with which there are not too many."""
MOST_DOORS_SENT = 10_000_000
"""Doors in all arrays of a topic together: some 5 GB to whoever unpacks them all. A week of a
clinic with 133 doors and 19,000 sightings stays below it, a year of it comes at most each 600 s."""


@dataclass(frozen=True, slots=True)
class StreamPlan:
    """The topics of a stream: bags and publishers want to know them before the first message."""

    floors: dict[int, BagTopic]
    """By the level."""
    doors: dict[int, BagTopic]
    events: BagTopic
    has_robot: bool
    every_s: float
    markers: bool
    """Doors and events are drawn, too, for viewers that do not know the thesis's message."""

    @property
    def levels(self) -> dict[int, None]:
        """All that are shown."""
        return dict.fromkeys(sorted({*self.floors, *self.doors}))

    @property
    def topics(self) -> list[BagTopic]:
        """All of the stream."""
        robot = [ROBOT] if self.has_robot else []
        if not self.markers:
            return [*self.floors.values(), THESIS, *robot]
        return [*self.floors.values(), *self.doors.values(), THESIS, *robot, self.events]


def plan_of(
    log: DoorLog,
    before: DoorMap,
    times: Times,
    *,
    ros_version: ros_types.RosVersion,
    markers: bool,
    every_s: float | None,
) -> StreamPlan:
    """Return what a stream of a log will hold.

    Args:
        log: The log.
        before: The doors before the first event.
        times: When the events count: see `times_of`.
        ros_version: Whose types.
        markers: With the topics that show doors and events.
        every_s: How far arrays lie apart; None: see `EVERY_S`.
    """
    doors = {door.level for door in before.doors.values() if door.is_placed}
    floors = {level.level for level in before.levels.values() if level.floor_map_event is not None}
    count, has_robot = len(before), False
    changes = [np.empty(0, np.int64)]
    if len(times):
        for batch in log.batches(int(times[0]), int(times[-1]) + 1):
            has_robot |= ev.RobotPose in batch
            count += sum(len(batch.where(kind)) for kind in ev.ADDING_KINDS)
            changes.append(batch.folds_ns[batch.about_doors()])
            floors |= {
                each.level
                for each in batch.objects.get(ev.FloorMap.kind, ())
                if isinstance(each, ev.FloorMap)
            }
            for kind in ev.POSE_KINDS:
                if kind in batch:
                    rows = batch[kind]
                    doors.update(rows["level"][np.isfinite(rows["x"])].tolist())
    several = len(doors | floors) > 1

    def topics(name: str, ros_type: str, levels: set[int]) -> dict[int, BagTopic]:
        return {
            level: BagTopic(f"{name}/level_{level}" if several and level else name, ros_type, True)
            for level in sorted(levels)
        }

    if every_s is None:
        every_s = 0 if not markers else _every_s(np.sort(np.concatenate(changes)), count)
    events = BagTopic("/semmap/events", ros_types.log_type(ros_version), is_latched=False)
    return StreamPlan(
        topics("/map", ros_types.GRID, floors),
        topics("/semmap/doors", ros_types.MARKERS, doors or {0}),
        events,
        has_robot,
        every_s,
        markers,
    )


def _every_s(times: Times, doors: int) -> float:
    """Return how far arrays have to lie apart, if each of these moments changed a door."""
    for every_s in EVERY_S:
        arrays = 1 + np.count_nonzero(np.diff(times // max(1, every_s * 10**9)))
        if arrays * doors <= MOST_DOORS_SENT:
            return every_s
    return EVERY_S[-1]


SLICE_EVENTS = 20_000

Times = NDArray[np.int64]
"""Nanoseconds, ascending, one for each event."""


def times_of(log: DoorLog, since_ns: int | None, until_ns: int | None) -> Times:
    """Return when the events of a range count, without retracted ones.

    Args:
        log: Where from.
        since_ns: From then on.
        until_ns: The last moment.
    """
    until = None if until_ns is None else until_ns + 1
    times = [np.empty(0, np.int64), *(batch.folds_ns for batch in log.batches(since_ns, until))]
    return np.sort(np.concatenate(times))


def moments(
    log: DoorLog, times: Times, progress: Progress | None = None
) -> Iterator[tuple[int, Sequence[HistoryEntry]]]:
    """Yield each moment at which something happened, and what did, in the order that counts.

    Args:
        log: Where from.
        times: `times_of` its range.
        progress: Called with how many of the events are done.
    """
    done = 0
    starts = np.unique(times[::SLICE_EVENTS]).tolist()
    behind = int(times[-1]) + 1 if len(times) else 0
    for first_ns, before_ns in pairwise([*starts, behind]):
        entries = sorted(_slice(log, first_ns, before_ns), key=attrgetter("folds_ns", "number"))
        for at_ns, together in groupby(entries, attrgetter("folds_ns")):
            yield at_ns, list(together)
        done += len(entries)
        if progress is not None:
            progress(done, len(times))


def _slice(log: DoorLog, first_ns: int, before_ns: int) -> Iterator[HistoryEntry]:
    finder = log.note_finder()
    window = Window(happened_from_ns=first_ns, happened_before_ns=before_ns)
    hidden = log.retractions()
    batches = log.batches_in(window, on_page=finder.look_at)
    seen = (hidden.visible(batch) for batch in batches)
    return history((b for b in seen if len(b)), finder.note_texts_of, Retractions())
