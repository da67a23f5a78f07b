"""Which door of a log is asked about: one that is there, or one that ever was."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

from semmap_log.core.batches.distinct import distinct
from semmap_log.core.folds.annotations import NAME
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.events import ADDING_KINDS, DoorAdded, DoorAnnotated, is_whole_number
from semmap_log.errors import UnknownDoorError
from semmap_log.log.door_log.door_names import resolve_door
from semmap_log.log.door_log.removed_doors import (
    ID_PREFIX,
    removed_called,
    several_removed,
    told_removed,
)
from semmap_log.log.replay.replay import Scope, replay
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window


def door_in(
    door: str | int, reader: LogReader, scope: Scope, door_map: DoorMap | None = None
) -> DoorId:
    """Return the door of that id, name, or level/name, as of a moment.

    Args:
        door: Id, name, or level/name.
        reader: Of the log.
        scope: The moment.
        door_map: The doors then, where they are known already.

    Raises:
        UnknownDoorError: None, more than one, or one that was removed by then.
    """
    state = None
    if door_map is None:
        state = replay(reader, scope)
        door_map = state.door_map()
    try:
        return resolve_door(door, door_map)
    except UnknownDoorError:
        state = replay(reader, scope) if state is None else state
        removed = removed_called(door, state)
        if not removed:
            raise
        raise UnknownDoorError(told_removed(removed, state)) from None


def door_ever(door: str | int, reader: LogReader) -> DoorId:
    """Return the door of that id, name, or level/name; one that was removed, or retracted, too.

    Raises:
        UnknownDoorError: There is none, and never was.
    """
    state = replay(reader, with_newer=True)
    try:
        return resolve_door(door, state.door_map())
    except UnknownDoorError:
        removed = removed_called(door, state)
        if len(removed) > 1:
            raise UnknownDoorError(several_removed(door, removed)) from None
        if removed:
            return removed[0]
        for ever in (state, _ever_said(reader)):
            names = ever.names()
            for door_id in map(DoorId, sorted(ever.used_door_ids)):
                called = (str(door_id), f"{ID_PREFIX}{door_id}", names.get(door_id))
                if str(door) in called and not state.is_present(door_id):
                    return door_id
        raise


def ids_ever(doors: Iterable[DoorId | str], reader: LogReader) -> list[DoorId]:
    """Return the ids of doors; a name is looked up, those of doors that are gone, too.

    Args:
        doors: Ids, names, or level/names; one alone, too.
        reader: Of the log.

    Raises:
        UnknownDoorError: No door has such a name, or ever had.
    """
    return [
        DoorId(int(door))
        if not isinstance(door, str) and is_whole_number(door)
        else door_ever(door, reader)
        for door in doors_listed(doors)
    ]


def doors_listed(doors: Iterable[DoorId | str] | DoorId | str) -> Iterable[DoorId | str]:
    """Return doors as a list of them; one alone, too."""
    one_alone = isinstance(doors, str) or is_whole_number(doors)
    return cast("Iterable[DoorId | str]", [doors] if one_alone else doors)


def _ever_said(reader: LogReader) -> DoorMapState:
    """Return all doors and names that ever were, as if nothing had been retracted."""
    state = DoorMapState()
    for batch in reader.batches(Window(kinds=bits_of_kinds([DoorAdded, DoorAnnotated]))):
        state.apply(batch)
    return state


def names_ever(reader: LogReader) -> dict[DoorId, set[str]]:
    """Return all names that each door ever had, whoever said so and took it back.

    A door that was neither added nor named, as in what was recovered of a log, is not among them.
    """
    found: dict[DoorId, set[str]] = {}
    for batch in reader.batches(Window(kinds=bits_of_kinds([*ADDING_KINDS, DoorAnnotated]))):
        for door_id in distinct(batch.door_ids()[batch.about_doors()]).tolist():
            found.setdefault(DoorId(door_id), set())
        for event in batch.objects.get(DoorAnnotated.kind, ()):
            if isinstance(event, DoorAnnotated) and event.key == NAME and event.value:
                found[event.door_id].add(event.value)
    return found
