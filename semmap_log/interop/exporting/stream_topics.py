"""The topics of a log's stream: each message has the complete state, sent when it has changed.

The door map behind them is a fold of events that arrive in the order in which they count, so that
the last one wins.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from semmap_log.core.model import doors as door_model
from semmap_log.core.model.events import ClassDefined, DoorAnnotated, DoorEvent, Event, LevelAdded
from semmap_log.core.model.meaning import Presence
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros import door_messages
from semmap_log.interop.formats.ros.ros_types import check_stamp
from semmap_log.views.palette import Palette

Send = Callable[[BagTopic, int, bytes], None]
"""Takes a message: its topic, its time in ns, and what ROS sends of it."""


class WholeTopic:
    """A topic whose every message is the whole truth about it.

    One follows a change at once, but not within `every_ns` of the one before: then it comes when
    that time is over, or at the end. So the last message is never older than that.
    """

    def __init__(
        self, send: Send, topic: BagTopic, every_ns: int, message: Callable[[], bytes]
    ) -> None:
        self.topic = topic
        self.has_changed = True
        self._send = send
        self._has_sent = False
        self._every_ns = every_ns
        self._message = message
        self._next_ns = 0
        """From then on the next message may come."""

    @property
    def overdue_ns(self) -> int | None:
        """When a message is to come that waits; None: none does."""
        return self._next_ns if self.has_changed and self._has_sent else None

    def send_if_due(self, at_ns: int) -> None:
        """Send what has changed, unless it has to wait."""
        if self.has_changed and self._next_ns <= at_ns:
            self.send(at_ns)

    def send(self, at_ns: int) -> None:
        """Send the truth of now."""
        check_stamp(at_ns)
        self._send(self.topic, at_ns, self._message())
        self._has_sent = True
        self.has_changed = False
        self._next_ns = at_ns + self._every_ns


@dataclass(slots=True)
class _Shown:
    look: door_messages.DoorLook
    parts: tuple[door_messages.EncodedElement, ...]


class LevelDoors:
    """The doors of a level as markers; those that did not change are not encoded again."""

    def __init__(self, markers: door_messages.DoorMarkers, level: int, palette: Palette) -> None:
        self.level = level
        self._markers = markers
        self._palette = palette
        self._shown: dict[door_model.DoorId, _Shown] = {}

    def show(self, door_id: door_model.DoorId, door: door_model.Door | None, z: float) -> bool:
        """Show a door as it is now, on this level or not; return whether that changes anything."""
        if door is None or door.level != self.level or not door_messages.is_drawn(door):
            return self._shown.pop(door_id, None) is not None
        look = self._look(door, z)
        shown = self._shown.get(door_id)
        if shown is not None and shown.look == look:
            return False
        self._shown[door_id] = _Shown(look, self._markers.encoded(look))
        return True

    def message(self) -> bytes:
        """Return the MarkerArray, ids ascending."""
        return self._markers.message(self._shown[door].parts for door in sorted(self._shown))

    def _look(self, door: door_model.Door, z: float) -> door_messages.DoorLook:
        is_line = door.object_class.geometry is door_model.Geometry.SEGMENT
        width = door.width if is_line else 0.0
        return door_messages.DoorLook(
            door.door_id, (door.x, door.y), door.theta, width, z, door.label,
            self._palette.of_state(door.state), self._palette.text_of_state(door.state),
            door.outline,
        )  # fmt: skip


class ThesisDoors:
    """All doors that have a place, as the thesis's message; what is no door, it does not know."""

    def __init__(self, messages: door_messages.ThesisMessages) -> None:
        self._messages = messages
        self._entries: dict[door_model.DoorId, door_messages.EncodedElement] = {}

    def show(self, door_id: door_model.DoorId, door: door_model.Door | None) -> bool:
        """Show a door as it is now; return whether that changes anything."""
        if door is None or not door.is_placed or not door.object_class.is_door:
            return self._entries.pop(door_id, None) is not None
        entry = self._messages.encoded(door)
        if self._entries.get(door_id) == entry:
            return False
        self._entries[door_id] = entry
        return True

    def message(self) -> bytes:
        """Return the DoorMap, ids ascending."""
        return self._messages.message(self._entries[door] for door in sorted(self._entries))


def heights_of(doors: LatestDoors, levels: Mapping[int, object]) -> dict[int, float]:
    """Return how high each level is drawn, metres.

    Several levels lie above each other, as far as their elevations are known; one alone lies at 0.
    """
    if len(levels) < 2:
        return dict.fromkeys(levels, 0.0)
    told = {level: doors.elevations.get(level, math.nan) for level in levels}
    return {level: z if math.isfinite(z) else 0.0 for level, z in told.items()}


@dataclass(slots=True)
class LatestDoors:
    """Doors and heights of levels at a moment. `DoorMapState` is the same for any order."""

    doors: dict[door_model.DoorId, door_model.Door] = field(default_factory=dict)
    elevations: dict[int, float] = field(default_factory=dict)
    """Level -> metres, or NaN."""
    classes: dict[str, door_model.ObjectClass] = field(default_factory=dict)

    @classmethod
    def of(cls, door_map: door_model.DoorMap) -> LatestDoors:
        """Return the doors of a replay."""
        levels = door_map.levels.values()
        elevations = {level.level: level.elevation for level in levels}
        return cls(dict(door_map.doors), elevations, dict(door_map.classes))

    def take(self, event: Event) -> bool:
        """Take an event in; return whether a door or a height is another now."""
        if isinstance(event, LevelAdded):
            self.elevations[event.level] = event.elevation
            return True
        if isinstance(event, ClassDefined):
            self.classes[event.class_name] = event.object_class
            self.doors |= {i: self._of_its_class(door) for i, door in self.doors.items()}
            return True
        if not isinstance(event, DoorEvent):
            return False
        before = self.doors.get(event.door_id)
        after = _after(before, event)
        if after is not None and isinstance(event, DoorAnnotated):
            after = self._of_its_class(after)
        if after is None:
            self.doors.pop(event.door_id, None)
        else:
            self.doors[event.door_id] = after
        return after is not before

    def _of_its_class(self, door: door_model.Door) -> door_model.Door:
        return replace(
            door,
            object_class=self.classes.get(
                door.annotations.get(door_model.CLASS, ""), door_model.DOOR
            ),
        )


def _after(door: door_model.Door | None, event: DoorEvent) -> door_model.Door | None:
    """Return a door after an event about it; None: it is not in the map."""
    presence = event.effect.presence
    if presence is Presence.COMES:
        door = _unknown(event.door_id)
    if door is None or presence is Presence.GOES:
        return None
    if isinstance(event, DoorAnnotated):
        said = {**door.annotations, event.key: event.value}
        return replace(door, annotations={key: text for key, text in said.items() if text})
    values = event.values_set()
    if values == {"state": door.state}:  # nearly every sighting
        return door
    return replace(door, **values) if values else door


def _unknown(door_id: door_model.DoorId) -> door_model.Door:
    return door_model.Door(
        door_id,
        0,
        door_model.NAN,
        door_model.NAN,
        door_model.NAN,
        door_model.NAN,
        door_model.DoorState.UNKNOWN,
        door_model.NAN,
        door_model.NAN,
    )
