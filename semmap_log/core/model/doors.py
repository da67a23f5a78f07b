"""The plain nouns: doors, other objects, and the map of them. Values only, no I/O.

Lengths are metres, angles radians, both in the frame `map`; times are integer nanoseconds since
the Unix epoch, UTC. A probability is in [0, 1]; NaN means that it was not given.

Values that show themselves in a notebook; a room above draws them.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import count
from types import MappingProxyType
from typing import Final, NewType

from semmap_log.core.late_answers import answer_of
from semmap_log.core.model.object_classes import (
    DOOR,
    OUTLINE,
    Corners,
    Geometry,
    ObjectClass,
    outline_told,
)
from semmap_log.core.model.object_classes import THESIS_STATES as THESIS_STATES  # noqa: PLC0414 - handed on
from semmap_log.core.model.object_classes import DoorState as DoorState  # noqa: PLC0414 - handed on
from semmap_log.core.model.object_classes import reduced as reduced  # noqa: PLC0414 - handed on
from semmap_log.core.model.object_classes import thesis_state as thesis_state  # noqa: PLC0414 - handed on
from semmap_log.core.texts import counted


class ShownAsTable:
    """A value that a notebook shows as a table."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        html: str = answer_of("html")(self)
        return html


DoorId = NewType("DoorId", int)
"""Given from 1 on, never used twice in a log, at most `MAX_DOOR_ID`.

0 is given to nobody, but kept where a thesis's file or server counts from there.
"""

MAX_DOOR_ID = 2**32 - 1
MAX_LEVEL = 65_000
"""A level's floor map travels on MCAP channel 100 + level, which is a uint16."""

NO_LEVEL = 2**16 - 1
"""Stands in a column of levels, a uint16, for one that was not given: `LEVEL_NOT_GIVEN`."""

NAN = math.nan


class _LevelNotGiven(int):
    """Level 0, and a mark by which a level that nobody gave is known."""


LEVEL_NOT_GIVEN: Final[int] = _LevelNotGiven(0)
"""Stands for the level of an event on its way into a log: `levels` says which one is meant."""


def is_given(level: int) -> bool:
    """Tell whether a level was given, be it 0."""
    return not isinstance(level, _LevelNotGiven)


def next_door_id(used: Container[int], greatest: int) -> DoorId:
    """Return the id for a new door: the one after the greatest, while there is one.

    Behind the last there is none: then the lowest from 1 on that was never given.

    Args:
        used: Every id that was ever given, or is to stay free.
        greatest: Of those that were given; 0: none was.
    """
    following = next(door_id for door_id in count(greatest + 1) if door_id not in used)
    if following > MAX_DOOR_ID:
        following = next(door_id for door_id in count(1) if door_id not in used)
    return DoorId(following)


@dataclass(frozen=True, slots=True)
class Pose2D:
    """Where a door's line starts (x, y) and where it points (theta), on a level of the building."""

    x: float
    y: float
    theta: float
    level: int = 0


@dataclass(frozen=True, slots=True)
class Door:
    """A door, or another object, as known at some moment; its line goes from `start` to `end`."""

    door_id: DoorId
    level: int
    x: float
    """NaN, together with y, theta and width, for an unplaced door: it is drawn nowhere."""
    y: float
    theta: float
    width: float
    state: DoorState
    prob_open: float
    prob_closed: float
    last_seen_ns: int | None = None
    """When its latest state happened."""
    last_event: int | None = None
    """The number of the last event about it."""
    annotations: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    object_class: ObjectClass = field(default=DOOR, repr=False)
    """What it is."""

    @property
    def name(self) -> str | None:
        """Its annotation `name`, if it has one."""
        return self.annotations.get("name")

    @property
    def label(self) -> str:
        """What a person calls it: its name, else its number."""
        return self.name or f"{self.object_class.name} {self.door_id}"

    @property
    def state_word(self) -> str:
        """What its state is called: `OPEN`; of a dock that is `free`, so."""
        return self.object_class.word(self.state)

    @property
    def is_placed(self) -> bool:
        """False for a sensor without geometry: it has history and belief and is drawn nowhere."""
        return not math.isnan(self.x)

    @property
    def pose(self) -> Pose2D:
        """Start and direction of its line."""
        return Pose2D(self.x, self.y, self.theta, self.level)

    @property
    def start(self) -> tuple[float, float]:
        """First end of its line (x, y), metres, frame `map`."""
        return self.x, self.y

    @property
    def end(self) -> tuple[float, float]:
        """Other end of its line (x, y), metres, frame `map`; what is no line ends where it is."""
        if self.object_class.geometry is not Geometry.SEGMENT:
            return self.start
        return (
            self.x + self.width * math.cos(self.theta),
            self.y + self.width * math.sin(self.theta),
        )

    @property
    def extent(self) -> Corners:
        """Points between which all of it lies: the corners of its outline, or its line's ends."""
        return self.outline or (self.start, self.end)

    @property
    def outline(self) -> Corners:
        """The corners of a polygon, metres, frame `map`; empty for what has none."""
        told = self.annotations.get(OUTLINE)
        if told is None or self.object_class.geometry is not Geometry.POLYGON:
            return ()
        try:
            corners = outline_told(told)
        except ValueError:
            return ()
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        return tuple((self.x + cos * x - sin * y, self.y + sin * x + cos * y) for x, y in corners)


def door_called(name: str, doors: Iterable[tuple[Door, Container[str | None]]]) -> Door:
    """Return the one door that is called so.

    Raises:
        KeyError: There is none, or several are.
    """
    named = [door for door, called in doors if name in called]
    if len(named) == 1:
        return named[0]
    ids = ", ".join(str(door.door_id) for door in named)
    raise KeyError(f"expected the name of one door, got {name!r}: {ids or 'none'}")


@dataclass(frozen=True, slots=True)
class RemovedDoor:
    """A door that was removed, as it would be had it not been."""

    door: Door
    event: int
    """The number of its removal: with that taken back, the door is in the map again."""


@dataclass(frozen=True, slots=True)
class Level:
    """A storey of the building."""

    level: int
    name: str | None = None
    elevation: float = NAN
    floor_map_event: int | None = None
    """The number of the event that carries its floor plan."""


@dataclass(frozen=True, slots=True, repr=False)
class DoorMap(ShownAsTable):
    """The door database at a moment: what a replay gives."""

    doors: Mapping[DoorId, Door]
    """Doors in the map then, ids ascending."""
    levels: Mapping[int, Level]
    """Levels known then, numbers ascending."""
    event: int = -1
    """The greatest event number taken into account; -1 before the first event."""
    latest_ns: int = 0
    """The latest happened time taken into account."""
    at_ns: int | None = None
    """Only what had happened by then counts; None: everything."""
    known_at_ns: int | None = None
    """Only what had been recorded by then counts; None: everything."""
    classes: Mapping[str, ObjectClass] = field(default_factory=lambda: MappingProxyType({}))
    """Classes of objects defined then, names ascending; doors, which need none, are not among
    them."""

    def __repr__(self) -> str:
        return f"<DoorMap of {counted(len(self), 'door')}, up to event {self.event}>"

    def __len__(self) -> int:
        return len(self.doors)

    def __getitem__(self, door: DoorId | str) -> Door:
        """Return the door of an id, a name or level/name.

        Raises:
            KeyError: There is none, or several have the name.
        """
        if not isinstance(door, str):
            return self.doors[door]
        return door_called(
            door,
            (
                (each, (each.name, f"{self.level_name(each.level)}/{each.name}"))
                for each in self.doors.values()
            ),
        )

    @property
    def moment_ns(self) -> int:
        """The moment that it is of: as asked for, else the latest in it."""
        asked = self.at_ns if self.at_ns is not None else self.known_at_ns
        return self.latest_ns if asked is None else asked

    def level_name(self, level: int) -> str:
        """Return the level's name, or its number as text where it has none."""
        known = self.levels.get(level)
        return (known.name if known else None) or str(level)


WIDEST_DOOR_M = 25.0
"""Gates of hangars are wider, and are asked about; nothing is refused."""
WIDEST_CELL_M = 1.0


def suspect_units(*, theta: float, width: float) -> list[str]:
    """Return what looks like another unit about a door's values, in words; NaN: not given."""
    return suspect_angle("theta", theta) + [
        f"width {width:g} m is more than a gate's: millimetres, or centimetres?"
    ] * (width > WIDEST_DOOR_M)


def suspect_cells(*, resolution: float, theta: float) -> list[str]:
    """Return the same about a floor plan: the size of its cells and the yaw of its origin."""
    return suspect_angle("its origin's yaw", theta) + [
        f"cells of {resolution:g} m are larger than doors: millimetres, or centimetres?"
    ] * (resolution > WIDEST_CELL_M)


def suspect_angle(what: str, angle: float) -> list[str]:
    """Return that an angle is more than a turn, if it is."""
    is_more = abs(angle) > math.tau + 1e-6
    return [f"{what} {angle:g} rad is more than a turn: degrees?"] * is_more
