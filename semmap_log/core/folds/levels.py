"""Which level is meant where something is put on one, or asked of one: the one rule for it.

The levels of a log are those that have a name, a floor map, or a door with a place. Where a level
is told, by its name or its number, that one is meant. A text of digits is a name first, with a
warning where another level has that number; `number:2` is the number. Where none is told,

- the only level is meant, if the log has one;
- it is an error that names them, if the log has several;
- level 0 is meant, if the log has none: that of a log without levels.

A robot's poses and doors without a place make no level. Events take what the log holds when they
are appended, the events before them in the same commit included.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping

from semmap_log.core.folds.doors_present import DoorsPresent
from semmap_log.core.model.doors import DoorMap, Level
from semmap_log.errors import LevelNameWarning, UnknownLevelError

NUMBER_PREFIX = "number:"

OPTION = '--level L on the command line, level=L in Python, "level": L in a JSON line'
"""How a level is told."""


def levels_of(door_map: DoorMap) -> dict[int, Level]:
    """Return the levels of a map, numbers ascending: see `level_numbers`."""
    numbers = level_numbers(door_map.levels, placed_levels(door_map))
    return {number: door_map.levels.get(number) or Level(number) for number in numbers}


def level_numbers(known: Iterable[int], placed: Iterable[int]) -> list[int]:
    """Return the levels that there are, ascending.

    Args:
        known: Those that have a name or a floor map.
        placed: Those that have a door with a place.
    """
    return sorted({*known, *placed})


def placed_levels(door_map: DoorMap) -> set[int]:
    """Return the levels that have a door with a place."""
    if isinstance(door_map.doors, DoorsPresent):
        return door_map.doors.placed_levels()
    return {door.level for door in door_map.doors.values() if door.is_placed}


def only_level(names: Mapping[int, str | None]) -> int:
    """Return the level that is meant where none is told.

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


def resolve_level(text: str | int | None, door_map: DoorMap) -> int:
    """Return the level that a person means: by its name, else by its number.

    Args:
        text: None: as the rule says.
        door_map: The map as it is.

    Raises:
        UnknownLevelError: No such level, or several and none was told.
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


def level_shown(door_map: DoorMap) -> int:
    """Return the level that a picture shows where none is told: of several the one with doors.

    Raises:
        UnknownLevelError: Several have doors with a place, or none of several.
    """
    placed = placed_levels(door_map)
    return placed.pop() if len(placed) == 1 else resolve_level(None, door_map)


def told(names: Mapping[int, str | None]) -> str:
    """Return levels in words: `1 (L1), 2 (L2)`."""
    return ", ".join(f"{n} ({name})" if name else str(n) for n, name in names.items())
