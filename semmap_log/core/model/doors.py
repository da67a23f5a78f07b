"""The plain nouns: doors, other objects, and the map of them. Values only, no I/O.

Lengths are metres, angles radians, both in the frame `map`; times are integer nanoseconds since
the Unix epoch, UTC. A probability is in [0, 1]; NaN means that it was not given. Values can show
themselves in a notebook; an upper package draws them.

A log can also be about objects other than doors: docks, lifts, gates, fire shutters, spill zones. A
class states what its objects look like on the floor, what their states are called, and which of
these block a robot's way; a ClassDefined records it. (The thesis, chapter 5: "an Object
super-class, offering important methods like the Costmap draw function".)

An object has the life of a door: it is added, seen, set, moved, removed, and believed to be in a
state. Its annotation `class` names its class and, for a polygon, `outline` its corners. An object
without such an annotation, or with one that names no class, is a door.

Also the states of a door, and their names in the thesis's formats.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from itertools import count
from types import MappingProxyType
from typing import Final, NewType, TypeAlias

from semmap_log.core.late_answers import answer_of
from semmap_log.core.texts import counted


class DoorState(IntEnum):
    """What a door is known to be; 5..255 are reserved."""

    UNKNOWN = 0
    OPEN = 1
    CLOSED = 2
    MOVING = 3
    OFFLINE = 4

    def __str__(self) -> str:
        return self.name

    @classmethod
    def parse(cls, text: str) -> DoorState:
        """Return the state of that name, in any case of letters.

        Raises:
            ValueError: The text is not one of the five names.
        """
        try:
            return cls[text.strip().upper()]
        except KeyError:
            names = " ".join(state.name for state in cls)
            raise ValueError(f"expected one of {names}, got {text!r}") from None

    @classmethod
    def of(cls, number: int) -> DoorState:
        """Return the state of that number; one that only a later version knows is UNKNOWN."""
        return cls._value2member_map_.get(number, cls.UNKNOWN)  # type: ignore[return-value]

    @property
    def is_known(self) -> bool:
        """True for OPEN and CLOSED: the states that a map, a YAML or a belief can use."""
        return self in (DoorState.OPEN, DoorState.CLOSED)


THESIS_STATES = {state.name: state for state in (DoorState.OPEN, DoorState.CLOSED,
                                                 DoorState.UNKNOWN)}  # fmt: skip
"""The states that the thesis's formats know: its YAML, its DoorMap, the goals of its actions."""


def thesis_state(text: str) -> DoorState | None:
    """Return the state of that name, in any case of letters; None: the thesis knows none such.

    Its server takes such a text for UNKNOWN (4.2.2).
    """
    return THESIS_STATES.get(text.strip().upper())


def reduced(state: DoorState) -> DoorState:
    """Return the state as the thesis's formats know it: all but OPEN and CLOSED are UNKNOWN."""
    return state if state.is_known else DoorState.UNKNOWN


CLASS = "class"
"""The key of the annotation that says of which class an object is."""
OUTLINE = "outline"
"""The key of the annotation that says where the corners of a polygon lie."""
LEAST_CORNERS, MOST_CORNERS = 3, 1_000
MOST_SHOWN = 60
"""So many characters of a wrong outline a message shows."""

Corners: TypeAlias = tuple[tuple[float, float], ...]
"""(x, y) of each corner, metres, the last joined to the first; empty: there is no outline."""

WORDED = (DoorState.OPEN, DoorState.CLOSED, DoorState.MOVING)
"""The states for which a class has words, in the order in which it shows them."""


class Geometry(str, Enum):
    """What an object covers of the floor."""

    SEGMENT = "segment"
    """The line from its place, as long as it is wide: as a door."""
    POLYGON = "polygon"
    """All within its outline."""
    POINT = "point"
    """Its place."""


@dataclass(frozen=True, slots=True)
class ObjectClass:
    """A class of objects."""

    name: str
    geometry: Geometry
    words: tuple[str, ...]
    """What OPEN, CLOSED and, if there are three, MOVING are called."""
    blocks: frozenset[DoorState]
    """In these states an object blocks a robot's way."""

    @classmethod
    def told(cls, name: str, geometry: str, states: str, blocks: str) -> ObjectClass:
        """Return the class that a ClassDefined with these values defines."""
        words = split_words(states)
        blocking = {word.upper() for word in split_words(blocks)}
        state_of = zip(words, WORDED, strict=False)
        blocked = frozenset(state for word, state in state_of if word.upper() in blocking)
        return cls(name, Geometry(geometry), words, blocked)

    def __str__(self) -> str:
        blocks = ",".join(self.word(state) for state in sorted(self.blocks)) or "nothing"
        return f"{self.name} ({self.geometry.value}; {','.join(self.words)}; {blocks} blocks)"

    @property
    def is_door(self) -> bool:
        """Whether its objects are doors, which need no class."""
        return self.name == DOOR.name

    def word(self, state: DoorState) -> str:
        """Return what a state is called: UNKNOWN and OFFLINE are so in every class."""
        at = _PLACE.get(state, len(self.words))
        return self.words[at] if at < len(self.words) else state.name

    def state(self, text: str) -> DoorState:
        """Return the state of that word, or of that name, in any case of letters.

        Raises:
            ValueError: The class has no such state.
        """
        known = {self.word(state).upper(): state for state in DoorState if self.has(state)}
        known |= {state.name: state for state in DoorState if self.has(state)}
        try:
            return known[text.strip().upper()]
        except KeyError:
            raise ValueError(f"expected one of {self.state_words}, got {text!r}") from None

    @property
    def state_words(self) -> str:
        """What all states are called that its objects can be in, with blanks between."""
        return " ".join(self.word(state) for state in DoorState if self.has(state))

    def has(self, state: DoorState) -> bool:
        """Return whether its objects can be in a state."""
        return _PLACE.get(state, 0) < len(self.words)


_PLACE = {state: place for place, state in enumerate(WORDED)}

DOOR = ObjectClass(
    "door", Geometry.SEGMENT, tuple(s.name for s in WORDED), frozenset([DoorState.CLOSED])
)
"""What every log knows, and no ClassDefined can change."""


def middle_of(corners: Corners) -> tuple[float, float]:
    """Return the middle of the least box around some corners."""
    across, down = zip(*corners, strict=True)
    return (min(across) + max(across)) / 2, (min(down) + max(down)) / 2


def split_words(text: str) -> tuple[str, ...]:
    """Return words with commas between, without the blanks around them; of no text, none."""
    return tuple(word.strip() for word in text.split(",")) if text.strip() else ()


def class_name_expected(name: str) -> str:
    """Return what is expected instead of a text that cannot be a class's name; "": it can."""
    is_good = bool(name) and name == name.strip() and not set(name) & set(",/")
    if is_good and name.lower() != DOOR.name:
        return ""
    return f"the name of a class, such as dock: no {DOOR.name}, and without , and /"


def geometry_expected(name: str) -> str:
    """Return what is expected instead of a text that is no geometry; "": it is one."""
    names = [each.value for each in Geometry]
    return "" if name in names else f"one of {' '.join(names)}"


def states_expected(text: str) -> str:
    """Return what is expected instead of words that cannot be those of states; "": they can.

    A word that is a state's name means that state.
    """
    words = [word.upper() for word in split_words(text)]
    is_good = len(words) in (2, 3) and all(words) and len({*words}) == len(words)
    names = {state.name for state in DoorState}
    for word, state in zip(words, WORDED, strict=False):
        is_good &= word == state.name or word not in names
    if is_good:
        return ""
    return (
        "two or three different words with a comma between, for OPEN, CLOSED and MOVING, such as "
        "free,taken"
    )


def blocks_others(states: str, blocks: str) -> bool:
    """Return whether a class would block in a state that it has no word for."""
    known = {word.upper() for word in split_words(states)}
    return not {word.upper() for word in split_words(blocks)} <= known


def outline_text(corners: Sequence[tuple[float, float]]) -> str:
    """Return the annotation of an outline: `0,0 2,0 2,1.5`, metres, in the object's own frame."""
    return " ".join(f"{x!r},{y!r}".replace(".0,", ",").removesuffix(".0") for x, y in corners)


def parse_outline(text: str) -> Corners:
    """Return the corners that such an annotation states.

    Raises:
        ValueError: It states none.
    """
    try:
        corners = tuple(tuple(map(float, pair.split(","))) for pair in text.split())
    except ValueError:
        corners = ()
    if not LEAST_CORNERS <= len(corners) <= MOST_CORNERS or not all(
        len(corner) == 2 and all(map(math.isfinite, corner)) for corner in corners
    ):
        shown = text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]} …"
        raise ValueError(
            f"expected {LEAST_CORNERS} to {MOST_CORNERS} corners, X,Y in metres with blanks "
            f"between, got {shown!r}"
        )
    return corners  # type: ignore[return-value]


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
    """Return whether a level was given, even 0."""
    return not isinstance(level, _LevelNotGiven)


def next_door_id(used: Container[int], greatest: int) -> DoorId:
    """Return the id for a new door: one more than the greatest, while that is possible.

    After the greatest possible id it is the lowest, from 1 on, that was never given.

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
            corners = parse_outline(told)
        except ValueError:
            return ()
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        return tuple((self.x + cos * x - sin * y, self.y + sin * x + cos * y) for x, y in corners)


def door_called(name: str, doors: Iterable[tuple[Door, Container[str | None]]]) -> Door:
    """Return the one door that is called so.

    Raises:
        KeyError: No such one exists, or several do.
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
            KeyError: None has the name, or several have.
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
        """The moment of the map: the requested one, else the latest in it."""
        asked = self.at_ns if self.at_ns is not None else self.known_at_ns
        return self.latest_ns if asked is None else asked

    def level_name(self, level: int) -> str:
        """Return the level's name, or its number as text where it has none."""
        known = self.levels.get(level)
        return (known.name if known else None) or str(level)


WIDEST_DOOR_M = 25.0
"""Wider doors, such as gates of hangars, cause a warning; nothing is refused."""
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
