"""The door map as a fold of events that come in the order that counts: the last one says it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from semmap_log.doors import Door, DoorId, DoorMap
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorRemoved,
    DoorUpdated,
    Event,
    LevelAdded,
)
from semmap_log.views.event_words import state_told_by


@dataclass(slots=True)
class DoorTable:
    """Doors and heights of levels at a moment. `DoorMapState` is the same for any order."""

    doors: dict[DoorId, Door] = field(default_factory=dict)
    elevations: dict[int, float] = field(default_factory=dict)
    """Level -> metres, or NaN."""

    @classmethod
    def of(cls, door_map: DoorMap) -> DoorTable:
        """Return the table of a replay."""
        levels = door_map.levels.values()
        return cls(dict(door_map.doors), {level.level: level.elevation for level in levels})

    def take(self, event: Event) -> bool:
        """Take an event in; return whether a door or a height is another now."""
        if isinstance(event, LevelAdded):
            self.elevations[event.level] = event.elevation
            return True
        if not isinstance(event, DoorEvent):
            return False
        before = self.doors.get(event.door_id)
        after = _after(before, event)
        if after is None:
            self.doors.pop(event.door_id, None)
        else:
            self.doors[event.door_id] = after
        return after is not before


def _after(door: Door | None, event: DoorEvent) -> Door | None:
    """Return a door after an event about it; None: it is not in the map."""
    if isinstance(event, DoorAdded):
        return Door(
            event.door_id, event.level, event.x, event.y, event.theta, event.width, event.state,
            event.prob_open, event.prob_closed,
        )  # fmt: skip
    if door is None or isinstance(event, DoorRemoved):
        return None
    if isinstance(event, DoorUpdated):
        return _updated(door, event)
    if isinstance(event, DoorAnnotated):
        said = {**door.annotations, event.key: event.value}
        return replace(door, annotations={key: text for key, text in said.items() if text})
    state = state_told_by(event)
    return door if state in (None, door.state) else replace(door, state=state)


def _updated(door: Door, event: DoorUpdated) -> Door:
    changed = event.changed
    if changed & Changed.POSE:
        door = replace(door, level=event.level, x=event.x, y=event.y, theta=event.theta)
    if changed & Changed.WIDTH:
        door = replace(door, width=event.width)
    if changed & Changed.STATE:
        door = replace(door, state=event.state)
    if changed & Changed.PROB_OPEN:
        door = replace(door, prob_open=event.prob_open)
    if changed & Changed.PROB_CLOSED:
        door = replace(door, prob_closed=event.prob_closed)
    return door
