"""Which level is meant where something is put on one, or a query names one: the one rule for it.

The levels of a log are those that have a name, a floor map, or a door with a place. Where a level
is given, by its name or its number, that one is meant. A text of digits is a name first, with a
warning where another level has that number; `number:2` is the number. Where none is given,

- the only level is meant, if the log has one;
- it is an error that names them, if the log has several;
- level 0 is meant, if the log has none: that of a log without levels.

A robot's poses and doors without a place make no level. Events use the levels that the log has when
they are appended, including those of earlier events in the same commit.

This module also holds the doors of a map as values, each made on request: of hundreds, one is
wanted; the objects of one class in a map, doors by default; and the annotations of doors: for each
door and key the text with the greatest stamp.
"""

from __future__ import annotations

import warnings
from collections.abc import ItemsView, Iterable, Iterator, Mapping, ValuesView
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import distinct
from semmap_log.core.model import doors
from semmap_log.core.model.events import ClassDefined
from semmap_log.core.model.meaning import FIELDS
from semmap_log.errors import CommandError, LevelNameWarning, LogError, UnknownLevelError

NUMBER_PREFIX = "number:"

OPTION = '--level L on the command line, level=L in Python, "level": L in a JSON line'
"""How a user gives a level."""


def levels_of(door_map: doors.DoorMap) -> dict[int, doors.Level]:
    """Return the levels of a map, numbers ascending: see `level_numbers`."""
    numbers = level_numbers(door_map.levels, placed_levels(door_map))
    return {number: door_map.levels.get(number) or doors.Level(number) for number in numbers}


def level_numbers(known: Iterable[int], placed: Iterable[int]) -> list[int]:
    """Return the levels that there are, ascending.

    Args:
        known: Those that have a name or a floor map.
        placed: Those that have a door with a place.
    """
    return sorted({*known, *placed})


def placed_levels(door_map: doors.DoorMap) -> set[int]:
    """Return the levels that have a door with a place."""
    if isinstance(door_map.doors, DoorsPresent):
        return door_map.doors.placed_levels()
    return {door.level for door in door_map.doors.values() if door.is_placed}


def only_level(names: Mapping[int, str | None]) -> int:
    """Return the level that is meant where none is given.

    Args:
        names: The levels that there are, by their numbers.

    Raises:
        UnknownLevelError: There are several.
    """
    if len(names) > 1:
        raise UnknownLevelError(
            f"the log has several levels: {told(names)}; say which one: {OPTION}."
        )
    return next(iter(names), 0)


def resolve_level(text: str | int | None, door_map: doors.DoorMap) -> int:
    """Return the level that a person means: by its name, else by its number.

    Args:
        text: None: as the rule says.
        door_map: The map as it is.

    Raises:
        UnknownLevelError: No such level, or several and none was given.
    """
    names = {number: level.name for number, level in levels_of(door_map).items()}
    return only_level(names) if text is None else level_called(text, names)


def level_called(text: str | int, names: Mapping[int, str | None]) -> int:
    """Return the level of that name, else of that number; a number that is no text is one.

    `number:2` is the number, whatever levels are called.

    Raises:
        UnknownLevelError: There is no such level, or several of the name.
    """
    if isinstance(text, str) and text.startswith(NUMBER_PREFIX):
        return _numbered(text, names)
    named = [number for number, name in names.items() if name and name == text]
    if len(named) > 1:
        raise UnknownLevelError(
            f"{text!r} is the name of {len(named)} levels: {told(names)}; say which by "
            f"{' or '.join(f'{NUMBER_PREFIX}{number}' for number in named)}."
        )
    numbered = [number for number in (*names, 0) if text in (number, str(number))]
    if not named and not numbered:
        raise UnknownLevelError(f"no level {text!r}; there are: {told(names) or '0'}.")
    if named and numbered[:1] and numbered[0] in names and numbered[0] != named[0]:
        warnings.warn(
            f"{text!r} is taken for the level of that name, {told({named[0]: names[named[0]]})}; "
            f"level {told({numbered[0]: names[numbered[0]]})} is {NUMBER_PREFIX}{text}",
            LevelNameWarning,
            stacklevel=2,
        )
    return (named or numbered)[0]


def _numbered(text: str, names: Mapping[int, str | None]) -> int:
    digits = text.removeprefix(NUMBER_PREFIX)
    found = [number for number in (*names, 0) if digits == str(number)]
    if not found:
        raise UnknownLevelError(f"no level {text!r}; there are: {told(names) or '0'}.")
    return found[0]


def level_shown(door_map: doors.DoorMap) -> int:
    """Return the level that a picture shows by default: of several, the one with doors.

    Raises:
        UnknownLevelError: Several have doors with a place, or none of several.
    """
    placed = placed_levels(door_map)
    return placed.pop() if len(placed) == 1 else resolve_level(None, door_map)


def told(names: Mapping[int, str | None]) -> str:
    """Return levels in words: `1 (L1), 2 (L2)`."""
    return ", ".join(f"{n} ({name})" if name else str(n) for n, name in names.items())


def of_class(door_map: doors.DoorMap, name: str) -> doors.DoorMap:
    """Return a map with the objects of one class only; `door` is that of all doors.

    Raises:
        CommandError: No class is called so.
    """
    check_class(door_map, name)
    if not door_map.classes:
        return door_map
    assert isinstance(door_map.doors, DoorsPresent), "a map that a log gave"
    return replace(door_map, doors=door_map.doors.of_class(name))


def check_class(door_map: doors.DoorMap, name: str) -> None:
    """Check that a class of that name exists.

    Raises:
        CommandError: It does not.
    """
    if name != doors.DOOR.name and name not in door_map.classes:
        known = ", ".join([doors.DOOR.name, *door_map.classes])
        raise CommandError(f"no class {name!r}; there are: {known}.")


def only_doors(door_map: doors.DoorMap) -> doors.DoorMap:
    """Return a map without what is no door: planners, and the thesis, know doors alone."""
    return of_class(door_map, doors.DOOR.name)


class DoorsPresent(Mapping[doors.DoorId, doors.Door]):
    """Door id -> door, ids ascending; does not change. A door's name can be looked up, too."""

    def __init__(self, columns: Mapping[str, NDArray[Any]], annotations: Annotations) -> None:
        """Take the doors up.

        Args:
            columns: The fields of the doors and their stamps, one row a door, ids ascending.
            annotations: Their annotations; must not change any more.
        """
        self._columns = columns
        self._annotations = annotations
        self.classes = annotations.classes()
        """The classes of objects that are defined, names ascending."""
        self._ids: list[int] = columns["door_id"].tolist()
        self._places = dict(zip(self._ids, range(len(self._ids)), strict=True))
        self._made: dict[doors.DoorId, doors.Door] = {}
        """Those that were requested, in that order."""
        self._everything: dict[doors.DoorId, doors.Door] | None = None
        """All of them, ids ascending, once all were requested."""

    def __getitem__(self, door_id: doors.DoorId | str) -> doors.Door:
        if isinstance(door_id, str):
            return doors.door_called(door_id, ((door, (door.name,)) for door in self.values()))
        door = self._made.get(door_id)
        if door is None:
            place = self._places[door_id]
            row = {name: column[place].item() for name, column in self._columns.items()}
            door = self._made[door_id] = self._door(row)
        return door

    def __iter__(self) -> Iterator[doors.DoorId]:
        return map(doors.DoorId, self._ids)

    def __len__(self) -> int:
        return len(self._ids)

    def __contains__(self, door_id: object) -> bool:
        return door_id in self._places

    def items(self) -> ItemsView[doors.DoorId, doors.Door]:
        """Return all doors with their ids."""
        return self._all().items()

    def values(self) -> ValuesView[doors.Door]:
        """Return all doors."""
        return self._all().values()

    def placed_levels(self) -> set[int]:
        """Return the levels of all doors that have a place; none of the doors is made for it."""
        is_placed = ~np.isnan(self._columns["x"])
        return set(distinct(self._columns["level"][is_placed]).tolist())

    def in_state(self, state: doors.DoorState) -> list[doors.DoorId]:
        """Return the doors in a state, ids ascending; none of them is made for it."""
        states = self._columns["state"]
        chosen = states == state
        if state is doors.DoorState.UNKNOWN:
            chosen |= states > max(doors.DoorState)  # what only a later version knows
        return [doors.DoorId(self._ids[place]) for place in np.flatnonzero(chosen).tolist()]

    def of_class(self, name: str) -> DoorsPresent:
        """Return those of a class only."""
        chosen = np.array([door.object_class.name == name for door in self.values()], np.bool_)
        columns = {field: column[chosen] for field, column in self._columns.items()}
        return DoorsPresent(columns, self._annotations)

    def names(self) -> dict[doors.DoorId, str]:
        """Return the name of each door that has one, ids ascending."""
        named = (i for i in self._annotations.names() if i in self._places)
        return {i: name for i in named if (name := self[i].name)}

    def others_than(self, before: DoorsPresent) -> tuple[list[doors.DoorId], list[doors.DoorId]]:
        """Return the doors that are new or not as they were, and those that are gone.

        What is the same costs next to nothing: the columns are compared, and no door is made.
        """
        mine, theirs = self._columns["door_id"], before._columns["door_id"]
        common, at, there = np.intersect1d(mine, theirs, assume_unique=True, return_indices=True)
        differs = np.zeros(len(common), np.bool_)
        for name, column in self._columns.items():
            now, then = column[at], before._columns[name][there]
            differs |= (now != then) & ~((now != now) & (then != then))  # noqa: PLR0124 - NaN
        said, old = self._said(), before._said()
        text_changed = {i for i in said.keys() | old if said.get(i) != old.get(i)}
        changed = {*common[differs].tolist(), *np.setdiff1d(mine, theirs).tolist(), *text_changed}
        gone = np.setdiff1d(theirs, mine).tolist()
        return (
            [doors.DoorId(i) for i in sorted(changed) if i in self._places],
            [doors.DoorId(i) for i in gone],
        )

    def _said(self) -> Mapping[doors.DoorId, object]:
        """Return a text for each: its name and, where there are classes, its class.

        Where there are none, no door is made for it.
        """
        if not self.classes:
            return self._annotations.names()
        return {i: (door.name, door.object_class, door.outline) for i, door in self.items()}

    def __repr__(self) -> str:
        return repr(self._all())

    def _all(self) -> dict[doors.DoorId, doors.Door]:
        if self._everything is None:
            names = list(self._columns)
            rows = zip(*(column.tolist() for column in self._columns.values()), strict=True)
            self._everything = {
                doors.DoorId(door_id): self._door(dict(zip(names, row, strict=True)))
                for door_id, row in zip(self._ids, rows, strict=True)
            }
        return self._everything

    def _door(self, row: dict[str, Any]) -> doors.Door:
        values = {name: row[name] for name in FIELDS}
        annotations = self._annotations.of(
            row["door_id"], (row["added_happened_ns"], row["added_event"])
        )
        return doors.Door(
            door_id=doors.DoorId(row["door_id"]),
            **values | {"state": doors.DoorState.of(row["state"])},
            last_seen_ns=row["state_happened_ns"],
            last_event=row["last_event"],
            annotations=annotations,
            object_class=self.classes.get(annotations.get(doors.CLASS, ""), doors.DOOR),
        )


NAME = "name"
"""The key of a door's name."""

_NO_DOOR = 0
_DEFINES = "\x01class:"
"""Classes are stored next to the annotations of door 0, under keys with this prefix, which nobody
types: also in keyframes, which have no other place for them."""

Stamp = tuple[int, int]
"""(happened time, event number)."""

_Said = dict[int, dict[str, tuple[Stamp, str]]]

_COLUMNS = ("door_id", "key", "value", "happened_ns", "event")


class Annotations:
    """Registers of texts; stored ones are unpacked on first access."""

    def __init__(self) -> None:
        self._said: _Said = {}
        self._stored: Mapping[str, Any] | None = None
        self._is_shared = False
        """Whether a snapshot holds the same dictionaries: they must not change any more."""

    def write(self, door_id: int, key: str, value: str, stamp: Stamp) -> None:
        """Set a text at a stamp, unless a later one is known."""
        if self._is_shared:
            self._said = {door: dict(texts) for door, texts in self._unpacked().items()}
            self._is_shared = False
        said = self._unpacked().setdefault(door_id, {})
        if key not in said or stamp > said[key][0]:
            said[key] = (stamp, value)

    def define(self, event: ClassDefined, stamp: Stamp) -> None:
        """Note what objects of a class are like."""
        texts = (event.geometry, event.states, event.blocks)
        told = "\n".join(text.replace("\n", " ") for text in texts)
        self.write(_NO_DOOR, _DEFINES + event.class_name, told, stamp)

    def classes(self) -> dict[str, doors.ObjectClass]:
        """Return the classes that were defined, names ascending."""
        if self._stored is not None and _NO_DOOR not in np.asarray(self._stored["door_id"]):
            return {}  # nothing is unpacked for it
        said = self._unpacked().get(_NO_DOOR, {})
        defined = {
            key.removeprefix(_DEFINES): text.split("\n", 2)
            for key, (_, text) in sorted(said.items())
            if key.startswith(_DEFINES)
        }
        return {name: doors.ObjectClass.told(name, *told) for name, told in defined.items()}

    def defined(self, name: str) -> Stamp | None:
        """Return when a class was defined last; None: never."""
        told = self.get(_NO_DOOR, _DEFINES + name)
        return None if told is None else told[0]

    def texts_under(self, key: str) -> dict[doors.DoorId, tuple[Stamp, str]]:
        """Return each door's text under a key, and its stamp; ids ascending."""
        said = sorted(self._unpacked().items())
        return {doors.DoorId(door_id): texts[key] for door_id, texts in said if key in texts}

    def forget(self, door_id: int, key: str, before: int) -> None:
        """Drop the text that events below a number set for a door under a key."""
        said = self._unpacked().get(door_id, {})
        if key in said and said[key][0][1] < before:
            del said[key]

    def get(self, door_id: int, key: str) -> tuple[Stamp, str] | None:
        """Return a text and its stamp; None: it was never written."""
        return self._unpacked().get(door_id, {}).get(key)

    def of(self, door_id: int, added: Stamp) -> Mapping[str, str]:
        """Return the texts set for a door since it was added, keys ascending."""
        said = self._unpacked().get(door_id, {})
        since = {key: value for key, (stamp, value) in sorted(said.items()) if stamp > added}
        if door_id == _NO_DOOR:
            since = {key: value for key, value in since.items() if not key.startswith(_DEFINES)}
        return MappingProxyType({key: value for key, value in since.items() if value})

    def names(self) -> dict[doors.DoorId, str]:
        """Return the latest name of every door that has one, ids ascending."""
        said = {
            doors.DoorId(door_id): texts.get(NAME) for door_id, texts in self._unpacked().items()
        }
        return {door_id: name[1] for door_id, name in sorted(said.items()) if name and name[1]}

    def events(self) -> list[int]:
        """Return the number of the event of each text."""
        return [stamp[1] for said in self._unpacked().values() for stamp, _ in said.values()]

    def snapshot(self) -> Annotations:
        """Return them as they are now, whatever is written later."""
        copy = Annotations()
        copy._said, copy._stored = self._said, self._stored
        self._is_shared = copy._is_shared = True
        return copy

    def to_arrays(self) -> dict[str, list[Any]]:
        """Return them as parallel lists, by door and key."""
        texts = [
            (door_id, key, value, *stamp)
            for door_id, said in sorted(self._unpacked().items())
            for key, (stamp, value) in sorted(said.items())
        ]
        return {f"annotation_{name}": [t[i] for t in texts] for i, name in enumerate(_COLUMNS)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> Annotations:
        """Return those that `to_arrays` gave; not unpacked before they are needed."""
        annotations = cls()
        annotations._stored = {name: arrays[f"annotation_{name}"] for name in _COLUMNS}
        return annotations

    def _unpacked(self) -> _Said:
        if self._stored is not None:
            try:
                self._said, self._stored = _unpack(self._stored), None
            except ValueError as error:
                raise LogError(f"A keyframe's texts are none: {error}; verify the log.") from None
        return self._said


def _unpack(stored: Mapping[str, Any]) -> _Said:
    columns = [list(stored["key"]), list(stored["value"])]
    columns += [np.asarray(stored[name]).tolist() for name in ("door_id", "happened_ns", "event")]
    said: _Said = {}
    for key, value, door_id, happened, event in zip(*columns, strict=True):
        said.setdefault(door_id, {})[key] = ((happened, event), value)
    return said
