"""Events as a log holds them: one by one with their numbers, and many as numpy columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.events import KINDS, DoorEvent, Event, event_of

if TYPE_CHECKING:
    from semmap_log.arrow.sdk import DataFrame, pa


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
class EventBatch:
    """Events in order of their numbers, as numpy columns.

    `batch[DoorObserved]` gives that kind's own fields, `batch.where(DoorObserved)` the positions
    of its rows among `number`, `happened_ns`, `recorded_ns`.
    """

    number: NDArray[np.int64]
    """Event numbers, strictly ascending."""
    kind: NDArray[np.uint8]
    """`Event.kind` of each."""
    happened_ns: NDArray[np.int64]
    """As given; one later than recorded folds as the recorded time: see `folds_ns`."""
    recorded_ns: NDArray[np.int64]
    columns: Mapping[int, NDArray[np.void]]
    """Kind number -> structured array, for the kinds of fixed size."""
    objects: Mapping[int, Sequence[Event]]
    """Kind number -> events, for the kinds with text or arrays."""

    def __len__(self) -> int:
        return len(self.number)

    def __getitem__(self, kind: type[Event]) -> NDArray[np.void]:
        """Return the fields of that fixed-size kind, one row an event (KeyError: none here)."""
        return self.columns[kind.kind]

    def __contains__(self, kind: type[Event]) -> bool:
        return kind.kind in self.columns or kind.kind in self.objects

    def where(self, kind: type[Event]) -> NDArray[np.intp]:
        """Return the positions of that kind's events."""
        return np.flatnonzero(self.kind == kind.kind)

    def door_ids(self) -> NDArray[np.uint32]:
        """Return the door each event is about; 0 where it is about none."""
        ids = np.zeros(len(self), np.uint32)
        for kind in self.columns:
            if issubclass(KINDS[kind - 1], DoorEvent):
                ids[self.kind == kind] = self.columns[kind]["door_id"]
        for kind, events in self.objects.items():
            if issubclass(KINDS[kind - 1], DoorEvent):
                ids[self.kind == kind] = [e.door_id for e in events if isinstance(e, DoorEvent)]
        return ids

    @property
    def folds_ns(self) -> NDArray[np.int64]:
        """The time by which each event is ordered: when it happened, but never after recording."""
        return np.minimum(self.happened_ns, self.recorded_ns)

    def select(self, keep: NDArray[np.bool_]) -> EventBatch:
        """Return the events where `keep`, one bool an event, is true."""
        if keep.all():
            return self
        inside = {kind: keep[self.kind == kind] for kind in (*self.columns, *self.objects)}
        columns = {k: self.columns[k][inside[k]] for k in self.columns if inside[k].any()}
        objects = {
            k: [event for event, kept in zip(events, inside[k], strict=True) if kept]
            for k, events in self.objects.items()
            if inside[k].any()
        }
        return EventBatch(
            self.number[keep],
            self.kind[keep],
            self.happened_ns[keep],
            self.recorded_ns[keep],
            columns,
            objects,
        )

    def to_arrow(self) -> pa.Table:
        """Return the events as a pyarrow.Table, one row each: `arrow.columns` says what is in it.

        A table, and not a record batch: it is what pandas, polars and DuckDB take, and
        `pyarrow.concat_tables(batch.to_arrow() for batch in log.batches())` joins many without a
        copy. Numbers and times share the batch's memory.

        Raises:
            MissingExtraError: pyarrow is not installed.
        """
        from semmap_log.arrow.table import table_of

        return table_of(self)

    def to_pandas(self) -> DataFrame:
        """Return the same as a pandas.DataFrame: kinds and states as categories, times in UTC.

        Raises:
            MissingExtraError: pyarrow or pandas is not installed.
        """
        from semmap_log.arrow.sdk import frame_of

        return frame_of(self.to_arrow())

    def __iter__(self) -> Iterator[RecordedEvent]:
        """Yield the events one by one, as objects."""
        sources: dict[int, Iterator[Event]] = {
            k: iter(events) for k, events in self.objects.items()
        }
        rows: dict[int, Iterator[tuple[Any, ...]]] = {
            k: iter(array.tolist()) for k, array in self.columns.items()
        }
        names = {k: array.dtype.names or () for k, array in self.columns.items()}
        stamps = zip(
            self.number.tolist(),
            self.kind.tolist(),
            self.happened_ns.tolist(),
            self.recorded_ns.tolist(),
            strict=True,
        )
        for number, kind, happened_ns, recorded_ns in stamps:
            if kind in sources:
                event = next(sources[kind])
            else:
                values = dict(zip(names[kind], next(rows[kind]), strict=True))
                event = event_of(kind, values, happened_ns)
            yield RecordedEvent(number, recorded_ns, event)
