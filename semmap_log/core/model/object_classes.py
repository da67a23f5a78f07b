"""What else than doors a log can be about: docks, lifts, gates, fire shutters, spill zones.

A class says what its objects look like on the floor, what their states are called, and which of
these block a robot's way; the log tells it by a ClassDefined. (The thesis, chapter 5: "an Object
super-class, offering important methods like the Costmap draw function".)

An object has the life of a door: it is added, seen, set, moved, removed, and believed to be in a
state. Its annotation `class` says of which class it is, and for a polygon `outline` where its
corners lie. What has no such annotation, or one that no class is called by, is a door.

The states of a door, and what the thesis's formats know of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import TypeAlias


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
            ValueError: The text is none of the five names.
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
"""The states for which a class has words, in the order in which it tells them."""


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
        """Return the class that a ClassDefined with these values tells."""
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
            raise ValueError(f"expected one of {self.words_told}, got {text!r}") from None

    @property
    def words_told(self) -> str:
        """What all states are called that its objects can be in, with blanks between."""
        return " ".join(self.word(state) for state in DoorState if self.has(state))

    def has(self, state: DoorState) -> bool:
        """Tell whether its objects can be in a state."""
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
    """Tell whether a class would block in a state that it has no word for."""
    known = {word.upper() for word in split_words(states)}
    return not {word.upper() for word in split_words(blocks)} <= known


def outline_text(corners: Sequence[tuple[float, float]]) -> str:
    """Return the annotation of an outline: `0,0 2,0 2,1.5`, metres, in the object's own frame."""
    return " ".join(f"{x!r},{y!r}".replace(".0,", ",").removesuffix(".0") for x, y in corners)


def outline_told(text: str) -> Corners:
    """Return the corners that such an annotation tells.

    Raises:
        ValueError: It tells none.
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
