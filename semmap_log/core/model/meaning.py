"""What events do to doors, stated once: the fields of a door, and which kind of event sets which.

A kind of event declares in its `effect` what it does to its door (`events`). From these tables come
the fold (`folds.registers`), all columns of changes (`folds.door_changes`), evidence, JSON lines,
Arrow tables and imports: a new kind that sets a state, or a new field of a door, is declared here
and in `events`, and nowhere else.

Every event is a frozen fact in the past tense, with the time at which it happened. The annotations
of a kind define what its fields can hold.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum, IntFlag
from functools import reduce
from operator import attrgetter, or_
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, TypeAlias

from semmap_log.core.model import doors
from semmap_log.core.model import rules as field_rules
from semmap_log.errors import InvalidEventError


class Changed(IntFlag):
    """Which parts of a door a DoorUpdated sets."""

    POSE = 1
    """x, y, theta and level."""
    WIDTH = 2
    STATE = 4
    PROB_OPEN = 8
    PROB_CLOSED = 16


def sets_part(changed: Any, bit: int) -> Any:
    """Return whether bits of `Changed` have one of them; for a column of bits, where."""
    return ((changed + 0) & bit) != 0  # + 0: a plain number, whose `&` takes a tenth of the time


def _half_given(x: Any, y: Any, theta: Any) -> Any:
    """Return where some of a pose is NaN, but not all of it: an unplaced door has none."""
    lacks_x = x != x  # noqa: PLR0124 - NaN
    return (lacks_x != (y != y)) | (lacks_x != (theta != theta))  # noqa: PLR0124


def _lacks_pose(changed: Any, x: Any, y: Any, theta: Any) -> Any:
    """Return where a pose is set, and some of it is NaN."""
    lacks = (x != x) | (y != y) | (theta != theta)  # noqa: PLR0124
    return lacks & sets_part(changed, _POSE_BIT)


_POSE_BIT = int(Changed.POSE)
_POSE = ("x", "y", "theta")

WHOLE_POSE = field_rules.Fit("x", _POSE, _half_given, field_rules.FINITE.expected, _POSE)
"""All of a pose is there, or nothing."""
POSE_IF_SET = field_rules.Fit(
    "x", ("changed", *_POSE), _lacks_pose, field_rules.FINITE.expected, _POSE
)
WIDTH_WITH_POSE = field_rules.Fit(
    "width",
    ("x", "width"),
    lambda x, width: (x != x) != (width != width),  # noqa: PLR0124 - NaN
    "a width where there is a pose, and none where there is none",
    ("width",),
)

LevelNumber: TypeAlias = Annotated[
    int,
    field_rules.Whole(
        0, doors.MAX_LEVEL, absent=doors.NO_LEVEL, absent_value=doors.LEVEL_NOT_GIVEN
    ),
]
PlaceOrNone: TypeAlias = Annotated[float, field_rules.Number(or_nan=True)]
Probability: TypeAlias = Annotated[float, field_rules.Number(0, 1, or_nan=True)]


@dataclasses.dataclass(frozen=True, kw_only=True)
class DoorValues:
    """The fields of a door that events set, each with the part of the door that it belongs to."""

    __slots__ = ()
    fits: ClassVar[tuple[field_rules.Fit, ...]] = (WHOLE_POSE,)

    level: Annotated[LevelNumber, Changed.POSE] = doors.LEVEL_NOT_GIVEN
    """Not given: the one that the door is on; of a new door the log's only one: see `levels`."""
    x: Annotated[PlaceOrNone, Changed.POSE] = doors.NAN
    y: Annotated[PlaceOrNone, Changed.POSE] = doors.NAN
    theta: Annotated[PlaceOrNone, Changed.POSE] = doors.NAN
    width: Annotated[
        float, field_rules.Number(0, or_nan=True, unit="metres", if_set=True), Changed.WIDTH
    ] = doors.NAN
    state: Annotated[doors.DoorState, Changed.STATE] = doors.DoorState.UNKNOWN
    prob_open: Annotated[Probability, Changed.PROB_OPEN] = doors.NAN
    prob_closed: Annotated[Probability, Changed.PROB_CLOSED] = doors.NAN


PART_OF: Mapping[str, Changed] = field_rules.marks_of(DoorValues, Changed)
"""Field -> the part that it belongs to."""

FIELDS: Mapping[str, str] = {
    name: rule.dtype for name, rule in field_rules.rules_of(DoorValues).items()
}
"""Every field of a door that events set -> its numpy type."""

PARTS: Mapping[Changed, Mapping[str, str]] = {
    bit: {name: FIELDS[name] for name, part in PART_OF.items() if part == bit} for bit in Changed
}
"""Part of a door -> its fields and their numpy types. The fields of a part are set together."""

ALL_CHANGED = reduce(or_, PARTS)
NOTHING = Changed(0)

PLACING = Changed.POSE | Changed.WIDTH
"""What an update must set together to give a door its first place."""

REGISTERS: Mapping[str, Mapping[str, str]] = {
    "added": {},
    "removed": {},
    **{(bit.name or "").lower(): fields for bit, fields in PARTS.items()},
}
"""Register of a door -> its values and their numpy types. A stamp belongs to each: when what set
it last happened, and the number of that event."""

REGISTER_OF: Mapping[Changed, str] = dict(zip(PARTS, list(REGISTERS)[2:], strict=True))
"""Part of a door -> its register."""


def changed(names: Iterable[str]) -> Changed:
    """Return the parts to which fields of these names belong; other names count for nothing."""
    return reduce(or_, (PART_OF[name] for name in names if name in PART_OF), NOTHING)


class Presence(Enum):
    """What an event says about whether its door is in the map."""

    STAYS = 0
    COMES = 1
    GOES = 2


@dataclass(frozen=True, slots=True)
class Effect:
    """What events of a kind do to the door that they are about."""

    sets: Changed = NOTHING
    """The parts that every such event sets. One without a field of that name has it in `values`."""
    says_what: bool = False
    """Which parts it sets, each event says itself, in its field `changed`."""
    only_if: str = ""
    """A field that is true or false; where it is false, the event sets nothing."""
    values: Mapping[str, int] = dataclasses.field(default_factory=lambda: MappingProxyType({}))
    """Fields of the door that it sets always to the same."""
    presence: Presence = Presence.STAYS
    is_sighting: bool = False
    """Somebody saw it: evidence that may be wrong, and says nothing of the time until the next."""

    @property
    def can_set(self) -> Changed:
        """The parts that such an event may set."""
        return ALL_CHANGED if self.says_what else self.sets


NO_EFFECT = Effect()


HAPPENED = field_rules.Nanoseconds()


@dataclass(frozen=True, slots=True)
class KindRules:
    """What the values of a kind's events can be: each by itself, and all together."""

    fields: Mapping[str, field_rules.Rule]
    """Field -> its rule."""
    fits: tuple[field_rules.Fit, ...]

    @classmethod
    def of(cls, kind: type[Event]) -> KindRules:
        """Return what the annotations of a kind say, and its `fits`."""
        told = {
            name: rule for name, rule in field_rules.rules_of(kind).items() if name != "happened_ns"
        }
        fits = list(kind.fits)
        for name, rule in told.items():
            if isinstance(rule, field_rules.Whole) and rule.not_below:
                fits.append(_not_below(name, rule))
            if isinstance(rule, field_rules.Number) and rule.if_set and kind.effect.says_what:
                told[name] = field_rules.ANY_NUMBER
                fits.append(_given_if_set(name, rule))
        return cls(MappingProxyType(told), tuple(fits))

    def breaches(self, event: Event) -> Iterator[InvalidEventError]:
        """Yield the rules that an event breaks: types first, then those of fields, in their order.

        A later rule may rest on the earlier ones.
        """
        values = {name: getattr(event, name) for name in self.fields}
        for name, rule in self.fields.items():
            if isinstance(rule, field_rules.Number) and not field_rules.is_number(values[name]):
                yield event.refused(name, "a number")
        for name, rule in self.fields.items():
            yield from self._misfits(event, values, name)
            if not rule.allows(values[name]):
                expected = rule.expected_of(values[name]).format(**values)
                yield event.refused(name, expected, rule.shown(values[name]))
        yield from self._misfits(event, values, "")

    def _misfits(
        self, event: Event, values: Mapping[str, Any], before: str
    ) -> Iterator[InvalidEventError]:
        for fit in self.fits:
            if fit.before == before and fit.broken(*[values[name] for name in fit.of]):
                yield event.refused(fit.blamed(values), fit.expected.format(**values))


def _not_below(name: str, rule: field_rules.Whole) -> field_rules.Fit:
    both = (rule.not_below, name)
    return field_rules.Fit("", both, lambda least, value: value < least, rule.expected, (name,))


def _given_if_set(name: str, rule: field_rules.Number) -> field_rules.Fit:
    bit, low = int(PART_OF[name]), rule.low
    too_great = math.nextafter(rule.high, math.inf)

    def broken(changed: Any, value: Any) -> Any:
        lacks = value != value  # noqa: PLR0124 - NaN
        return sets_part(changed, bit) & (lacks | (value < low) | (value >= too_great))

    return field_rules.Fit(name, ("changed", name), broken, rule.expected, (name,))


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened. The base of all kinds."""

    happened_ns: int | None = None
    """When it happened (nanoseconds, UTC); None: when the log records it."""

    kind: ClassVar[int]
    """Its number among `KINDS`, which is also its MCAP channel id: never changes."""

    effect: ClassVar[Effect] = NO_EFFECT
    """What it does to the door that it is about."""

    fits: ClassVar[tuple[field_rules.Fit, ...]] = ()
    """What its values must be to each other."""

    changes_nothing: ClassVar[bool] = False
    """Whether programs that do not know a kind, added to the format later, may leave it out, since
    no answer about other events depends on it. `store.byte_layout` states what that guarantees."""

    rules: ClassVar[KindRules] = KindRules(MappingProxyType({}), ())
    """What its values can be; `fits` are among them."""

    _allow: ClassVar[tuple[tuple[str, Callable[[Any], bool]], ...]] = ()
    _broken: ClassVar[tuple[tuple[Callable[[Any], Any], Callable[..., Any]], ...]] = ()
    """The same at hand: every event is checked when it is made."""

    @classmethod
    def take_number(cls, number: int) -> None:
        """Become a kind: with a number, and with the rules that the annotations define."""
        cls.kind = number
        cls.rules = KindRules.of(cls)
        checked = (
            pair for pair in cls.rules.fields.items() if type(pair[1]) is not field_rules.Rule
        )
        cls._allow = tuple((name, rule.allows) for name, rule in checked)
        cls._broken = tuple((attrgetter(*fit.of), fit.broken) for fit in cls.rules.fits)

    def __post_init__(self) -> None:
        happened_ns = self.happened_ns
        if happened_ns is not None and not HAPPENED.allows(happened_ns):
            raise self.refused("happened_ns", HAPPENED.expected, happened_ns)
        for name, allows in self._allow:
            if not allows(getattr(self, name)):
                raise next(self.rules.breaches(self))
        for values, broken in self._broken:
            if broken(*values(self)):
                raise next(self.rules.breaches(self))

    def refused(self, name: str, expected: str, *got: object) -> InvalidEventError:
        """Return the error about a field's value; `got` replaces the value in its text."""
        shown = got[0] if got else getattr(self, name)
        return InvalidEventError(f"{type(self).__name__}.{name}", expected, shown)

    def sets(self) -> Changed:
        """Return the parts of its door that it sets."""
        effect = self.effect
        if effect.only_if and not getattr(self, effect.only_if):
            return NOTHING
        return self.changed if effect.says_what else effect.sets  # type: ignore[attr-defined]

    def values_set(self) -> dict[str, Any]:
        """Return what it sets: fields of its door and their values."""
        known = self.effect.values
        sets = self.sets()
        names = (name for part in PARTS if part & sets for name in PARTS[part])
        return {name: known[name] if name in known else getattr(self, name) for name in names}


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorEvent(Event):
    """An event about one door."""

    door_id: Annotated[doors.DoorId, field_rules.Whole(0, doors.MAX_DOOR_ID)]
