"""What doors are called in a message, so that nobody needs to guess which one is meant."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import Door, DoorId, DoorMap


def labels_of(door_map: DoorMap) -> dict[DoorId, str]:
    """Return what to call each door of a map that has a name: see `told_apart`."""
    doors = door_map.doors.values()
    return told_apart((door, door_map.level_name(door.level)) for door in doors)


def labels_ever(state: DoorMapState) -> dict[DoorId, str]:
    """Return the same, and the names of doors that were removed."""
    return {**state.names(), **labels_of(state.door_map())}


def told_apart(doors: Iterable[tuple[Door, str]]) -> dict[DoorId, str]:
    """Return what to call each door that has a name, given the name of its level.

    Its name; where several bear it level/name, as commands take it; where even that is another's,
    with the id.
    """
    named = {door.door_id: (door.name, level) for door, level in doors if door.name}
    bearers = Counter(name for name, _ in named.values())
    on_level = Counter(named.values())
    labels = {}
    for door_id, (name, level) in named.items():
        if bearers[name] == 1:
            labels[door_id] = name
        elif on_level[name, level] == 1:
            labels[door_id] = f"{level}/{name}"
        else:
            labels[door_id] = f"{level}/{name} (id {door_id})"
    return labels
