"""What can happen to a door map, as frozen facts in the past tense, and many of them as columns.

An event says what happened and when (`happened_ns`). Its number and its recorded time are given
by the log. The names and the meaning of every field are those of the `.msg` texts in
`semmap_log/messages/msg`, which define the bytes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from semmap_log.domain.commits import check_text
from semmap_log.domain.doors import LEVEL_NOT_GIVEN, MAX_DOOR_ID, MAX_LEVEL, NAN, DoorId, DoorState
from semmap_log.domain.meaning import ALL_CHANGED, NO_EFFECT, PARTS, Effect, Presence
from semmap_log.domain.meaning import Changed as Changed  # noqa: PLC0414 - users look for it here
from semmap_log.errors import InvalidEventError
from semmap_log.io.clock import MAX_TIME_NS

__all__ = [
    "KINDS",
    "Changed",
    "DoorAdded",
    "DoorAnnotated",
    "DoorEvent",
    "DoorObserved",
    "DoorPassed",
    "DoorRemoved",
    "DoorRequested",
    "DoorUpdated",
    "Event",
    "FloorMap",
    "LevelAdded",
    "LogExported",
    "PatrolFinished",
    "PatrolStarted",
    "Retracted",
    "RobotPose",
    "UnknownEvent",
]

MAX_EVENT = 2**63 - 1
NO_LEVEL = 2**16 - 1
"""Stands in a column of levels, a uint16, for one that was not given: `LEVEL_NOT_GIVEN`."""


def is_whole_number(value: object) -> bool:
    """Tell whether a value is a whole number; a truth value is none, though Python counts it."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def is_number(value: object) -> bool:
    """Tell whether a value is a number, whole or not; a truth value is none."""
    return is_whole_number(value) or isinstance(value, (float, np.floating))


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened. The base of all kinds."""

    happened_ns: int | None = None
    """When it happened (nanoseconds, UTC); None: when the log records it."""

    kind: ClassVar[int]
    """Its number among `KINDS`, which is also its MCAP channel id: never changes."""
    numbers: ClassVar[tuple[str, ...]] = ()
    """Its fields that are numbers, whole or not."""

    effect: ClassVar[Effect] = NO_EFFECT
    """What it does to the door that it is about."""

    changes_nothing: ClassVar[bool] = False
    """Of a kind that was added to the format later: programs that do not know it may leave it out,
    since no answer about other events depends on it. `log.form` tells what that promises."""

    def __post_init__(self) -> None:
        if self.happened_ns is not None:
            self._whole("happened_ns", self.happened_ns, 0, MAX_TIME_NS)
        for name in self.numbers:
            value = getattr(self, name)
            if type(value) is not float and not is_number(value):
                self._refuse(name, "a number", value)
        self._check()

    def sets(self) -> Changed:
        """Return the parts of its door that it sets."""
        effect = self.effect
        if effect.only_if and not getattr(self, effect.only_if):
            return Changed(0)
        return self.changed if effect.says_what else effect.sets  # type: ignore[attr-defined]

    def values_set(self) -> dict[str, Any]:
        """Return what it sets: fields of its door and their values."""
        known = self.effect.values
        sets = self.sets()
        names = (name for part in PARTS if part & sets for name in PARTS[part])
        return {name: known[name] if name in known else getattr(self, name) for name in names}

    def _check(self) -> None:
        """Raise InvalidEventError where a value is one that no door can have."""

    def _refuse(self, name: str, expected: str, got: object) -> None:
        raise InvalidEventError(f"{type(self).__name__}.{name}", expected, got)

    def _whole(self, name: str, value: int, low: int, high: int) -> None:
        if not is_whole_number(value) or not low <= value <= high:
            self._refuse(name, f"a whole number from {low} to {high}", value)

    def _finite(self, **values: float) -> None:
        for name, value in values.items():
            if not math.isfinite(value):
                self._refuse(name, "a finite number", value)

    def _at_least_0(self, name: str, value: float, unit: str) -> None:
        if not (math.isfinite(value) and value >= 0):
            self._refuse(name, f"a finite number of {unit}, 0 or more", value)

    def _state(self, state: DoorState) -> None:
        if not isinstance(state, DoorState):
            self._refuse("state", f"one of {' '.join(DoorState.__members__)}", state)

    def _share(self, low: float, **values: float) -> None:
        for name, value in values.items():
            if not (math.isnan(value) or low <= value <= 1):
                self._refuse(name, f"a number from {low:g} to 1", value)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorEvent(Event):
    """An event about one door."""

    door_id: DoorId

    def _check(self) -> None:
        self._whole("door_id", self.door_id, 0, MAX_DOOR_ID)


def _check_place(event: DoorAdded | DoorUpdated) -> None:
    """A pose is finite, or all of it is NaN (an unplaced door)."""
    event._whole("level", event.level, 0, MAX_LEVEL)
    place = (event.x, event.y, event.theta)
    if not all(math.isnan(value) for value in place):
        event._finite(x=event.x, y=event.y, theta=event.theta)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorAdded(DoorEvent):
    """A door came into the map (thesis: AddDoor). x, y, theta and width NaN: an unplaced door."""

    effect = Effect(sets=ALL_CHANGED, presence=Presence.COMES)

    level: int = LEVEL_NOT_GIVEN
    """Not given: the log's only one; see `levels`."""
    x: float = NAN
    y: float = NAN
    theta: float = NAN
    width: float = NAN
    state: DoorState = DoorState.UNKNOWN
    prob_open: float = NAN
    prob_closed: float = NAN

    def _check(self) -> None:
        DoorEvent._check(self)
        _check_place(self)
        if math.isnan(self.x) != math.isnan(self.width):
            self._refuse(
                "width", "a width where there is a pose, and none where there is none", self.width
            )
        if not math.isnan(self.width):
            self._at_least_0("width", self.width, "metres")
        self._state(self.state)
        self._share(0, prob_open=self.prob_open, prob_closed=self.prob_closed)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorUpdated(DoorEvent):
    """Some fields of a door were set (thesis: UpdateDoor); those not in `changed` mean nothing."""

    effect = Effect(says_what=True)

    changed: Changed
    level: int = LEVEL_NOT_GIVEN
    """Not given: the one that the door is on."""
    x: float = NAN
    y: float = NAN
    theta: float = NAN
    width: float = NAN
    state: DoorState = DoorState.UNKNOWN
    prob_open: float = NAN
    prob_closed: float = NAN

    def _check(self) -> None:
        DoorEvent._check(self)
        self._whole("changed", self.changed, 1, int(ALL_CHANGED))
        if self.changed & Changed.POSE:
            self._finite(x=self.x, y=self.y, theta=self.theta)
        _check_place(self)
        if self.changed & Changed.WIDTH:
            self._at_least_0("width", self.width, "metres")
        self._state(self.state)
        self._share(0, prob_open=self.prob_open, prob_closed=self.prob_closed)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorRemoved(DoorEvent):
    """A door left the map (thesis: RemoveDoor); its id is never used again."""

    effect = Effect(presence=Presence.GOES)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorObserved(DoorEvent):
    """A sighting: sets the map's state as an update does, and is evidence for the belief."""

    effect = Effect(sets=Changed.STATE, is_sighting=True)

    state: DoorState
    accuracy_open: float = 1.0
    """P(reads open when it is open), in [0.5, 1]."""
    accuracy_closed: float = 1.0
    """P(reads closed when it is closed), in [0.5, 1]."""
    opening: float = NAN
    """How far it stands open, 0..1; NaN: not measured."""

    def _check(self) -> None:
        DoorEvent._check(self)
        self._state(self.state)
        for name in ("accuracy_open", "accuracy_closed"):
            if math.isnan(getattr(self, name)):
                self._refuse(name, "a number from 0.5 to 1", NAN)
        self._share(0.5, accuracy_open=self.accuracy_open, accuracy_closed=self.accuracy_closed)
        self._share(0, opening=self.opening)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorRequested(DoorEvent):
    """Somebody asked for a state (who: the commit's note); never changes the state."""

    state: DoorState

    def _check(self) -> None:
        DoorEvent._check(self)
        self._state(self.state)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorPassed(DoorEvent):
    """A robot went through (a sighting of OPEN), or gave up (which sets nothing)."""

    effect = Effect(
        sets=Changed.STATE, only_if="passed", values={"state": DoorState.OPEN}, is_sighting=True
    )

    passed: bool
    waited_s: float = NAN
    """How long it waited before the door, seconds; NaN: not measured."""

    def _check(self) -> None:
        DoorEvent._check(self)
        if not isinstance(self.passed, (bool, np.bool_)):
            self._refuse("passed", "True or False", self.passed)
        if not math.isnan(self.waited_s):
            self._at_least_0("waited_s", self.waited_s, "seconds")


@dataclass(frozen=True, slots=True, kw_only=True)
class PatrolStarted(Event):
    """A round began; its name is in the commit's note."""

    patrol: int

    def _check(self) -> None:
        self._whole("patrol", self.patrol, 0, 2**32 - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class PatrolFinished(Event):
    """A round ended."""

    patrol: int

    def _check(self) -> None:
        self._whole("patrol", self.patrol, 0, 2**32 - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotPose(Event):
    """Where the robot was, frame `map`; logged when it moved and at sightings."""

    level: int = LEVEL_NOT_GIVEN
    """Not given: the log's only one."""
    x: float
    y: float
    theta: float
    sd_xy: float = NAN
    """Standard deviation of x and y, metres; NaN: not given."""
    sd_theta: float = NAN
    """Standard deviation of theta, radians; NaN: not given."""

    def _check(self) -> None:
        self._whole("level", self.level, 0, MAX_LEVEL)
        self._finite(x=self.x, y=self.y, theta=self.theta)
        for name in ("sd_xy", "sd_theta"):
            value = getattr(self, name)
            if not math.isnan(value):
                self._at_least_0(name, value, "metres" if name == "sd_xy" else "radians")


@dataclass(frozen=True, slots=True, kw_only=True)
class Retracted(Event):
    """Hides whole events by number, for every question asked with knowledge after it."""

    first_event: int
    last_event: int
    """Inclusive."""

    def _check(self) -> None:
        self._whole("first_event", self.first_event, 0, MAX_EVENT)
        self._whole("last_event", self.last_event, self.first_event, MAX_EVENT)


def _check_text(event: Event, *names: str) -> None:
    for name in names:
        check_text(f"{type(event).__name__}.{name}", getattr(event, name))


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorAnnotated(DoorEvent):
    """A fact in words: name, rooms, type (hinged, sliding …). An empty value takes it back."""

    key: str
    value: str
    salt: bytes = field(default=b"", repr=False, compare=False)
    """16 random bytes, so that a redacted text cannot be guessed from its digest."""

    def _check(self) -> None:
        DoorEvent._check(self)
        if not self.key:
            self._refuse("key", "a key such as name", self.key)
        _check_text(self, "key", "value")


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelAdded(Event):
    """A storey became known (or got another name)."""

    level: int
    name: str
    elevation: float = NAN
    """Metres above the building's zero; NaN: not given."""

    def _check(self) -> None:
        self._whole("level", self.level, 0, MAX_LEVEL)
        _check_text(self, "name")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FloorMap(Event):
    """A level's floor plan, as nav_msgs/OccupancyGrid."""

    level: int = LEVEL_NOT_GIVEN
    """Not given: the log's only one."""
    resolution: float
    """Metres a cell, float32 as in nav_msgs/MapMetaData."""
    origin_x: float
    """Where the lower left corner of cell (0, 0) lies, metres, frame `map`."""
    origin_y: float
    origin_theta: float = 0.0
    cells: NDArray[np.int8]
    """(height, width), row 0 = lowest y; 0 free .. 100 occupied, -1 unknown."""

    def _check(self) -> None:
        self._whole("level", self.level, 0, MAX_LEVEL)
        self._finite(origin_x=self.origin_x, origin_y=self.origin_y, origin_theta=self.origin_theta)
        if not (math.isfinite(self.resolution) and self.resolution > 0):
            self._refuse("resolution", "a finite number of metres above 0", self.resolution)
        if self.cells.ndim != 2 or self.cells.dtype != np.int8:
            got = f"{self.cells.dtype} {self.cells.shape}"
            self._refuse("cells", "an int8 array (height, width)", got)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, FloorMap):
            return NotImplemented
        mine, theirs = (
            (e.happened_ns, e.level, e.resolution, e.origin_x, e.origin_y, e.origin_theta)
            for e in (self, other)
        )
        return mine == theirs and np.array_equal(self.cells, other.cells)

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogExported(Event):
    """The server saved the door database (the thesis's SaveDoorDB): audited."""

    format: str
    file_name: str
    at_ns: int
    """The moment whose state was saved."""

    def _check(self) -> None:
        self._whole("at_ns", self.at_ns, 0, MAX_TIME_NS)
        _check_text(self, "format", "file_name")


@dataclass(frozen=True, slots=True, kw_only=True)
class UnknownEvent(Event):
    """An event of a kind that a later version of this program has added: bytes, no meaning."""

    data: bytes = field(repr=False)
    """As they lie in the log."""


UnknownEvent.kind = 255


@cache
def unknown_kind(kind: int, name: str) -> type[UnknownEvent]:
    """Return the class of a later version's kind, by its number and its name."""
    return type(name, (UnknownEvent,), {"kind": kind, "__slots__": ()})


AnyEvent: TypeAlias = (
    DoorAdded
    | DoorUpdated
    | DoorRemoved
    | DoorObserved
    | DoorRequested
    | DoorPassed
    | PatrolStarted
    | PatrolFinished
    | RobotPose
    | Retracted
    | DoorAnnotated
    | LevelAdded
    | FloorMap
    | LogExported
    | UnknownEvent
)
"""An event of any kind, for a `match` that type checkers hold to have a case for each of them."""

KINDS: tuple[type[Event], ...] = (
    DoorAdded,
    DoorUpdated,
    DoorRemoved,
    DoorObserved,
    DoorRequested,
    DoorPassed,
    PatrolStarted,
    PatrolFinished,
    RobotPose,
    Retracted,
    DoorAnnotated,
    LevelAdded,
    FloorMap,
    LogExported,
)
"""Every kind of event; the kind number is the place in this list, from 1 on. Only ever grows, with
`AnyEvent` and the format's minor version: `log.form.KINDS_OF_MINOR`."""

for _number, _kind in enumerate(KINDS, start=1):
    _kind.kind = _number
    _kind.numbers = tuple(f.name for f in fields(_kind) if f.type in ("float", float))

SETTING_KINDS: tuple[type[DoorEvent], ...] = tuple(
    kind for kind in KINDS if issubclass(kind, DoorEvent) and kind.effect is not NO_EFFECT
)
"""The kinds that do something to a door, in the order of their numbers."""

STATE_KINDS = tuple(
    kind
    for kind in SETTING_KINDS
    if kind.effect.can_set & Changed.STATE or kind.effect.presence is not Presence.STAYS
)
"""Those that may set its state, or end it."""

ADDING_KINDS = tuple(kind for kind in SETTING_KINDS if kind.effect.presence is Presence.COMES)
"""Those that bring a door into the map."""

DOOR_KINDS = frozenset(kind.kind for kind in KINDS if issubclass(kind, DoorEvent))
"""The numbers of the kinds that are about a door."""

KIND_BY_NAME: Mapping[str, type[Event]] = {kind.__name__: kind for kind in KINDS}


def event_of(kind: int, values: Mapping[str, Any], happened_ns: int | None) -> Event:
    """Return the event of that kind with those field values (states and bits as plain numbers)."""
    cls = KINDS[kind - 1]
    known = dict(values)
    if "state" in known:
        known["state"] = DoorState.of(known["state"])
    if known.get("level") == NO_LEVEL:
        known["level"] = LEVEL_NOT_GIVEN
    if "changed" in known:
        known["changed"] = Changed(known["changed"])
    return cls(happened_ns=happened_ns, **known)


def field_names(kind: type[Event]) -> tuple[str, ...]:
    """Return the names of a kind's own fields, without `happened_ns`."""
    return tuple(f.name for f in fields(kind) if f.name != "happened_ns")


def defaults_of(kind: type[Event]) -> dict[str, Any]:
    """Return the defaults of a kind's own fields, as far as they have any."""
    known = ((f.name, f.default) for f in fields(kind) if f.name != "happened_ns")
    return {name: default for name, default in known if default is not MISSING}
