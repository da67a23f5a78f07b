"""What values a field of an event can have: stated once, for one event and for columns of many.

The rule of a field is in its annotation in `events`: type, range, unit. A type that says
everything needs none: see `rules_of`. From the rules come the checks of an event when it is made,
those of columns (`batches.event_columns`), how a JSON line's values are read, and the types of
Arrow's columns.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from functools import cache, cached_property
from inspect import get_annotations
from typing import Annotated, Any, ClassVar, TypeVar, get_args, get_origin

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.io.clock import MAX_TIME_NS

_Mark = TypeVar("_Mark")

GREATEST = sys.float_info.max
"""The greatest finite number."""


def text_expected(text: object) -> str:
    """Return what is expected instead of a text that cannot be stored; "": it can be."""
    if not isinstance(text, str):
        return "a text"
    if "\0" in text:
        return "text without NUL characters"
    try:
        text.encode()
    except UnicodeEncodeError:
        return "text that UTF-8 can hold"
    return ""


def is_whole_number(value: object) -> bool:
    """Return whether a value is a whole number; a bool is not, though Python counts it as one."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def is_number(value: object) -> bool:
    """Return whether a value is a number, whole or not; a bool is not."""
    return is_whole_number(value) or isinstance(value, (float, np.floating))


class Rule:
    """What the values of a field are. This one: whatever its type says, unchecked."""

    dtype: str = ""
    """Numpy type of a column that holds them, unless stated otherwise; "": none can."""

    is_coded: bool = False
    """Whether a column's numbers stand for values that are something else: `told_by`."""

    expected: str = ""
    """In words; a name in braces stands for the value of that field of the same event."""

    def allows(self, value: Any) -> bool:  # noqa: ARG002 - others look at it
        """Return whether an event can have that value."""
        return True

    def allows_all(self, column: NDArray[Any]) -> bool:
        """Return whether events can have all values of a column."""
        return not np.any(self.refused(column))

    def refused(self, column: NDArray[Any]) -> NDArray[np.bool_]:
        """Return which values of a column no event can have."""
        return np.zeros(len(column), np.bool_)

    def told_by(self, number: Any) -> Any:
        """Return the value that a column's number stands for."""
        return number

    def limits(self, dtype: np.dtype[Any]) -> bool:  # noqa: ARG002 - others look at it
        """Return whether a column of that type could hold a value that no event can have."""
        return False

    def expected_of(self, value: Any) -> str:  # noqa: ARG002 - others look at it
        """Return what is expected instead of a value that it does not allow."""
        return self.expected

    def shown(self, value: Any) -> Any:
        """Return what a message shows of such a value."""
        return value


class _Range(Rule):
    """Values between two others."""

    low: float
    high: float

    def limits(self, dtype: np.dtype[Any]) -> bool:
        if dtype.kind not in "iu":
            return True
        info = np.iinfo(dtype)
        return self.low > info.min or self.high < info.max

    def allows_all(self, column: NDArray[Any]) -> bool:
        least, greatest = np.minimum.reduce(column), np.maximum.reduce(column)
        return bool(least >= self.low and greatest <= self.high)  # NaN: neither

    def refused(self, column: NDArray[Any]) -> NDArray[np.bool_]:
        return np.asarray(~((column >= self.low) & (column <= self.high)))


@dataclasses.dataclass(frozen=True)
class Number(_Range):
    """A number, whole or not."""

    dtype = "f8"

    low: float = -GREATEST
    high: float = GREATEST
    or_nan: bool = False
    """NaN means that it was not given."""
    unit: str = ""
    if_set: bool = False
    """An event that says what it sets may have any number there while it does not set it; where it
    does, the number must be given."""
    words: str = ""
    """What is expected; empty: as the range says it."""

    @cached_property
    def expected(self) -> str:  # type: ignore[override]
        if self.words:
            return self.words
        if self.high < GREATEST:
            return f"a number from {self.low:g} to {self.high:g}"
        unit = f" of {self.unit}" if self.unit else ""
        return f"a finite number{unit}, 0 or more" if self.low == 0 else f"a finite number{unit}"

    def allows(self, value: Any) -> bool:
        if type(value) is not float:
            if not is_number(value):
                return False
            if isinstance(value, np.floating):  # a float32 has no room for the greatest number
                value = float(value)
        if self.low <= value <= self.high:
            return True
        return self.or_nan and bool(value != value)  # noqa: PLR0124 - NaN

    def allows_all(self, column: NDArray[Any]) -> bool:
        if not self.or_nan:
            return super().allows_all(column)
        least, greatest = np.fmin.reduce(column), np.fmax.reduce(column)
        return not (least < self.low or greatest > self.high)  # all NaN: neither is true

    def refused(self, column: NDArray[Any]) -> NDArray[np.bool_]:
        outside = super().refused(column)
        return outside & (column == column) if self.or_nan else outside  # noqa: PLR0124 - NaN


@dataclasses.dataclass(frozen=True)
class Whole(_Range):
    """A whole number."""

    @property
    def dtype(self) -> str:  # type: ignore[override]
        """The least type that has room for them."""
        greatest = self.high if self.absent is None else max(self.high, self.absent)
        names = ("u1", "u2", "u4", "i8") if self.low >= 0 else ("i8",)
        return next(name for name in names if greatest <= np.iinfo(name).max)

    @property
    def is_coded(self) -> bool:  # type: ignore[override]
        """Whether one stands for a value that was not given."""
        return self.absent is not None

    low: int
    high: int
    absent: int | None = None
    """Stands in a column for a value that was not given."""
    absent_value: int = 0
    """Stands for it in an event."""
    not_below: str = ""
    """A field of the same event that it may be equal to, or above."""

    @cached_property
    def expected(self) -> str:  # type: ignore[override]
        low = f"{{{self.not_below}}}" if self.not_below else self.low
        return f"a whole number from {low} to {self.high}"

    def allows(self, value: Any) -> bool:
        if type(value) is not int and not is_whole_number(value):
            return False
        return bool(self.low <= value <= self.high)

    def told_by(self, number: Any) -> Any:
        return self.absent_value if number == self.absent else number

    def allows_all(self, column: NDArray[Any]) -> bool:
        return super().allows_all(column) or not self.refused(column).any()

    def refused(self, column: NDArray[Any]) -> NDArray[np.bool_]:
        outside = super().refused(column)
        return outside if self.absent is None else outside & (column != self.absent)


@dataclasses.dataclass(frozen=True)
class Nanoseconds(Whole):
    """Nanoseconds since 1970, UTC."""

    low: int = 0
    high: int = MAX_TIME_NS


@dataclasses.dataclass(frozen=True)
class Bits(Whole):
    """A sum of flags."""

    is_coded = True

    flags: type[IntFlag] = IntFlag

    def told_by(self, number: Any) -> IntFlag:
        return self.flags(number)


@dataclasses.dataclass(frozen=True)
class OneOf(_Range):
    """One of an enumeration's members, which are numbered from 0 on."""

    dtype = "u1"
    is_coded = True

    members: type[IntEnum]

    @cached_property
    def low(self) -> float:  # type: ignore[override]
        return 0

    @cached_property
    def high(self) -> float:  # type: ignore[override]
        return max(self.members)

    @cached_property
    def expected(self) -> str:  # type: ignore[override]
        return f"one of {' '.join(self.members.__members__)}"

    def allows(self, value: Any) -> bool:
        return isinstance(value, self.members)

    def told_by(self, number: Any) -> Any:
        return self.members(number) if number in self.members._value2member_map_ else number


class Truth(Rule):
    """True or false."""

    dtype = "?"
    expected = "True or False"

    def allows(self, value: Any) -> bool:
        return isinstance(value, (bool, np.bool_))


@dataclasses.dataclass(frozen=True)
class Text(Rule):
    """A text that can be stored."""

    needed: str = ""
    """What is expected where it is empty; "": it may be."""
    expects: Callable[[str], str] = lambda _: ""
    """Returns what is expected instead of a text that is not allowed; "": it is allowed."""

    def allows(self, value: Any) -> bool:
        return not self.expected_of(value)

    def expected_of(self, value: Any) -> str:
        if self.needed and not value:
            return self.needed
        return text_expected(value) or self.expects(value)


class Cells(Rule):
    """The cells of a grid, (height, width)."""

    expected = "an int8 array (height, width)"

    def allows(self, value: Any) -> bool:
        return bool(value.ndim == 2 and value.dtype == np.int8)

    def shown(self, value: Any) -> str:
        return f"{value.dtype} {value.shape}"


@dataclass(frozen=True, slots=True)
class Fit:
    """What values of an event must be to each other."""

    before: str
    """The field before whose own rule this one is checked; "": after all."""
    of: tuple[str, ...]
    """The fields that it is about."""
    broken: Callable[..., Any]
    """Returns where values, or columns of them, do not fit: comparisons and `& |` only, which
    mean the same for both."""
    expected: str
    """As in `Rule`."""
    blames: tuple[str, ...]
    """The first of these that is no finite number is named; if all are, the first."""

    def blamed(self, values: Mapping[str, Any]) -> str:
        """Return the field that a message names."""
        strange = (name for name in self.blames if not FINITE.allows(values[name]))
        return next(strange, self.blames[0])


FINITE = Number()
ANY_NUMBER = Number(-np.inf, np.inf, or_nan=True, words="a number")


def rules_of(cls: type[Any]) -> dict[str, Rule]:
    """Return the rule of each field of a dataclass, in their order.

    It is the one in the field's annotation, `Annotated[float, Number(0, 1)]`; else its type's.
    """
    return {name: _rule_of(hint) for name, hint in _hints(cls).items()}


def marks_of(cls: type[Any], mark: type[_Mark]) -> dict[str, _Mark]:
    """Return what else the annotations of fields say: those that do, with the mark of each."""
    told = ((name, each) for name, hint in _hints(cls).items() for each in get_args(hint))
    return {name: each for name, each in told if isinstance(each, mark)}


def _hints(cls: type[Any]) -> dict[str, Any]:
    """Return what the annotations of fields say, those of base classes first."""
    told = {name: hint for base in reversed(cls.__mro__) for name, hint in _own_hints(base).items()}
    return {name: hint for name, hint in told.items() if get_origin(hint) is not ClassVar}


@cache
def _own_hints(cls: type[Any]) -> dict[str, Any]:
    """Return those of one class: each is evaluated once, however many kinds inherit it."""
    return get_annotations(cls, eval_str=True)


def _rule_of(hint: Any) -> Rule:
    if get_origin(hint) is Annotated:
        told = next((each for each in get_args(hint) if isinstance(each, Rule)), None)
        return told or _rule_of(get_args(hint)[0])
    if isinstance(hint, type) and issubclass(hint, IntEnum):
        return OneOf(hint)
    return _OF_TYPES.get(hint, Rule())


_OF_TYPES: Mapping[Any, Rule] = {
    float: ANY_NUMBER,
    int: Whole(-(2**63), 2**63 - 1),
    bool: Truth(),
    str: Text(),
}
