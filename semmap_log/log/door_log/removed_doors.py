"""Doors that were removed, by what people call them."""

from __future__ import annotations

from collections.abc import Sequence

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId

ID_PREFIX = "id:"
"""`id:7` is the door of that id, whatever doors are called."""


def removed_called(text: str | int, state: DoorMapState) -> list[DoorId]:
    """Return the removed doors of that id, name, or level/name, ids ascending."""
    levels = state.level_names()
    found = []
    for door_id in map(DoorId, sorted(state.used_door_ids)):
        removed = state.removed_door(door_id)
        if removed is None:
            continue
        calls = {str(door_id), f"{ID_PREFIX}{door_id}"}
        if name := removed.door.name:
            level = removed.door.level
            calls |= {name, f"{levels.get(level) or level}/{name}"}
        if str(text) in calls:
            found.append(door_id)
    return found


def told_removed(doors: Sequence[DoorId], state: DoorMapState) -> str:
    """Return that doors were removed, and how to ask of the time when they were there."""
    said = []
    for door_id in doors:
        removed = state.removed_door(door_id)
        assert removed is not None, "one that `removed_called` gave"
        called = told_door(door_id, removed.door.name)
        before = f"event:{removed.event - 1}"
        said.append(f"{called} was removed by event {removed.event}; as it was then: --at {before}")
    return ". ".join(said) + "."


def several_removed(text: str | int, doors: Sequence[DoorId]) -> str:
    """Return that a name can mean several removed doors, and how to say which."""
    return (
        f"{text!r} is the name of {len(doors)} doors that were removed; say which by "
        f"{which_id(doors)}."
    )


def told_door(door_id: int, name: str | None) -> str:
    """Return a door in words: `door 'front' (id 7)`, or `door 7`, which has no name."""
    return f"door {name!r} (id {door_id})" if name else f"door {door_id}"


def told_absent(door_id: int) -> str:
    """Return that a door is not in the map, and of door 0 why."""
    why = "" if door_id else ": ids are given from 1 on, and 0 comes with the thesis's doors only"
    return f"door {door_id} is not in the map{why}."


def which_id(doors: Sequence[DoorId]) -> str:
    """Return how one of several doors is meant: `id:1 or id:4`."""
    return " or ".join(f"{ID_PREFIX}{door_id}" for door_id in doors)
