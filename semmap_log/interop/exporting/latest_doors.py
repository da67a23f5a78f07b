"""The door map as a fold of events that come in the order that counts: the last one says it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from semmap_log.core.model.doors import NAN, Door, DoorId, DoorMap, DoorState
from semmap_log.core.model.events import ClassDefined, DoorAnnotated, DoorEvent, Event, LevelAdded
from semmap_log.core.model.meaning import Presence
from semmap_log.core.model.object_classes import CLASS, DOOR, ObjectClass


@dataclass(slots=True)
class LatestDoors:
    """Doors and heights of levels at a moment. `DoorMapState` is the same for any order."""

    doors: dict[DoorId, Door] = field(default_factory=dict)
    elevations: dict[int, float] = field(default_factory=dict)
    """Level -> metres, or NaN."""
    classes: dict[str, ObjectClass] = field(default_factory=dict)

    @classmethod
    def of(cls, door_map: DoorMap) -> LatestDoors:
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

    def _of_its_class(self, door: Door) -> Door:
        return replace(door, object_class=self.classes.get(door.annotations.get(CLASS, ""), DOOR))


def _after(door: Door | None, event: DoorEvent) -> Door | None:
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


def _unknown(door_id: DoorId) -> Door:
    return Door(door_id, 0, NAN, NAN, NAN, NAN, DoorState.UNKNOWN, NAN, NAN)
