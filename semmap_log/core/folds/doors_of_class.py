"""Of the objects in a map those of one class; doors, for those who know nothing else."""

from __future__ import annotations

from dataclasses import replace

from semmap_log.core.folds.doors_present import DoorsPresent
from semmap_log.core.model.doors import DoorMap
from semmap_log.core.model.object_classes import DOOR
from semmap_log.errors import CommandError


def of_class(door_map: DoorMap, name: str) -> DoorMap:
    """Return a map with the objects of one class only; `door` is that of all doors.

    Raises:
        CommandError: No class is called so.
    """
    check_class(door_map, name)
    if not door_map.classes:
        return door_map
    assert isinstance(door_map.doors, DoorsPresent), "a map that a log gave"
    return replace(door_map, doors=door_map.doors.of_class(name))


def check_class(door_map: DoorMap, name: str) -> None:
    """Return if a class is called so.

    Raises:
        CommandError: None is.
    """
    if name != DOOR.name and name not in door_map.classes:
        known = ", ".join([DOOR.name, *door_map.classes])
        raise CommandError(f"no class {name!r}; there are: {known}.")


def only_doors(door_map: DoorMap) -> DoorMap:
    """Return a map without what is no door: planners, and the thesis, know doors alone."""
    return of_class(door_map, DOOR.name)
