"""Doors that somebody clicks in RViz: two points are a door's line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, cos, hypot, isfinite, sin

from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, Event
from semmap_log.core.texts import command_line
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.topics.topic_reader import Context, TopicMessage
from semmap_log.interop.topics.topic_rules import ReadClicks

LEAST_M, MOST_M = 0.4, 6.0
"""A door's width."""
TWICE_M = 0.3
"""A door whose both ends are so near to those of another is that door, clicked twice."""


@dataclass(frozen=True, slots=True)
class _Click:
    x: float
    y: float
    received_ns: int


class ClickedDoors:
    """Reads PointStamped: the first click is the hinge, the start of the line; the second its end.

    What cannot be a door's width is complained about, and both clicks are forgotten; a second click
    that comes too late is the first one of another door.
    """

    def __init__(self, topic: str, rule: ReadClicks, context: Context) -> None:
        self._topic = topic
        self._rule = rule
        self._context = context
        self._level = context.level(rule.level)
        self._first: _Click | None = None
        self.said = ""
        """What the last message did, for who clicks."""

    def events(self, got: TopicMessage) -> Iterator[Event]:
        """Return a door, where the message is its second click."""
        self.said = ""
        click = self._click(got)
        if click is None:
            return
        first, self._first = self._first, click
        if first is None or self._is_late(first, click):
            self.said = f"a door's hinge at {click.x:.2f}, {click.y:.2f}; now click its other end"
            return
        self._first = None
        width = hypot(click.x - first.x, click.y - first.y)
        theta = atan2(click.y - first.y, click.x - first.x)
        if not LEAST_M <= width <= MOST_M:
            self._complain(
                f"two clicks that are no door: expected {LEAST_M} to {MOST_M:g} m between them; "
                "click both ends anew",
                f"{width:.2f} m",
            )
            return
        there = self._there(first, click)
        if there is not None:
            self._complain("a door that the log has; passed over", f"door {there.door_id}")
            return
        new = self._context.known.next_id
        happened_ns = self._context.happened_ns(got, got.message.header.stamp)
        name = f"clicked {(first.x + click.x) / 2:.1f} {(first.y + click.y) / 2:.1f}"
        self.said = (
            f"door {new} from {first.x:.2f}, {first.y:.2f} to {click.x:.2f}, {click.y:.2f}, "
            f"{width:.2f} m wide; wrong? {command_line('remove', 'LOG', str(new))}"
        )
        yield DoorAdded(
            door_id=new, level=self._level, x=first.x, y=first.y, theta=theta, width=width,
            happened_ns=happened_ns,
        )  # fmt: skip
        yield DoorAnnotated(door_id=new, key="name", value=name, happened_ns=happened_ns)

    def actor(self, _got: TopicMessage) -> str:
        """Return nobody: a click does not tell whose it is."""
        return ""

    def _click(self, got: TopicMessage) -> _Click | None:
        """Return where it was clicked; None: nowhere on this level."""
        frame = got.message.header.frame_id.removeprefix("/")
        if frame != self._context.mapping.map_frame:
            self._complain(
                f"a click in another frame than {self._context.mapping.map_frame}; passed over: "
                "set RViz's Fixed Frame",
                shown(frame),
            )
            return None
        point = got.message.point
        if not all(map(isfinite, (point.x, point.y, point.z))):
            self._complain("a click that is nowhere; passed over", f"{point.x} {point.y} {point.z}")
            return None
        low, high = self._rule.heights
        if not low <= point.z <= high:
            self._complain(
                f"a click on another level; passed over: expected z from {low:g} to {high:g} m",
                f"{point.z:.2f} m",
            )
            return None
        return _Click(float(point.x), float(point.y), got.received_ns)

    def _is_late(self, first: _Click, second: _Click) -> bool:
        """Tell whether the second click is none of the same door; then that is complained about."""
        waited_s = (second.received_ns - first.received_ns) / 1e9
        if 0 <= waited_s <= self._rule.within_s:
            return False
        self._complain(
            f"a second click more than {self._rule.within_s:g} s after the first; taken as the "
            "first of another door",
            f"{waited_s:.0f} s",
        )
        return True

    def _there(self, first: _Click, second: _Click) -> Door | None:
        """Return the door of this level that has these ends, whichever way round."""
        ends = (first.x, first.y), (second.x, second.y)
        for door in self._context.known.doors.values():
            if door.is_placed and door.level == self._level:
                start = door.x, door.y
                end = door.x + door.width * cos(door.theta), door.y + door.width * sin(door.theta)
                if any(_are_near(ends, way) for way in ((start, end), (end, start))):
                    return door
        return None

    def _complain(self, kind: str, example: str) -> None:
        self._context.complaints.add(self._topic, kind, example)


_Ends = tuple[tuple[float, float], tuple[float, float]]


def _are_near(some: _Ends, others: _Ends) -> bool:
    return all(
        hypot(x - other_x, y - other_y) < TWICE_M
        for (x, y), (other_x, other_y) in zip(some, others, strict=True)
    )
