"""What commands say of objects that are no doors: their class, their place, their states."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from semmap_log.core.model.door_states import DoorState
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import ClassDefined
from semmap_log.core.model.object_classes import (
    CLASS,
    DOOR,
    LEAST_CORNERS,
    OUTLINE,
    Corners,
    Geometry,
    ObjectClass,
    outline_text,
    outline_told,
)
from semmap_log.errors import CommandError, InvalidEventError
from semmap_log.log.door_log.current_map import CurrentMap

DIGITS = 9
"""Of the corners of an outline that is stored: nanometres."""


@dataclass(frozen=True, slots=True)
class NewPlace:
    """Where an object is: start, direction and length of its line; NaN: it is unplaced."""

    x: float
    y: float
    theta: float
    width: float

    def of(self, kind: ObjectClass, outline: Corners) -> tuple[NewPlace, str]:
        """Return where an object of a class is, and the annotation of its outline; "": it has none.

        Args:
            kind: Its class. A point and a polygon have no width, and need no direction.
            outline: The corners of a polygon, metres, frame `map`. Where no place is given, the
                first is its place.

        Raises:
            CommandError: A polygon without an outline, or one for what is no polygon.
        """
        if kind.geometry is not Geometry.POLYGON and outline:
            raise CommandError(f"an outline is for polygons; a {kind.name} is a "
                               f"{kind.geometry.value}.")  # fmt: skip
        if kind.geometry is Geometry.SEGMENT:
            return self, ""
        if kind.geometry is Geometry.POLYGON and len(outline) < LEAST_CORNERS:
            raise CommandError(
                f"a {kind.name} is a polygon: expected an outline of at least {LEAST_CORNERS} "
                f"corners, got {len(outline)}."
            )
        if outline:
            check_outline(outline_text(outline))
        x, y = (self.x, self.y) if outline == () or not math.isnan(self.x) else outline[0]
        if math.isnan(x):
            return self, ""
        place = NewPlace(x, y, 0.0 if math.isnan(self.theta) else self.theta, 0.0)
        return place, outline_text([place.seen(corner) for corner in outline])

    def seen(self, point: tuple[float, float]) -> tuple[float, float]:
        """Return a point of the frame `map` in the object's own frame, metres."""
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        x, y = point[0] - self.x, point[1] - self.y
        return round(cos * x + sin * y, DIGITS) + 0.0, round(cos * y - sin * x, DIGITS) + 0.0


def class_meant(name: str, now: CurrentMap) -> ObjectClass:
    """Return the class of that name; "" and `door`: that of doors.

    Raises:
        CommandError: None is defined that is called so.
    """
    known = now.door_index.classes
    if name in ("", DOOR.name):
        return DOOR
    if name not in known:
        defined = f"defined are: {', '.join(sorted(known))}" if known else "none is defined"
        raise CommandError(f"no class {name!r}; {defined}. `define` defines one.")
    return known[name]


def state_meant(state: DoorState | str, of: ObjectClass) -> DoorState:
    """Return the state that somebody means who speaks of an object of a class.

    Args:
        state: A state, or the class's word for it, or its name, in any case of letters.
        of: The class.

    Raises:
        InvalidEventError: The class has no such state.
    """
    if isinstance(state, DoorState) and (of is DOOR or of.has(state)):
        return state
    try:
        return of.state(state if isinstance(state, str) else state.name)
    except ValueError:
        got = state if isinstance(state, str) else state.name
        raise InvalidEventError("state", f"one of {of.words_told}", got) from None


def class_of(door_id: DoorId, now: CurrentMap) -> ObjectClass:
    """Return what an object is; of what is not in the map: a door."""
    known = now.state.door(door_id) if now.door_index.classes else None
    return known.object_class if known else DOOR


def defined_by_then(
    kind: ObjectClass, happened_ns: int | None, now: CurrentMap
) -> Iterator[ClassDefined]:
    """Yield the definition of a class once more where an object is of it before that was told."""
    defined = None if kind.is_door else now.state.defined(kind.name)
    if happened_ns is not None and defined is not None and happened_ns < defined[0]:
        yield ClassDefined.of(kind, happened_ns)


def check_annotation(key: str, value: str, now: CurrentMap) -> None:
    """Return if something that makes an object what it is may be said so.

    Raises:
        CommandError: No class is called so, though there are others; or it is no outline.
    """
    if key == CLASS and value and now.door_index.classes:
        class_meant(value, now)
    if key == OUTLINE and value and now.door_index.classes:
        check_outline(value)


def check_outline(text: str) -> None:
    """Return if an annotation tells an outline.

    Raises:
        CommandError: It tells none.
    """
    try:
        outline_told(text)
    except ValueError as error:
        raise CommandError(f"outline: {error}") from None
