"""What every event is: a frozen fact in the past tense, which says when it happened.

What a kind's fields can hold stands in their annotations, what it does to its door in `effect`:
see `events`, where the kinds are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from operator import attrgetter
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.doors import MAX_DOOR_ID, DoorId
from semmap_log.core.model.meaning import (
    NO_EFFECT,
    NOTHING,
    PART_OF,
    PARTS,
    Changed,
    Effect,
    sets_part,
)
from semmap_log.core.model.rules import (
    ANY_NUMBER,
    Fit,
    Nanoseconds,
    Number,
    Rule,
    Whole,
    is_number,
    rules_of,
)
from semmap_log.errors import InvalidEventError

HAPPENED = Nanoseconds()


@dataclass(frozen=True, slots=True)
class KindRules:
    """What the values of a kind's events can be: each by itself, and all together."""

    fields: Mapping[str, Rule]
    """Field -> its rule."""
    fits: tuple[Fit, ...]

    @classmethod
    def of(cls, kind: type[Event]) -> KindRules:
        """Return what the annotations of a kind say, and its `fits`."""
        told = {name: rule for name, rule in rules_of(kind).items() if name != "happened_ns"}
        fits = list(kind.fits)
        for name, rule in told.items():
            if isinstance(rule, Whole) and rule.not_below:
                fits.append(_not_below(name, rule))
            if isinstance(rule, Number) and rule.if_set and kind.effect.says_what:
                told[name] = ANY_NUMBER
                fits.append(_given_if_set(name, rule))
        return cls(MappingProxyType(told), tuple(fits))

    def breaches(self, event: Event) -> Iterator[InvalidEventError]:
        """Yield what an event breaks; types come first, then what the fields say, in their order.

        What comes behind the first may rest on it.
        """
        values = {name: getattr(event, name) for name in self.fields}
        for name, rule in self.fields.items():
            if isinstance(rule, Number) and not is_number(values[name]):
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


def _not_below(name: str, rule: Whole) -> Fit:
    both = (rule.not_below, name)
    return Fit("", both, lambda least, value: value < least, rule.expected, (name,))


def _given_if_set(name: str, rule: Number) -> Fit:
    bit, low = int(PART_OF[name]), rule.low
    too_great = math.nextafter(rule.high, math.inf)

    def broken(changed: Any, value: Any) -> Any:
        lacks = value != value  # noqa: PLR0124 - NaN
        return sets_part(changed, bit) & (lacks | (value < low) | (value >= too_great))

    return Fit(name, ("changed", name), broken, rule.expected, (name,))


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened. The base of all kinds."""

    happened_ns: int | None = None
    """When it happened (nanoseconds, UTC); None: when the log records it."""

    kind: ClassVar[int]
    """Its number among `KINDS`, which is also its MCAP channel id: never changes."""

    effect: ClassVar[Effect] = NO_EFFECT
    """What it does to the door that it is about."""

    fits: ClassVar[tuple[Fit, ...]] = ()
    """What its values must be to each other."""

    changes_nothing: ClassVar[bool] = False
    """Of a kind that was added to the format later: programs that do not know it may leave it out,
    since no answer about other events depends on it. `store.form` tells what that promises."""

    rules: ClassVar[KindRules] = KindRules(MappingProxyType({}), ())
    """What its values can be; `fits` are among them."""

    _allow: ClassVar[tuple[tuple[str, Callable[[Any], bool]], ...]] = ()
    _broken: ClassVar[tuple[tuple[Callable[[Any], Any], Callable[..., Any]], ...]] = ()
    """The same at hand: every event is checked when it is made."""

    @classmethod
    def take_number(cls, number: int) -> None:
        """Become a kind: with a number, and with the rules that the annotations tell."""
        cls.kind = number
        cls.rules = KindRules.of(cls)
        checked = (pair for pair in cls.rules.fields.items() if type(pair[1]) is not Rule)
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
        """Return what is said of a field's value; `got` stands for it where it is not shown."""
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

    door_id: Annotated[DoorId, Whole(0, MAX_DOOR_ID)]
