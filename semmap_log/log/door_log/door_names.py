"""Which door a person means by what it is called."""

from __future__ import annotations

from semmap_log.core.model.doors import MAX_DOOR_ID, DoorId, DoorMap
from semmap_log.core.model.events import is_whole_number
from semmap_log.errors import InvalidEventError, UnknownDoorError
from semmap_log.log.door_log.removed_doors import ID_PREFIX, told_absent, which_id

MOST_ID_DIGITS = len(str(MAX_DOOR_ID))


def _is_door_id(text: str) -> bool:
    """Tell whether a text can be a door's id."""
    return text.isdecimal() and len(text) <= MOST_ID_DIGITS


def resolve_door(text: str | int, door_map: DoorMap) -> DoorId:
    """Return the door that a person means by an id, `id:7`, a name, or level/name.

    A text of digits can be a name, too; `id:7` is the id, whatever doors are called.

    Raises:
        UnknownDoorError: None, or more than one.
        InvalidEventError: It is neither a text nor a whole number.
    """
    if not (isinstance(text, str) or is_whole_number(text)):
        raise InvalidEventError("door", "an id, a name, or level/name", text)
    if isinstance(text, str) and text.startswith(ID_PREFIX):
        return _door_of_id(text, door_map)
    doors = [door for door in door_map.doors.values() if text in (door.door_id, door.name)]
    if not doors and isinstance(text, str) and "/" in text:
        doors = [
            door
            for door in door_map.doors.values()
            if door.name and f"{door_map.level_name(door.level)}/{door.name}" == text
        ]
    if isinstance(text, str) and _is_door_id(text):
        numbered = door_map.doors.get(DoorId(int(text)))
        doors += [numbered] if numbered and numbered not in doors else []
    if len(doors) == 1:
        return doors[0].door_id
    if doors:
        which = ", ".join(
            f"{door_map.level_name(door.level)}/{door.label} (id {door.door_id})" for door in doors
        )
        ids = which_id([door.door_id for door in doors])
        raise UnknownDoorError(
            f"{text!r} can mean {len(doors)} doors: {which}; say which by {ids}."
        )
    if not isinstance(text, str) or _is_door_id(text):
        raise UnknownDoorError(told_absent(int(text)))
    raise UnknownDoorError(f"no door is called {text!r}.{_similar(str(text), door_map)}")


def _door_of_id(text: str, door_map: DoorMap) -> DoorId:
    digits = text.removeprefix(ID_PREFIX)
    if not _is_door_id(digits):
        raise UnknownDoorError(f"{text!r}: expected a door's id, such as {ID_PREFIX}7.")
    if int(digits) not in door_map.doors:
        raise UnknownDoorError(told_absent(int(digits)))
    return DoorId(int(digits))


def _similar(text: str, door_map: DoorMap) -> str:
    from difflib import get_close_matches

    names = sorted({door.name for door in door_map.doors.values() if door.name})
    close = get_close_matches(text, names, n=3)
    return f" Did you mean {' or '.join(close)}?" if close else ""
