"""The door map once more, as plainly as can be: events sorted, then told to a dictionary."""

from __future__ import annotations

from typing import Any

from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
    Retracted,
)

Told = tuple[int, int, int, int, Event]
"""(event number, happened, recorded, recorded time of its commit, event)"""

FIELDS = {
    Changed.POSE: ("level", "x", "y", "theta"),
    Changed.WIDTH: ("width",),
    Changed.STATE: ("state",),
    Changed.PROB_OPEN: ("prob_open",),
    Changed.PROB_CLOSED: ("prob_closed",),
}
ALL = tuple(name for names in FIELDS.values() for name in names)


def model(
    told: list[Told], at: int | None = None, known_at: int | None = None, event: int | None = None
) -> dict[int, dict[str, Any]]:
    """Return door id -> values, by the rules of the design and nothing else."""
    known = [
        t
        for t in told
        if (known_at is None or t[3] <= known_at) and (event is None or t[0] <= event)
    ]
    hidden = {
        n
        for *_, e in known
        if isinstance(e, Retracted)
        for n in range(e.first_event, e.last_event + 1)
    }
    counted = [
        (min(happened, recorded), number, e)
        for number, happened, recorded, _, e in known
        if number not in hidden or isinstance(e, Retracted)
    ]
    doors: dict[int, dict[str, Any]] = {}
    gone: set[int] = set()
    for time, _, e in sorted(counted, key=lambda c: c[:2]):
        if at is not None and time > at:
            break
        if isinstance(e, DoorAdded):
            doors[e.door_id] = {name: getattr(e, name) for name in ALL} | {"seen": time, "said": {}}
        door = doors.get(getattr(e, "door_id", -1))
        if door is None or e.door_id in gone:
            continue
        if isinstance(e, DoorRemoved):
            gone.add(e.door_id)
        elif isinstance(e, DoorUpdated):
            for bit, names in FIELDS.items():
                if e.changed & bit:
                    door.update({name: getattr(e, name) for name in names})
            if e.changed & Changed.STATE:
                door["seen"] = time
        elif isinstance(e, DoorObserved):
            door.update(state=e.state, seen=time)
        elif isinstance(e, DoorPassed) and e.passed:
            door.update(state=DoorState.OPEN, seen=time)
        elif isinstance(e, DoorAnnotated):
            door["said"][e.key] = e.value
    return {door_id: door for door_id, door in sorted(doors.items()) if door_id not in gone}
