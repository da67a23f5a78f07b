"""What can happen to a door map, as frozen facts in the past tense, and many of them as columns.

An event says what happened and when (`happened_ns`). Its number and its recorded time are given
by the log. The names and the meaning of every field are those of the `.msg` texts in
`semmap_log/core/messages/msg`, which define the bytes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from typing import Annotated, Any, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model import doors
from semmap_log.core.model import rules as field_rules
from semmap_log.core.model.doors import NO_LEVEL as NO_LEVEL  # noqa: PLC0414 - a column of events has it
from semmap_log.core.model.meaning import (
    ALL_CHANGED,
    NO_EFFECT,
    POSE_IF_SET,
    WIDTH_WITH_POSE,
    DoorEvent,
    DoorValues,
    Effect,
    Event,
    LevelNumber,
    Presence,
    Probability,
)
from semmap_log.core.model.meaning import Changed as Changed  # noqa: PLC0414 - users look for it here
from semmap_log.core.model.rules import is_whole_number as is_whole_number  # noqa: PLC0414 - used with events
from semmap_log.errors import CommandError

__all__ = [
    "KINDS",
    "Changed",
    "ClassDefined",
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
    "HistoryTrimmed",
    "LevelAdded",
    "LogExported",
    "MomentPinned",
    "PatrolFinished",
    "PatrolStarted",
    "Retracted",
    "RobotPose",
    "SightingsThinned",
    "UnknownEvent",
]

MAX_EVENT = 2**63 - 1
LEAST_FLOAT32, GREATEST_FLOAT32 = 2.0**-149, (2 - 2.0**-23) * 2.0**127
"""Of the positive numbers that a float32 can hold: what is beyond would be stored as 0, or not."""


EventNumber: TypeAlias = Annotated[int, field_rules.Whole(0, MAX_EVENT)]
PatrolNumber: TypeAlias = Annotated[int, field_rules.Whole(0, 2**32 - 1)]
Coordinate: TypeAlias = Annotated[float, field_rules.Number()]
Accuracy: TypeAlias = Annotated[float, field_rules.Number(0.5, 1)]
Deviation: TypeAlias = Annotated[float, field_rules.Number(0, or_nan=True, unit="metres")]
Turn: TypeAlias = Annotated[float, field_rules.Number(0, or_nan=True, unit="radians")]
Duration: TypeAlias = Annotated[float, field_rules.Number(0, or_nan=True, unit="seconds")]


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorAdded(DoorValues, DoorEvent):
    """A door came into the map (thesis: AddDoor). x, y, theta and width NaN: an unplaced door."""

    effect = Effect(sets=ALL_CHANGED, presence=Presence.COMES)
    fits = (*DoorValues.fits, WIDTH_WITH_POSE)


@dataclass(frozen=True, slots=True, kw_only=True)
class _SaysWhat(DoorEvent):
    """An event that says itself which parts of its door it sets."""

    effect = Effect(says_what=True)

    changed: Annotated[Changed, field_rules.Bits(1, int(ALL_CHANGED), flags=Changed)]


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorUpdated(DoorValues, _SaysWhat):
    """Some fields of a door were set (thesis: UpdateDoor); those not in `changed` mean nothing."""

    fits = (*DoorValues.fits, POSE_IF_SET)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorRemoved(DoorEvent):
    """A door left the map (thesis: RemoveDoor); its id is never used again."""

    effect = Effect(presence=Presence.GOES)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorObserved(DoorEvent):
    """A sighting: sets the map's state as an update does, and is evidence for the belief."""

    effect = Effect(sets=Changed.STATE, is_sighting=True)

    state: doors.DoorState
    accuracy_open: Accuracy = 1.0
    """P(reads open when it is open), in [0.5, 1]."""
    accuracy_closed: Accuracy = 1.0
    """P(reads closed when it is closed), in [0.5, 1]."""
    opening: Probability = doors.NAN
    """How far it stands open, 0..1; NaN: not measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorRequested(DoorEvent):
    """A state was requested (by whom: the commit's note); never changes the state."""

    state: doors.DoorState


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorPassed(DoorEvent):
    """A robot went through (a sighting of OPEN), or gave up (which sets nothing)."""

    effect = Effect(
        sets=Changed.STATE,
        only_if="passed",
        values={"state": doors.DoorState.OPEN},
        is_sighting=True,
    )

    passed: bool
    waited_s: Duration = doors.NAN
    """How long it waited before the door, seconds; NaN: not measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PatrolStarted(Event):
    """A round began; its name is in the commit's note."""

    patrol: PatrolNumber


@dataclass(frozen=True, slots=True, kw_only=True)
class PatrolFinished(Event):
    """A round ended."""

    patrol: PatrolNumber


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotPose(Event):
    """Where the robot was, frame `map`; logged when it moved and at sightings."""

    level: LevelNumber = doors.LEVEL_NOT_GIVEN
    """Not given: the log's only one."""
    x: Coordinate
    y: Coordinate
    theta: Coordinate
    sd_xy: Deviation = doors.NAN
    """Standard deviation of x and y, metres; NaN: not given."""
    sd_theta: Turn = doors.NAN
    """Standard deviation of theta, radians; NaN: not given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Retracted(Event):
    """Hides whole events by number, for every query whose knowledge includes it."""

    first_event: EventNumber
    last_event: Annotated[int, field_rules.Whole(0, MAX_EVENT, not_below="first_event")]
    """Inclusive."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorAnnotated(DoorEvent):
    """A fact in words: name, rooms, type (hinged, sliding …). An empty value takes it back."""

    key: Annotated[str, field_rules.Text(needed="a key such as name")]
    value: str
    salt: bytes = field(default=b"", repr=False, compare=False)
    """16 random bytes, so that a redacted text cannot be guessed from its digest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelAdded(Event):
    """A storey became known (or got another name)."""

    level: LevelNumber
    name: str
    elevation: float = doors.NAN
    """Metres above the building's zero; NaN: not given."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FloorMap(Event):
    """A level's floor plan, as nav_msgs/OccupancyGrid."""

    level: LevelNumber = doors.LEVEL_NOT_GIVEN
    """Not given: the log's only one."""
    resolution: Annotated[
        float,
        field_rules.Number(
            LEAST_FLOAT32, GREATEST_FLOAT32,
            words="a finite number of metres above 0 that a float32 can hold", unit="metres",
        ),
    ]  # fmt: skip
    """Metres a cell, float32 as in nav_msgs/MapMetaData."""
    origin_x: Coordinate
    """Where the lower left corner of cell (0, 0) lies, metres, frame `map`."""
    origin_y: Coordinate
    origin_theta: Coordinate = 0.0
    cells: Annotated[NDArray[np.int8], field_rules.Cells()]
    """(height, width), row 0 = lowest y; 0 free .. 100 occupied, -1 unknown."""

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
    at_ns: Annotated[int, field_rules.Nanoseconds()]
    """The moment whose state was saved."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HistoryTrimmed(Event):
    """Records were taken out of closed segments on purpose; the note says who did it, and why.

    The numbers are of all of the log, with what was taken out before.
    """

    changes_nothing = True

    next_event: EventNumber
    """It was about events below this number."""
    events_gone: EventNumber
    notes_gone: EventNumber
    horizon: EventNumber
    """Events below this number cannot be queried any more; 0: all can."""
    reasons: str
    rule: str
    """What was taken out, in words."""
    tombstones: str
    """The log's id, a colon, and the SHA-256 of the data of all its Tombstones in order, in
    hexadecimal digits; without that, the trimming has begun, and another such event marks its
    end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MomentPinned(Event):
    """A moment that shall stay answerable when what was before is no longer kept."""

    changes_nothing = True

    at_ns: Annotated[int, field_rules.Nanoseconds()]
    next_event: EventNumber = 0
    """The state holds events below this number; 0: there is no state yet."""
    name: str
    keyframe: str = ""
    """Base64 of zlib of the Keyframe message of that moment; "": none yet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SightingsThinned(DoorEvent):
    """Sightings of a door that were taken out, since they repeat what is left: their worth."""

    state: doors.DoorState
    count: Annotated[int, field_rules.Whole(1, 2**32 - 1)]
    accuracy_open: Accuracy = 1.0
    """P(reads open when it is open), in [0.5, 1]: their mean."""
    accuracy_closed: Accuracy = 1.0
    """P(reads closed when it is closed), in [0.5, 1]: their mean."""
    first_ns: Annotated[int, field_rules.Nanoseconds()]
    """When the first of them happened."""
    last_ns: Annotated[int, field_rules.Nanoseconds()]
    """When the last did."""
    first_event: EventNumber = 0
    """The number of the first: while that is in the log, these were not taken out, and do not
    count; 0: not known, of another log."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassDefined(Event):
    """What objects of a class are like; a later definition of that name takes its place."""

    fits = (
        field_rules.Fit(
            "",
            ("states", "blocks"),
            doors.blocks_others,
            "some of {states}, commas between",
            ("blocks",),
        ),
    )

    class_name: Annotated[str, field_rules.Text(expects=doors.class_name_expected)]
    geometry: Annotated[str, field_rules.Text(expects=doors.geometry_expected)]
    """segment, polygon or point."""
    states: Annotated[str, field_rules.Text(expects=doors.states_expected)] = "OPEN,CLOSED,MOVING"
    """What OPEN, CLOSED and, if there is a third, MOVING are called, commas between."""
    blocks: str = "CLOSED"
    """Those of the words whose states block a robot's way, commas between; empty: none."""

    @classmethod
    def of(cls, one: doors.ObjectClass, happened_ns: int | None = None) -> ClassDefined:
        """Return the definition of a class."""
        blocks = ",".join(one.word(state) for state in sorted(one.blocks))
        return cls(
            class_name=one.name,
            geometry=one.geometry.value,
            states=",".join(one.words),
            blocks=blocks,
            happened_ns=happened_ns,
        )

    @property
    def object_class(self) -> doors.ObjectClass:
        """The class that it defines."""
        return doors.ObjectClass.told(self.class_name, self.geometry, self.states, self.blocks)


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
    | HistoryTrimmed
    | MomentPinned
    | SightingsThinned
    | ClassDefined
    | UnknownEvent
)
"""An event of any kind, for a `match` that type checkers hold to have a case for each of them. The
number of a kind is its place in this list, from 1 on: it only ever grows at its end, before
`UnknownEvent`, with the format's minor version (`store.byte_layout.KINDS_OF_MINOR`)."""

KINDS: tuple[type[Event], ...] = get_args(AnyEvent)[:-1]
"""Every kind of event but `UnknownEvent`, which stands last."""

for _number, _kind in enumerate(KINDS, start=1):
    _kind.take_number(_number)

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

POSE_KINDS = tuple(kind for kind in SETTING_KINDS if kind.effect.can_set & Changed.POSE)
"""Those that may say where a door is."""

DOOR_KINDS = frozenset(kind.kind for kind in KINDS if issubclass(kind, DoorEvent))
"""The numbers of the kinds that are about a door."""

KIND_BY_NAME: Mapping[str, type[Event]] = {kind.__name__: kind for kind in KINDS}


def kinds_meant(kinds: Iterable[type[Event] | str] | type[Event]) -> list[type[Event]]:
    """Return kinds of events that are given as classes or names; also a single one.

    Raises:
        CommandError: There is no such kind.
    """
    told = [kinds] if isinstance(kinds, (str, type)) else list(kinds)
    for kind in told:
        if isinstance(kind, str) and kind not in KIND_BY_NAME:
            raise CommandError(f"kinds: expected some of {', '.join(KIND_BY_NAME)}, got {kind!r}.")
    return [KIND_BY_NAME[kind] if isinstance(kind, str) else kind for kind in told]


def event_of(
    kind: type[Event], values: Mapping[str, Any], happened_ns: int | None, *, is_stored: bool = True
) -> Event:
    """Return the event of that kind with those field values: states and bits as plain numbers.

    Args:
        kind: Of fixed size.
        values: Field -> number, as a column holds it.
        happened_ns: When it happened.
        is_stored: A log holds it: a state that only a later version knows is UNKNOWN.

    Raises:
        InvalidEventError: It holds a value that no such event can have.
    """
    known = dict(values)
    for name, rule in _told(kind.kind):
        known[name] = _value_of(rule, known[name], is_stored=is_stored)
    return kind(happened_ns=happened_ns, **known)


def events_of_columns(
    kind: type[Event], columns: Mapping[str, Sequence[Any]], happened_ns: Sequence[int | None]
) -> Iterator[Event]:
    """Yield stored events of one kind, as `event_of` makes them, in a fifth of the time.

    Args:
        kind: Of fixed size.
        columns: Its fields -> their numbers, which were checked: nobody does it here again.
        happened_ns: When each happened.
    """
    told = {name: columns[name] for name in columns}
    for name, rule in _told(kind.kind):
        values = {n: _value_of(rule, n, is_stored=True) for n in set(columns[name])}
        told[name] = [values[number] for number in columns[name]]
    setters = [getattr(kind, name).__set__ for name in ("happened_ns", *told)]
    for row in zip(happened_ns, *told.values(), strict=True):
        event = object.__new__(kind)
        for set_field, value in zip(setters, row, strict=True):
            set_field(event, value)
        yield event


def _value_of(rule: field_rules.Rule, number: Any, *, is_stored: bool) -> Any:
    value = rule.told_by(number)
    if is_stored and isinstance(rule, field_rules.OneOf) and not rule.allows(value):
        return rule.members(0)
    return value


@cache
def _told(kind: int) -> tuple[tuple[str, field_rules.Rule], ...]:
    """Return the fields whose values are another thing than the numbers in a column."""
    rules = KINDS[kind - 1].rules.fields.items()
    return tuple((name, rule) for name, rule in rules if rule.is_coded)


def field_names(kind: type[Event]) -> tuple[str, ...]:
    """Return the names of a kind's own fields, without `happened_ns`."""
    return tuple(kind.rules.fields)


def public_fields(kind: type[Event]) -> tuple[str, ...]:
    """Return the names of those fields that are shown to others: all but salts."""
    return tuple(f.name for f in fields(kind) if f.repr and f.name != "happened_ns")


def defaults_of(kind: type[Event]) -> dict[str, Any]:
    """Return the defaults of a kind's own fields, as far as they have any."""
    known = ((f.name, f.default) for f in fields(kind) if f.name != "happened_ns")
    return {name: default for name, default in known if default is not MISSING}


def may_lack_level(kind: type[Event]) -> bool:
    """Return whether a kind's events are on a level that may be left out: `levels` resolves it."""
    return not doors.is_given(defaults_of(kind).get("level", 0))
