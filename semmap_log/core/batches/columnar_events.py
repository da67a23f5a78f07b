"""The columns that batches of each kind are made from, and events with columns already extracted.

Checking many events reads their kinds, doors and times, and so does packing them: each pass over a
hundred events is a fiftieth of the time of a durable commit of them.

The signatures are written by `python tools/batch_columns.py`, from the table of events, in full for
editors and type checkers.

The fields of many events of one kind are a structured array: made, and checked, all at once. An
event checks its values when it is made; rows that never were events are checked here by the same
rules, and the first that breaks one is named.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semmap_log.core.loops import compiled
from semmap_log.core.messages import OBJECT_KINDS, fixed_layout
from semmap_log.core.model.doors import NO_LEVEL, DoorId, is_given
from semmap_log.core.model.events import (
    KINDS,
    DoorAdded,
    DoorEvent,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
    SightingsThinned,
    defaults_of,
    event_of,
    field_names,
)
from semmap_log.core.model.keywords import unknown_keyword
from semmap_log.core.model.meaning import HAPPENED, Changed
from semmap_log.core.model.rules import Fit, Rule
from semmap_log.errors import InvalidEventError

if TYPE_CHECKING:
    from typing_extensions import Self


class ColumnarEvents(list[DoorEvent]):
    """Events about doors in a list that stays as it is; doors and times are columns, too."""

    __slots__ = ("_are_timed", "door_ids", "happened_ns", "kinds")

    def __init__(self, events: Sequence[DoorEvent], kinds: set[type[Any]]) -> None:
        """Take doors and times out of events.

        Args:
            events: The events.
            kinds: Their classes.
        """
        super().__init__(events)
        self.kinds = kinds
        self.door_ids: list[DoorId] = [event.door_id for event in events]
        self.happened_ns: list[int | None] = [event.happened_ns for event in events]
        self._are_timed = None not in self.happened_ns

    def given_times(self) -> list[int]:
        """Return when those happened that say it."""
        if self._are_timed:
            return self.happened_ns  # type: ignore[return-value]
        return [time for time in self.happened_ns if time is not None]

    def times_or(self, wall_ns: int) -> list[int]:
        """Return when each happened; one that does not say it: then."""
        if self._are_timed:
            return self.happened_ns  # type: ignore[return-value]
        return [wall_ns if time is None else time for time in self.happened_ns]


class ColumnConstructor:
    """What makes batches of one kind, from a column for each of the kind's fields."""

    __slots__ = ()

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorAdded],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        level: ArrayLike = ...,
        x: ArrayLike = ...,
        y: ArrayLike = ...,
        theta: ArrayLike = ...,
        width: ArrayLike = ...,
        state: ArrayLike = ...,
        prob_open: ArrayLike = ...,
        prob_closed: ArrayLike = ...,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorUpdated],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        changed: ArrayLike,
        level: ArrayLike = ...,
        x: ArrayLike = ...,
        y: ArrayLike = ...,
        theta: ArrayLike = ...,
        width: ArrayLike = ...,
        state: ArrayLike = ...,
        prob_open: ArrayLike = ...,
        prob_closed: ArrayLike = ...,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorRemoved],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorObserved],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        state: ArrayLike,
        accuracy_open: ArrayLike = ...,
        accuracy_closed: ArrayLike = ...,
        opening: ArrayLike = ...,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorRequested],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        state: ArrayLike,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[DoorPassed],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        passed: ArrayLike,
        waited_s: ArrayLike = ...,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[PatrolStarted],
        *,
        happened_ns: ArrayLike | None = None,
        patrol: ArrayLike,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[PatrolFinished],
        *,
        happened_ns: ArrayLike | None = None,
        patrol: ArrayLike,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[RobotPose],
        *,
        happened_ns: ArrayLike | None = None,
        x: ArrayLike,
        y: ArrayLike,
        theta: ArrayLike,
        level: ArrayLike = ...,
        sd_xy: ArrayLike = ...,
        sd_theta: ArrayLike = ...,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[Retracted],
        *,
        happened_ns: ArrayLike | None = None,
        first_event: ArrayLike,
        last_event: ArrayLike,
    ) -> Self: ...

    @overload
    @classmethod
    def of(
        cls,
        kind: type[SightingsThinned],
        *,
        happened_ns: ArrayLike | None = None,
        door_id: ArrayLike,
        state: ArrayLike,
        count: ArrayLike,
        first_ns: ArrayLike,
        last_ns: ArrayLike,
        accuracy_open: ArrayLike = ...,
        accuracy_closed: ArrayLike = ...,
        first_event: ArrayLike = ...,
    ) -> Self: ...

    @classmethod
    def of(
        cls, kind: type[Event], *, happened_ns: ArrayLike | None = None, **fields: ArrayLike
    ) -> Self:
        """Return events of one kind from columns, to append them.

            EventBatch.of(DoorObserved, door_id=ids, state=states, accuracy_open=0.9)

        Args:
            kind: Of fixed size.
            happened_ns: When each happened, int64; default: when the log records them.
            **fields: The kind's own fields; those left out have the defaults of the event. One
                value stands for all rows.

        Raises:
            UnknownKeywordError: The kind has no such field.
            InvalidEventError: Columns of different lengths, a value that no event can have, or
                that its type does not hold: nothing is wrapped or cut.
        """
        known = field_names(kind)
        for name in fields:
            if name not in known:
                raise unknown_keyword(
                    f"EventBatch.of({kind.__name__})", name, ["happened_ns", *known]
                )
        return cls._of_columns(kind, happened_ns, fields)

    @classmethod
    def _of_columns(
        cls, kind: type[Event], happened_ns: ArrayLike | None, fields: Mapping[str, ArrayLike]
    ) -> Self:
        """Return the batch; the names of the fields are known to be right."""
        raise NotImplementedError


Rows = NDArray[np.void]


Places = NDArray[np.intp] | slice
"""Which rows of a kind: their places among all, or a slice of them."""


class LazyColumns(Mapping[int, Rows]):
    """Kind -> the fields of its events, made on first access to that kind."""

    def __init__(self, kinds: Collection[int], make: Callable[[int, Places], Rows]) -> None:
        """Take note of them.

        Args:
            kinds: Which there are.
            make: Returns the rows of a kind at some places.
        """
        self._kinds = kinds
        self._make = make
        self._made: dict[int, Rows] = {}

    def __getitem__(self, kind: int) -> Rows:
        rows = self._made.get(kind)
        if rows is None:
            if kind not in self._kinds:
                raise KeyError(kind)
            rows = self._made[kind] = self._make(kind, slice(None))
        return rows

    def some(self, kind: int, places: NDArray[np.intp]) -> Rows:
        """Return the rows of a kind at some places; the others are not made for it."""
        return self._made[kind].take(places) if kind in self._made else self._make(kind, places)

    def __contains__(self, kind: object) -> bool:
        return kind in self._kinds

    def __iter__(self) -> Iterator[int]:
        return iter(self._kinds)

    def __len__(self) -> int:
        return len(self._kinds)


NO_TIME = -1
"""Stands in a column of happened times for one that was not given: the log's clock says it."""


def rows_of(kind: type[Event], fields: Mapping[str, NDArray[Any]], count: int) -> Rows:
    """Return columns as rows of a kind.

    Args:
        kind: Of fixed size.
        fields: Its own fields, each with so many values or one that stands for all; those left
            out have the defaults of the event.
        count: How many rows.

    Raises:
        InvalidEventError: A field that the kind has not, one that is missing, or a value that is
            no such number or that no event can have.
    """
    if kind.kind in OBJECT_KINDS:
        raise InvalidEventError(kind.__name__, "a kind without texts and maps", kind.__name__)
    dtype = fixed_layout(kind.kind).dtype
    defaults, names = _defaults(kind.kind)
    if not (names - defaults.keys() <= fields.keys() <= names):
        wrong = sorted((fields.keys() - names) | (names - defaults.keys() - fields.keys()))
        expected = f"the columns {' '.join(dtype.names or ())}"
        raise InvalidEventError(kind.__name__, expected, wrong)
    rows = np.zeros(count, dtype)
    for name, column in {**defaults, **fields}.items():
        rows[name] = as_type(f"{kind.__name__}.{name}", column, dtype[name])
    if "level" in defaults.keys() - fields.keys():
        _mark_levels(rows, np.ones(count, np.bool_))
    check_rows(kind, rows)
    return rows


@cache
def _defaults(kind: int) -> tuple[dict[str, NDArray[Any]], frozenset[str]]:
    """Return the defaults of a kind's fields as they are stored, and the names of all fields."""
    dtype = fixed_layout(kind).dtype
    defaults = defaults_of(KINDS[kind - 1])
    known = {name: np.array(value, dtype[name]) for name, value in defaults.items()}
    return known, frozenset(dtype.names or ())


def mark_levels(rows: Rows, events: Sequence[Event]) -> None:
    """Write `NO_LEVEL` into the rows of events whose level was not given."""
    if "level" in (rows.dtype.names or ()):
        given = [is_given(event.level) for event in events]  # type: ignore[attr-defined]
        _mark_levels(rows, ~np.array(given, np.bool_))


def _mark_levels(rows: Rows, lacking: NDArray[np.bool_]) -> None:
    """Write `NO_LEVEL` into some rows, where they say a level at all."""
    if "changed" in (rows.dtype.names or ()):
        lacking = lacking & ((rows["changed"] & int(Changed.POSE)) != 0)
    rows["level"][lacking] = NO_LEVEL


def common_length(where: str, columns: Mapping[str, NDArray[Any]]) -> int:
    """Return how many rows columns make; those of one value fit any number.

    Raises:
        InvalidEventError: Their lengths differ, or one is no column.
    """
    shapes = {column.shape for column in columns.values()} - {()}
    (count, *other) = shapes.pop() if shapes else (1,)
    if shapes or other:
        lengths = {name: column.shape for name, column in columns.items() if column.ndim}
        raise InvalidEventError(where, "columns of one length", lengths)
    return int(count)


def as_type(where: str, values: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return numbers as another type: never wrapped, cut or rounded to a whole one.

    Raises:
        InvalidEventError: A value does not fit that type; the first is named.
    """
    if values.dtype == dtype:
        return values
    if values.size and not _may_become(values.dtype, dtype):
        raise InvalidEventError(where, f"numbers of type {dtype}", f"{values.dtype}")
    with np.errstate(invalid="ignore", over="ignore"):
        cast = values.astype(dtype)
    if dtype.kind in "iu":
        info = np.iinfo(dtype)
        wrong = (values < info.min) | (values > info.max)
        if wrong.any():
            got = np.atleast_1d(values)[np.atleast_1d(wrong)][0].item()
            raise InvalidEventError(where, f"a whole number from {info.min} to {info.max}", got)
    return cast


def _may_become(source: np.dtype[Any], target: np.dtype[Any]) -> bool:
    kinds = {"f": "fiu", "i": "iu", "u": "iu", "b": "b"}
    return source.kind in kinds[target.kind]


def check_rows(kind: type[Event], rows: Rows) -> None:
    """Check that each row holds values that such an event can have.

    Raises:
        InvalidEventError: As the event itself would raise it; the first wrong row is named.
    """
    dtype = fixed_layout(kind.kind).dtype
    if rows.dtype != dtype and not _same_fields(rows.dtype, dtype):
        raise InvalidEventError(kind.__name__, f"rows of {dtype}", rows.dtype)
    checks = _checks(kind.kind)
    for start in range(0, len(rows), _BLOCK):
        columns = checks.columns_of(rows[start : start + _BLOCK])
        if not checks.pass_all(columns):
            first = start + checks.first_wrong(columns)
            try:
                event_of_row(kind, rows[first], None)
            except InvalidEventError as error:
                raise error.of_row(first) from None


def are_possible(kind: type[Event], rows: Rows) -> bool:
    """Return whether each row of a log holds values that such an event can have."""
    checks = _checks(kind.kind)
    return checks.pass_all(checks.columns_of(rows))


_BLOCK = 2**15
"""So many rows are looked at at once: they stay in the processor's cache."""

Columns = Mapping[str, NDArray[Any]]


class _Checks(NamedTuple):
    """What can be wrong with columns of a kind."""

    alone: Sequence[tuple[str, Rule]]
    """The rules of fields; not those that a type holds to by itself, as a `uint32` does to ids."""
    together: Sequence[Fit]

    def columns_of(self, rows: Rows) -> Columns:
        """Return the columns that are looked at, each in one piece: that is done several times."""
        alone = [name for name, _ in self.alone]
        names = dict.fromkeys([*alone, *(name for fit in self.together for name in fit.of)])
        return {name: np.ascontiguousarray(rows[name]) for name in names}

    def pass_all(self, columns: Columns) -> bool:
        """Return whether all rows are valid."""
        return all(rule.allows_all(columns[name]) for name, rule in self.alone) and not any(
            misfits.any() for misfits in self.misfits(columns)
        )

    def first_wrong(self, columns: Columns) -> int:
        """Return the first row with which something is."""
        refused = [rule.refused(columns[name]) for name, rule in self.alone]
        return int(np.argmax(np.logical_or.reduce([*refused, *self.misfits(columns)])))

    def misfits(self, columns: Columns) -> Iterator[NDArray[np.bool_]]:
        """Yield which rows' values do not fit each other."""
        return (fit.broken(*[columns[name] for name in fit.of]) for fit in self.together)


@cache
def _checks(kind: int) -> _Checks:
    rules, dtype = KINDS[kind - 1].rules, fixed_layout(kind).dtype
    alone = [(name, rule) for name, rule in rules.fields.items() if rule.limits(dtype[name])]
    return _Checks(alone, rules.fits)


def event_of_row(kind: type[Event], row: Any, happened_ns: int | None) -> Event:
    """Return a row as an event.

    Raises:
        InvalidEventError: It holds a value that no such event can have.
    """
    values = dict(zip(row.dtype.names, row.item(), strict=True))
    return event_of(kind, values, happened_ns, is_stored=False)


def check_times(happened_ns: NDArray[np.int64]) -> None:
    """Check that times are possible happened times, or `NO_TIME`.

    Raises:
        InvalidEventError: One is not; it is named.
    """
    if len(happened_ns) and np.minimum.reduce(happened_ns) < NO_TIME:
        first = int(np.argmax(happened_ns < NO_TIME))
        got = int(happened_ns[first])
        raise InvalidEventError("happened_ns", HAPPENED.expected, got).of_row(first)


@cache
def _same_fields(mine: np.dtype[np.void], wanted: np.dtype[np.void]) -> bool:
    """Return whether rows have the same fields, of the same types, whatever their offsets."""
    names = wanted.names or ()
    return mine.names == names and all(mine[name] == wanted[name] for name in names)


def places_by_kind(kinds: NDArray[np.uint8]) -> dict[int, NDArray[np.intp]]:
    """Return the places of each kind that is there, ascending; kinds ascend, too."""
    loops = compiled()
    if loops is None:
        there = np.flatnonzero(np.bincount(kinds)).tolist()
        return {kind: np.flatnonzero(kinds == kind) for kind in there}
    places, ends = np.empty(len(kinds), np.int64), np.empty(2**8, np.int64)
    loops.sort_places(kinds, places, ends)
    found, start = {}, 0
    for kind, end in enumerate(ends.tolist()):
        if end > start:
            found[kind] = places[start:end]
            start = end
    return found
