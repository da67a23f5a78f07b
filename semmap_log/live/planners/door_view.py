"""The doors of one moment, found by the words that planners have for them.

    DOOR_3          the door of id 3, whatever doors are called
    DOOR_main_door  the door that is called `main_door`; DOOR_ground/main_door, where several are
    "main door"     what the command line takes: a name, level/name, an id, or id:3

A name that several doors bear means none of them: it is told by which ids to say it.
"""

from __future__ import annotations

import re

from semmap_log.core.folds.doors_of_class import only_doors
from semmap_log.core.folds.doors_present import DoorsPresent
from semmap_log.core.model.doors import MAX_DOOR_ID, Door, DoorId, DoorMap, DoorState
from semmap_log.core.texts import counted
from semmap_log.errors import UnknownDoorError
from semmap_log.live.planners.asked import DOOR
from semmap_log.live.planners.question_lines import Atom
from semmap_log.log.door_log.door_names import resolve_door

_DOOR_ID = re.compile(r"(?:0|[1-9][0-9]{0,9})")


def atom_of(door_id: int) -> Atom:
    """Return how answers call a door: `DOOR_3`."""
    return Atom(f"{DOOR}{door_id}")


def atom_of_state(door: Door) -> Atom:
    """Return how answers call a door's state: `OPEN`."""
    return Atom(door.state.name)


class DoorView:
    """The doors of one moment; does not change."""

    def __init__(self, door_map: DoorMap) -> None:
        door_map = only_doors(door_map)
        assert isinstance(door_map.doors, DoorsPresent), "a map that a log gave"
        self.door_map = door_map
        self._doors = door_map.doors
        self._found: dict[str, Door] = {}
        self._names: dict[str, list[DoorId]] | None = None

    def door(self, word: str) -> Door:
        """Return the door that a word means.

        Raises:
            UnknownDoorError: None, or more than one.
        """
        found = self._found.get(word)
        if found is None:
            found = self._doors[self._id_of(word)]
            if word.startswith(DOOR):  # of others no end of spellings means one door: `003`
                self._found[word] = found
        return found

    def find(self, word: str) -> Door | None:
        """Return the door that a word means; None: none, or more than one."""
        try:
            return self.door(word)
        except UnknownDoorError:
            return None

    def ids(self, state: DoorState | None = None) -> list[DoorId]:
        """Return the doors in a state, ids ascending; None: in any."""
        return list(self._doors) if state is None else self._doors.in_state(state)

    def _id_of(self, word: str) -> DoorId:
        if not word.startswith(DOOR):
            return resolve_door(word, self.door_map)
        called = word.removeprefix(DOOR)
        if _DOOR_ID.fullmatch(called):
            door_id = DoorId(int(called))
            if door_id > MAX_DOOR_ID or door_id not in self._doors:
                raise UnknownDoorError(f"no door {word} is in the map.")
            return door_id
        found = self._called(called) or self._called(word)
        if found is None and "/" in called:
            return resolve_door(called, self.door_map)
        if found is None:
            raise UnknownDoorError(f"no door is called {called!r}.")
        return found

    def _called(self, name: str) -> DoorId | None:
        """Return the only door of a name; None: no door bears it.

        Raises:
            UnknownDoorError: Several do.
        """
        if self._names is None:
            names: dict[str, list[DoorId]] = {}
            for door_id, each in self._doors.names().items():
                names.setdefault(each, []).append(door_id)
            self._names = names
        ids = self._names.get(name, [])
        if len(ids) > 1:
            which = " or ".join(map(atom_of, ids))
            raise UnknownDoorError(
                f"{counted(len(ids), 'door')} are called {name!r}; say which by {which}."
            )
        return ids[0] if ids else None
