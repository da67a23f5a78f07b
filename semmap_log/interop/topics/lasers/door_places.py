"""The places of a door map's doors, for matching a laser's beams."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from semmap_log.analysis.scans.visit import DoorPlaces
from semmap_log.core.model.doors import CLASS, Door, DoorState
from semmap_log.core.model.events import ClassDefined, DoorAnnotated, Event
from semmap_log.core.model.meaning import PLACING, Presence
from semmap_log.interop.topics.topic_reader import Known

_NO = frozenset({"", "no", "false", "0", "none"})


def places_of(doors: Iterable[Door]) -> DoorPlaces:
    """Return the places of those that have one; objects that are not doors are left out."""
    placed = [door for door in doors if door.is_placed and door.object_class.is_door]
    lines = [(door.x, door.y, door.theta, door.width) for door in placed]
    return DoorPlaces(
        ids=np.array([door.door_id for door in placed], np.int64),
        levels=np.array([door.level for door in placed], np.int64),
        lines=np.array(lines, np.float64).reshape(-1, 4),
        kinds=tuple(door.annotations.get("kind", "") for door in placed),
        glass=np.array([is_glass(door) for door in placed], np.bool_),
    )


def is_glass(door: Door) -> bool:
    """Return whether its annotation `glass` says that light goes through the leaf."""
    return door.annotations.get("glass", "").strip().lower() not in _NO


def changes_places(event: Event) -> bool:
    """Return whether an event can change what `places_of` returns."""
    if isinstance(event, DoorAnnotated):
        return event.key in {"kind", "glass", CLASS}
    if isinstance(event, ClassDefined):
        return True
    parts = getattr(event, "changed", event.effect.sets)
    return event.effect.presence is not Presence.STAYS or bool(parts & PLACING)


class DoorsNow:
    """The places of the doors that are known now; the same object while none of them changes."""

    def __init__(self, known: Known) -> None:
        self._known = known
        self._places = places_of(known.doors.values())

    def saw(self, events: Iterable[Event]) -> None:
        """Take note of events that are known already."""
        if any(changes_places(event) for event in events):
            self._places = places_of(self._known.doors.values())

    def at(self, _when_ns: int) -> DoorPlaces:
        """Return the places."""
        return self._places

    def state(self, door_id: int, _since_ns: int, _when_ns: int) -> DoorState | None:
        """Return a door's state, whoever reported it; None: it is not there."""
        door = self._known.doors.get(door_id)
        return None if door is None else door.state
