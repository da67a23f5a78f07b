"""Events as a log holds them: one by one with their numbers, and many as numpy columns.

Also the distinct numbers of a column and those of ranges, and which events are hidden: retracted
ones, folded into ranges of event numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semmap_log.core.batches.columnar_events import (
    NO_TIME,
    ColumnConstructor,
    LazyColumns,
    are_possible,
    as_type,
    check_rows,
    check_times,
    common_length,
    mark_levels,
    rows_of,
)
from semmap_log.core.messages import OBJECT_KINDS, encode, fixed_layout
from semmap_log.core.model.events import (
    DOOR_KINDS,
    KINDS,
    DoorEvent,
    Event,
    HistoryTrimmed,
    MomentPinned,
    Retracted,
    event_of,
    events_of_columns,
)
from semmap_log.core.texts import counted
from semmap_log.errors import InvalidEventError

if TYPE_CHECKING:
    from typing_extensions import Self

    from semmap_log.core.arrow.arrow_sdk import DataFrame, pa


_ABOUT_THE_LOG = (HistoryTrimmed.kind, MomentPinned.kind)
"""Kinds that describe the log rather than the building."""


class Retractions:
    """Ranges of event numbers that were taken back; a retraction itself is never hidden.

    Nor does a range hide an event that describes the log: only its own number does.
    """

    def __init__(self) -> None:
        self.ranges: list[tuple[int, int]] = []
        """(first, last) event number of each, inclusive."""
        self.numbers: list[int] = []
        """Of each, the number of the Retracted event."""

    def apply(self, batch: EventBatch) -> None:
        """Fold a batch in."""
        if Retracted in batch:
            rows = batch[Retracted]
            self.ranges += zip(
                rows["first_event"].tolist(), rows["last_event"].tolist(), strict=True
            )
            self.numbers += batch.number[batch.where(Retracted)].tolist()

    def up_to(self, event: int) -> Retractions:
        """Return those that events up to that number made."""
        return self._those([number <= event for number in self.numbers])

    def after(self, event: int) -> Retractions:
        """Return the retractions that events after that number made."""
        return self._those([number > event for number in self.numbers])

    def __bool__(self) -> bool:
        return bool(self.ranges)

    def hidden(self, batch: EventBatch) -> NDArray[np.bool_]:
        """Return, for each event of a batch, whether it is hidden."""
        hidden = in_ranges(batch.number, self.ranges)
        hidden &= batch.kind != Retracted.kind
        about_the_log = hidden & np.isin(batch.kind, _ABOUT_THE_LOG)
        if about_the_log.any():
            alone = [first for first, last in self.ranges if first == last]
            hidden &= ~about_the_log | np.isin(batch.number, alone)
        return hidden

    def first_hiding(self, event: int) -> int | None:
        """Return the number of the first retraction of an event, or None."""
        known = zip(self.ranges, self.numbers, strict=True)
        return min((by for (first, last), by in known if first <= event <= last), default=None)

    def visible(self, batch: EventBatch) -> EventBatch:
        """Return the events of a batch that are not hidden."""
        return batch.select(~self.hidden(batch)) if self.ranges else batch

    def _those(self, chosen: Sequence[bool]) -> Retractions:
        those = Retractions()
        those.ranges = [r for r, keep in zip(self.ranges, chosen, strict=True) if keep]
        those.numbers = [n for n, keep in zip(self.numbers, chosen, strict=True) if keep]
        return those


def in_ranges(numbers: NDArray[np.int64], ranges: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
    """Return, for each number, whether it lies in one of the ranges, ends included."""
    if not ranges:
        return np.zeros(len(numbers), np.bool_)
    firsts, lasts = np.array(sorted(ranges), np.int64).T
    reached = np.maximum.accumulate(lasts)
    before = np.searchsorted(firsts, numbers, "right") - 1
    inside: NDArray[np.bool_] = (before >= 0) & (numbers <= reached[before])
    return inside


SourcesOf = Callable[[NDArray[np.int64]], tuple[NDArray[np.intp], Sequence[str]]]
"""Event numbers, ascending -> of each, the place of its source among some names, and the names."""


_IS_ABOUT_A_DOOR = np.zeros(2**8, np.bool_)
_IS_ABOUT_A_DOOR[list(DOOR_KINDS)] = True
"""By the number of a kind."""


@dataclass(frozen=True, slots=True)
class RecordedEvent:
    """An event as the log holds it."""

    number: int
    recorded_ns: int
    event: Event
    """`event.happened_ns` is always set, and as it was given."""

    @property
    def happened_ns(self) -> int:
        """When it happened, as given."""
        assert self.event.happened_ns is not None
        return self.event.happened_ns


@dataclass(frozen=True, slots=True)
class EventBatch(ColumnConstructor):
    """Events in order of their numbers, as numpy columns.

    `batch[DoorObserved]` gives that kind's own fields, `batch.where(DoorObserved)` the positions
    of its rows among `number`, `happened_ns`, `recorded_ns`.

    A log gives batches, and `append` takes them: `of` makes one from columns, `from_events` from
    events. On the way in `number` and `recorded_ns` do not count, since the log gives its own.
    """

    number: NDArray[np.int64]
    """Event numbers, strictly ascending."""
    kind: NDArray[np.uint8]
    """`Event.kind` of each."""
    happened_ns: NDArray[np.int64]
    """As given; one later than recorded folds as the recorded time: see `folds_ns`. On the way in
    -1 stands for one that was not given: the log's clock says it."""
    recorded_ns: NDArray[np.int64]
    columns: Mapping[int, NDArray[np.void]]
    """Kind number -> structured array, for the kinds of fixed size."""
    objects: Mapping[int, Sequence[Event]]
    """Kind number -> events, for the kinds with text or arrays."""
    known_door_ids: NDArray[np.uint32] | None = field(default=None, repr=False, compare=False)
    """`door_ids`, where who made the batch had them at hand."""
    sources_of: SourcesOf | None = field(default=None, repr=False, compare=False)
    """Looks up by event number where events are from, in a log; None: not known."""
    _places: dict[int, NDArray[np.intp]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    """Kind number -> positions of its events, once they were looked for."""
    _is_checked: bool = field(default=False, init=False, repr=False, compare=False)
    """Its columns were checked, and cannot be written to any more."""

    @classmethod
    def _of_columns(
        cls, kind: type[Event], happened_ns: ArrayLike | None, fields: Mapping[str, ArrayLike]
    ) -> Self:
        times = np.asarray(NO_TIME if happened_ns is None else happened_ns)
        times = as_type(f"{kind.__name__}.happened_ns", times, np.dtype(np.int64))
        if happened_ns is not None and times.size and times.min() < 0:
            raise InvalidEventError("happened_ns", "nanoseconds since 1970", int(times.min()))
        given = {name: np.asarray(column) for name, column in fields.items()}
        count = common_length(kind.__name__, {"happened_ns": times, **given})
        happened = np.empty(count, np.int64)
        happened[:] = times
        kinds = np.full(count, kind.kind, np.uint8)
        return cls._of_rows({kind.kind: rows_of(kind, given, count)}, {}, kinds, happened)

    @classmethod
    def from_events(cls, events: Iterable[Event]) -> EventBatch:
        """Return events as columns, in their order, numbered from 0 on.

        The columns of a batch that was made so, or by `of`, cannot be written to.
        """
        listed = list(events)
        kinds = np.array([event.kind for event in listed], np.uint8)
        columns: dict[int, NDArray[np.void]] = {}
        objects: dict[int, Sequence[Event]] = {}
        for kind in distinct(kinds).tolist():
            chosen = [event for event in listed if event.kind == kind]
            if kind in OBJECT_KINDS:
                objects[kind] = chosen
            else:
                data = bytearray().join([encode(event, 0) for event in chosen])
                columns[kind] = np.frombuffer(data, fixed_layout(kind).dtype)
                mark_levels(columns[kind], chosen)
        happened = [NO_TIME if e.happened_ns is None else e.happened_ns for e in listed]
        return cls._of_rows(columns, objects, kinds, np.array(happened, np.int64))

    @classmethod
    def mixed(cls, kinds: ArrayLike, *batches: EventBatch) -> EventBatch:
        """Return batches of one kind each as one.

            EventBatch.mixed([DoorObserved.kind, DoorPassed.kind, DoorObserved.kind], seen, passed)

        Args:
            kinds: `Event.kind` of each event: which of the batches gives the next.
            *batches: Of different kinds, made by `of`.

        Raises:
            InvalidEventError: `kinds` asks for more events of a batch, or for fewer, than it has.
        """
        wanted = np.asarray(kinds).astype(np.uint8)
        happened_ns = np.full(len(wanted), NO_TIME, np.int64)
        columns: dict[int, NDArray[np.void]] = {}
        for batch in batches:
            ((kind, rows),) = batch.columns.items()
            where = np.flatnonzero(wanted == kind)
            if len(where) != len(rows) or kind in columns:
                expected = f"{counted(len(rows), 'event')} of kind {kind}"
                raise InvalidEventError("kinds", expected, len(where))
            happened_ns[where], columns[kind] = batch.happened_ns, rows
        if sum(map(len, batches)) != len(wanted):
            raise InvalidEventError("kinds", counted(sum(map(len, batches)), "event"), len(wanted))
        return cls._of_rows(columns, {}, wanted, happened_ns)

    @classmethod
    def _of_rows(
        cls,
        columns: Mapping[int, NDArray[np.void]],
        objects: Mapping[int, Sequence[Event]],
        kinds: NDArray[np.uint8],
        happened_ns: NDArray[np.int64],
    ) -> Self:
        numbers = np.arange(len(kinds), dtype=np.int64)
        batch = cls(numbers, kinds, happened_ns, happened_ns, columns, objects)
        written: list[NDArray[Any]] = [numbers, kinds, happened_ns, *columns.values()]
        for column in written:
            column.flags.writeable = False
        object.__setattr__(batch, "_is_checked", True)
        return batch

    def __len__(self) -> int:
        return len(self.kind)

    def __getitem__(self, kind: type[Event]) -> NDArray[np.void]:
        """Return the fields of that fixed-size kind, one row an event (KeyError: none here)."""
        return self.columns[kind.kind]

    def some(self, kind: type[Event], places: NDArray[np.intp]) -> NDArray[np.void]:
        """Return the fields of that fixed-size kind at some places among its rows.

        Of events in a log the others are not read for it.
        """
        return self._some(kind.kind, places)

    def _some(self, kind: int, places: NDArray[np.intp]) -> NDArray[np.void]:
        columns = self.columns
        if isinstance(columns, LazyColumns):
            return columns.some(kind, places)
        return columns[kind].take(places)

    def __contains__(self, kind: type[Event]) -> bool:
        return kind.kind in self.columns or kind.kind in self.objects

    def where(self, kind: type[Event]) -> NDArray[np.intp]:
        """Return the positions of that kind's events."""
        return self.places_of(kind.kind)

    def places_of(self, kind: int) -> NDArray[np.intp]:
        """Return the same by the kind's number."""
        places = self._places.get(kind)
        if places is None:
            places = self._places[kind] = np.flatnonzero(self.kind == kind)
        return places

    def with_places(self, places: Mapping[int, NDArray[np.intp]]) -> Self:
        """Return it with the places of some kinds' events, which the caller knows already."""
        self._places.update(places)
        return self

    def door_ids(self) -> NDArray[np.uint32]:
        """Return the door each event is about; 0 where it is about none.

        A door may have the number 0, too: `about_doors` distinguishes them.
        """
        if self.known_door_ids is not None:
            return self.known_door_ids
        ids = np.zeros(len(self), np.uint32)
        for kind in self.columns:
            if kind in DOOR_KINDS:
                ids[self.places_of(kind)] = self.columns[kind]["door_id"]
        for kind, events in self.objects.items():
            if kind in DOOR_KINDS:
                ids[self.places_of(kind)] = [e.door_id for e in events if isinstance(e, DoorEvent)]
        return ids

    def about_doors(self) -> NDArray[np.bool_]:
        """Return whether each event is about a door."""
        about: NDArray[np.bool_] = _IS_ABOUT_A_DOOR.take(self.kind)
        return about

    def of_doors(self, doors: Collection[int]) -> NDArray[np.bool_]:
        """Return whether each event is about one of these doors."""
        found: NDArray[np.bool_] = np.isin(self.door_ids(), list(doors))
        return found & self.about_doors() if 0 in doors else found

    def of_door_0(self) -> NDArray[np.intp]:
        """Return the positions of the events about door 0, which nearly no log has."""
        ids = self.door_ids()
        zeros = len(ids) - np.count_nonzero(ids)
        others = [k for k in (*self.columns, *self.objects) if k not in DOOR_KINDS]
        if zeros == sum(np.count_nonzero(self.kind == kind) for kind in others):
            return np.empty(0, np.intp)
        return np.flatnonzero((ids == 0) & self.about_doors())

    def sources(self, kind: type[Event]) -> tuple[NDArray[np.intp], Sequence[str]]:
        """Return which sensor, robot or file reported each event of that kind: `Note.source`.

        Of each the place among the names that come with it; the empty name says nothing. Batches
        of `follow` do not know it: their commit does.
        """
        where = self.where(kind)
        if self.sources_of is None or not len(where):
            return np.zeros(len(where), np.intp), [""]
        return self.sources_of(self.number[where])

    @property
    def folds_ns(self) -> NDArray[np.int64]:
        """The time by which each event is ordered: when it happened, but never after recording."""
        return np.minimum(self.happened_ns, self.recorded_ns)

    def check(self) -> None:
        """Check that these are events that a log can take; where they come from does not count.

        Raises:
            InvalidEventError: The columns do not match, or no event can have a value: the row is
                named.
        """
        if self._is_checked:
            return
        if self.happened_ns.dtype != np.int64 or self.happened_ns.shape != self.kind.shape:
            got = f"{self.happened_ns.dtype} {self.happened_ns.shape}"
            raise InvalidEventError("happened_ns", f"int64 ({len(self)},)", got)
        check_times(self.happened_ns)
        there = {kind: len(rows) for kind, rows in self.columns.items()}
        there |= {kind: len(events) for kind, events in self.objects.items()}
        if sum(there.values()) != len(self) or any(
            np.count_nonzero(self.kind == kind) != count for kind, count in there.items()
        ):
            raise InvalidEventError("kind", f"rows as in the columns, {there}", self.kind)
        fixed = {kind.kind for kind in KINDS} - OBJECT_KINDS
        if not (self.columns.keys() <= fixed and self.objects.keys() <= OBJECT_KINDS):
            expected = "kinds of fixed size as columns, others as objects"
            raise InvalidEventError("kind", expected, sorted(there))
        for number, rows in self.columns.items():
            check_rows(KINDS[number - 1], rows)
        for number, events in self.objects.items():
            strangers = [event for event in events if event.kind != number]
            if strangers:
                raise InvalidEventError("objects", KINDS[number - 1].__name__, strangers[:1])

    def parts(self, rows: int) -> Iterator[EventBatch]:
        """Yield the events in batches of at most so many rows, which share these columns."""
        if len(self) <= rows:
            yield self
            return
        done = dict.fromkeys((*self.columns, *self.objects), 0)
        for start in range(0, len(self), rows):
            yield self._part(slice(start, start + rows), done)

    def split(self, at: int) -> tuple[EventBatch, EventBatch]:
        """Return the events before a position, and the others; they share these columns."""
        done = dict.fromkeys((*self.columns, *self.objects), 0)
        return self._part(slice(at), done), self._part(slice(at, None), done)

    def _part(self, inside: slice, done: dict[int, int]) -> EventBatch:
        """Return the events of a slice; `done` counts those of each kind before it, and in it."""
        kinds = self.kind[inside]
        spans = {}
        for kind, first in done.items():
            count = len(kinds) if len(done) == 1 else int(np.count_nonzero(kinds == kind))
            if count:
                spans[kind] = slice(first, first + count)
                done[kind] = first + count
        return EventBatch(
            self.number[inside],
            kinds,
            self.happened_ns[inside],
            self.recorded_ns[inside],
            {kind: rows[spans[kind]] for kind, rows in self.columns.items() if kind in spans},
            {kind: found[spans[kind]] for kind, found in self.objects.items() if kind in spans},
            None if self.known_door_ids is None else self.known_door_ids[inside],
            self.sources_of,
        )

    def select(self, keep: NDArray[np.bool_]) -> EventBatch:
        """Return the events where `keep`, one bool an event, is true."""
        if keep.all():
            return self
        kept = {
            kind: np.flatnonzero(keep.take(self.places_of(kind)))
            for kind in (*self.columns, *self.objects)
        }
        there = [kind for kind in self.columns if len(kept[kind])]
        columns: Mapping[int, NDArray[np.void]]
        if 2 * np.count_nonzero(keep) > len(keep):  # a small part must not hold all of a page
            columns = LazyColumns(there, lambda kind, some: self._some(kind, kept[kind][some]))
        else:
            columns = {kind: self._some(kind, kept[kind]) for kind in there}
        objects = {
            kind: [events[i] for i in kept[kind].tolist()]
            for kind, events in self.objects.items()
            if len(kept[kind])
        }
        return EventBatch(
            self.number[keep],
            self.kind[keep],
            self.happened_ns[keep],
            self.recorded_ns[keep],
            columns,
            objects,
            None if self.known_door_ids is None else self.known_door_ids[keep],
            self.sources_of,
        )

    def to_events(self) -> Iterator[Event]:
        """Yield the events as objects, without what a log knows of them."""
        return (recorded.event for recorded in self)

    def to_arrow(self) -> pa.Table:
        """Return the events as a pyarrow.Table, one row each: `arrow.columns` says what is in it.

        A table, and not a record batch: it is what pandas, polars and DuckDB take, and
        `pyarrow.concat_tables(batch.to_arrow() for batch in log.batches())` joins many without a
        copy. Numbers and times share the batch's memory.

        Raises:
            MissingExtraError: pyarrow is not installed.
        """
        from semmap_log.core.arrow.table import table_of

        return table_of(self)

    def to_pandas(self) -> DataFrame:
        """Return the same as a pandas.DataFrame: kinds and states as categories, times in UTC.

        Raises:
            MissingExtraError: pyarrow or pandas is not installed.
        """
        from semmap_log.core.arrow.arrow_sdk import frame_of

        return frame_of(self.to_arrow())

    def __iter__(self) -> Iterator[RecordedEvent]:
        """Yield the events one by one, as objects."""
        events: dict[int, Iterator[Event]] = {
            **{kind: iter(told) for kind, told in self.objects.items()},
            **{kind: self._events_of(kind, rows) for kind, rows in self.columns.items()},
        }
        stamps = zip(
            self.number.tolist(), self.kind.tolist(), self.recorded_ns.tolist(), strict=True
        )
        for number, kind, recorded_ns in stamps:
            yield RecordedEvent(number, recorded_ns, next(events[kind]))

    def _events_of(self, number: int, rows: NDArray[np.void]) -> Iterator[Event]:
        """Yield the events of one kind, their values checked all at once if they can be."""
        kind, names = KINDS[number - 1], rows.dtype.names or ()
        given = self.happened_ns[self.where(kind)].tolist()
        happened_ns = [None if ns == NO_TIME else ns for ns in given]
        if are_possible(kind, rows):
            columns = {name: rows[name].tolist() for name in names}
            yield from events_of_columns(kind, columns, happened_ns)
            return
        for row, ns in zip(rows.tolist(), happened_ns, strict=True):  # the wrong one will say so
            yield event_of(kind, dict(zip(names, row, strict=True)), ns)


def one_by_one(events: Iterable[Event | EventBatch]) -> Iterator[Event]:
    """Yield events, those of batches, too, as objects."""
    for event in events:
        if isinstance(event, EventBatch):
            yield from event.to_events()
        else:
            yield event


I = TypeVar("I", bound=np.integer[Any])  # noqa: E741 - an integer type


def distinct(numbers: NDArray[I]) -> NDArray[I]:
    """Return the different whole numbers of a column, ascending.

    `np.unique` does the same, and loads `numpy.ma` for it: an eighth of the time of a short replay.
    """
    ascending = np.sort(numbers)
    is_first = np.ones(len(ascending), np.bool_)
    np.not_equal(ascending[1:], ascending[:-1], out=is_first[1:])
    return ascending[is_first]


def placed(numbers: NDArray[I]) -> tuple[NDArray[I], NDArray[np.intp]]:
    """Return the different whole numbers of a column, ascending, and which of them each one is."""
    found = distinct(numbers)
    return found, np.searchsorted(found, numbers)


def numbers_of(first: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the whole numbers of ranges, one range after another: so many from each first one."""
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    numbers: NDArray[np.int64] = np.repeat(first, count) + within
    return numbers


def happened_by(batch: EventBatch, at_ns: int) -> EventBatch:
    """Return events that had happened by a moment, and retractions, which count whenever made."""
    return batch.select((batch.folds_ns <= at_ns) | (batch.kind == Retracted.kind))
