"""A log folded to what RViz, Foxglove and Lichtblick show: doors, floors, robot, events, over time.

At each moment of the bag the last message of each topic is what `replay(at=…)` says of that moment:
what was true, with all that is known today. So it can be played, and jumped in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from semmap_log.door_log import DoorLog, Time
from semmap_log.doors import DoorId, DoorMap
from semmap_log.events import DoorEvent, FloorMap, LevelAdded, RobotPose
from semmap_log.exporting.door_table import DoorTable
from semmap_log.exporting.in_order import moments, times_of
from semmap_log.exporting.marker_plan import ROBOT, THESIS, MarkerPlan, plan_of
from semmap_log.exporting.marker_topics import LevelDoors, ThesisDoors, WholeTopic, heights_of
from semmap_log.formats.bags import BagTopic, NewBag, bytes_of, new_bag, ros_version_of
from semmap_log.formats.door_markers import DoorMarkers, is_drawn
from semmap_log.formats.event_messages import LogLine, log_message, pose_message
from semmap_log.formats.grid_messages import grid_message
from semmap_log.formats.ros_messages import Messages
from semmap_log.formats.thesis_messages import ThesisMessages
from semmap_log.log.disk import refuse_own_folder
from semmap_log.log.reading.passage import Progress
from semmap_log.moments import refuse_reversed
from semmap_log.projections.history import HistoryEntry
from semmap_log.views.event_words import printable, words_of
from semmap_log.views.palette import DEFAULT, Palette


@dataclass(frozen=True, slots=True)
class MarkerOptions:
    """How it is shown."""

    palette: Palette = DEFAULT
    default_prob: float | None = None
    """Stands for probabilities that were not given, in the thesis's messages; None: NaN does."""
    every_s: float | None = None
    """The arrays of doors come at most so often, each topic's; 0: at each change. None: as often
    as a log of that size allows: see `EVERY_S`."""


@dataclass(frozen=True, slots=True)
class RecordedMarkers:
    """What was written."""

    messages: dict[str, int]
    """Topic -> how many."""
    every_s: float
    """See `MarkerOptions`."""
    left_out: tuple[str, ...]
    """Doors that have no place at the end, and so are not shown."""
    bytes: int


def record_markers(
    log: DoorLog,
    out: Path,
    options: MarkerOptions = MarkerOptions(),
    *,
    since: Time = None,
    until: Time = None,
    progress: Progress | None = None,
) -> RecordedMarkers:
    """Write the bag, whole or not at all; the same log and options give the same bytes.

    Args:
        log: The log.
        out: `.mcap`, `.bag` (ROS 1) or, without an extension, a rosbag2 folder. A file that was
            there is replaced, a folder never.
        options: How it is shown.
        since: The first messages show this moment; default: the first event's.
        until: The last moment; default: the log's end.
        progress: Told how many of the events are done.

    Raises:
        FormatError: The name tells no bag.
        MomentError: `since` comes after `until`.
        OutputError: It cannot be written, or a time cannot be a ROS stamp; what was there is whole.
    """
    refuse_own_folder(log.path, out)
    since_ns, until_ns = log.instant(since), log.instant(until)
    refuse_reversed(since_ns, until_ns)
    before = DoorMap({}, {}) if since_ns is None else log.replay(at=since_ns)
    times = times_of(log, None if since_ns is None else since_ns + 1, until_ns)
    plan = plan_of(log, before, times, ros_version=ros_version_of(out), every_s=options.every_s)
    with new_bag(out, plan.topics) as bag:
        stream = _Stream(bag, log, plan, options, before)
        if since_ns is not None:
            stream.begin(since_ns)
        for at_ns, entries in moments(log, times, progress):
            stream.take(at_ns, entries)
        stream.finish()
    return RecordedMarkers(stream.counts, plan.every_s, _left_out(log, until_ns), bytes_of(out))


class _Stream:
    """Folds the events, and writes what they change."""

    def __init__(
        self, bag: NewBag, log: DoorLog, plan: MarkerPlan, options: MarkerOptions, before: DoorMap
    ) -> None:
        self.counts: Counter[str] = Counter({topic.name: 0 for topic in plan.topics})
        self._bag = bag
        self._plan = plan
        self._messages = Messages(bag.ros_version)
        self._table = DoorTable.of(before)
        self._heights = heights_of(self._table, plan.levels)
        self._floors = {level: floor for level in plan.floors
                        if (floor := log.floor_of(before, level)) is not None}  # fmt: skip
        markers = DoorMarkers(bag.ros_version)
        self._levels = [LevelDoors(markers, level, options.palette) for level in plan.doors]
        self._thesis = ThesisDoors(ThesisMessages(bag.ros_version, options.default_prob))
        every_ns = round(plan.every_s * 1e9)
        self._of_levels = [
            WholeTopic(bag, plan.doors[shown.level], every_ns, shown.message)
            for shown in self._levels
        ]
        self._of_thesis = WholeTopic(bag, THESIS, every_ns, self._thesis.message)
        self._names = log.door_names()
        self._new_floors = set(self._floors)
        """Levels of which the plan is another than the last that was sent, or lies elsewhere."""
        self._last_ns = 0
        for door_id in self._table.doors:
            self._show(door_id)

    def begin(self, at_ns: int) -> None:
        """Write what there is before the first event."""
        self._send_due(at_ns)

    def take(self, at_ns: int, entries: Sequence[HistoryEntry]) -> None:
        """Write what happened at a moment."""
        self._catch_up(at_ns)
        for entry in entries:
            self._take(at_ns, entry)
        self._send_due(at_ns)

    def finish(self) -> None:
        """Write what waits for its time, as of the last moment."""
        for waiting in self._arrays():
            if waiting.has_changed and self._last_ns:
                waiting.send(self._last_ns)
            self.counts[waiting.topic.name] = waiting.count

    def _take(self, at_ns: int, entry: HistoryEntry) -> None:
        event = entry.event
        if isinstance(event, RobotPose):
            self._send_robot(at_ns, event)
            return
        self._send_words(at_ns, entry)
        has_changed = self._table.take(event)
        if isinstance(event, FloorMap):
            self._floors[event.level] = event
            self._new_floors.add(event.level)
        elif has_changed and isinstance(event, DoorEvent):
            self._show(event.door_id)
        elif isinstance(event, LevelAdded):
            self._raise_levels()

    def _show(self, door_id: DoorId) -> None:
        door = self._table.doors.get(door_id)
        for shown, topic in zip(self._levels, self._of_levels, strict=True):
            topic.has_changed |= shown.show(door_id, door, self._heights[shown.level])
        self._of_thesis.has_changed |= self._thesis.show(door_id, door)

    def _raise_levels(self) -> None:
        """Put levels of which the height became known where they belong."""
        before, self._heights = self._heights, heights_of(self._table, self._plan.levels)
        self._new_floors |= {n for n in self._floors if self._heights[n] != before[n]}
        if self._heights != before:
            for door_id in self._table.doors:
                self._show(door_id)

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

    def _arrays(self) -> Iterator[WholeTopic]:
        yield from self._of_levels
        yield self._of_thesis

    def _send_floor(self, at_ns: int, level: int) -> None:
        floor, topic = self._floors[level], self._plan.floors[level]
        z = self._heights[level]
        origin = self._messages.pose(floor.origin_x, floor.origin_y, z, floor.origin_theta)
        number = self.counts[topic.name]
        grid = grid_message(
            self._messages, at_ns, number, floor.cells, resolution=floor.resolution, origin=origin
        )
        self._send(topic, at_ns, grid)

    def _send_robot(self, at_ns: int, pose: RobotPose) -> None:
        number, z = self.counts[ROBOT.name], self._heights.get(pose.level, 0.0)
        self._send(ROBOT, at_ns, pose_message(self._messages, at_ns, number, pose, z))

    def _send_words(self, at_ns: int, entry: HistoryEntry) -> None:
        topic = self._plan.events
        number = self.counts[topic.name]
        message = log_message(self._messages, at_ns, number, self._line(entry))
        self._send(topic, at_ns, message)

    def _line(self, entry: HistoryEntry) -> LogLine:
        """Return an event in words: the door is the node, the event's kind the function."""
        said = ": ".join(text for text in (entry.actor, entry.reason) if text)
        text = words_of(entry.event) + (f" [{said}]" if said else "")
        door_id = entry.door_id
        name = "semmap" if door_id is None else self._names.get(door_id, f"door {door_id}")
        return LogLine(printable(name), printable(text), entry.source, entry.kind, entry.number)

    def _send(self, topic: BagTopic, at_ns: int, message: object) -> None:
        self._bag.write(topic, at_ns, message)
        self.counts[topic.name] += 1


def _left_out(log: DoorLog, until_ns: int | None) -> tuple[str, ...]:
    doors = log.replay(at=until_ns).doors.values()
    return tuple(door.label for door in doors if not is_drawn(door))
