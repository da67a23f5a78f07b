"""Events -> message records: runs of one channel and one size, all but their values made before.

A durable append takes only as long as the disk does if little else is done for it. Single events
are not packed with numpy: a loop is faster for them, because after a sync the processor's cache has
lost numpy's code, and reloading it takes longer than packing a hundred events.
"""

from __future__ import annotations

import struct
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from itertools import accumulate
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.core import messages
from semmap_log.core.batches.columnar_events import NO_TIME, ColumnarEvents
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import KINDS, Event
from semmap_log.store import records as mcap

FEW = 8
"""Up to so many events are packed one by one; of more, each field is taken out of all of them."""
MOST = 1000
"""Of single events, so many at most make a run."""
_LOW_32_BITS = 0xFFFF_FFFF
_MESSAGE = int(Opcode.MESSAGE)
_SAME_BYTES = struct.calcsize("<BQH")
_HEAD = struct.Struct(f"<{_SAME_BYTES}sIQQ")
"""Of a Message record: what is the same in all of a kind, sequence, log time, publish time."""


class Start(NamedTuple):
    """What a log gives the first of some events; each other gets one more of both."""

    event: int
    recorded_ns: int


class Run:
    """So many records of one channel, each of the same size, one after the other."""

    __slots__ = ("channel", "count", "record_size")

    def __init__(self, channel: int, count: int, record_size: int) -> None:
        self.channel = channel
        self.count = count
        self.record_size = record_size


class EventRun(Run):
    """A run of events of a kind of fixed size."""

    __slots__ = ("_columns", "_head", "_is_few", "_pack", "_values", "_values_of_many", "_width")

    def __init__(self, kind: int, count: int) -> None:
        """Prepare what does not depend on the events' values."""
        super().__init__(kind, count, record_size(kind))
        fixed = messages.fixed_layout(kind)
        self._head = _template(kind).tobytes()[:_SAME_BYTES]
        self._values = messages.field_getter(kind)
        self._columns = messages.field_getters(kind)
        """Of an event about a door, that is the first."""
        one = [self._head, 0, 0, 0, messages.CDR_HEADER, *[0] * len(fixed.fields)]
        self._width = len(one)
        self._is_few = count <= FEW
        self._pack = fixed.packer_after(_HEAD, 1 if self._is_few else count).pack
        self._values_of_many: list[Any] = [] if self._is_few else one * count
        """What is packed; its zeros are set for each run."""

    def of_events(self, events: Sequence[Event], start: Start, happened: list[int]) -> bytes:
        """Return the records of events.

        Args:
            events: As many as the run has.
            start: What the first gets.
            happened: When each happened.
        """
        number, time = start
        if not self._is_few:
            return self._of_many(events, number, time, happened)
        one = self.of_event
        return b"".join([one(e, number + i, time + i, happened[i]) for i, e in enumerate(events)])

    def of_event(self, event: Event, number: int, time: int, happened_ns: int) -> bytes:
        """Return the record of one event of a run of few."""
        sequence = number & _LOW_32_BITS
        return self._pack(
            self._head, sequence, time, happened_ns, messages.CDR_HEADER, *self._values(event)
        )

    def _of_many(
        self, events: Sequence[Event], number: int, time: int, happened: list[int]
    ) -> bytes:
        """Return the same, a field of all events taken at once, and all of them packed at once."""
        values, width = self._values_of_many.copy(), self._width
        values[1::width] = _sequences(number, number + self.count)
        values[2::width] = range(time, time + self.count)
        values[3::width] = happened
        columns = enumerate(self._columns, 5)
        if isinstance(events, ColumnarEvents):
            next(columns)
            values[5::width] = events.door_ids
        for place, column in columns:
            values[place::width] = map(column, events)
        return self._pack(*values)


class MixedRun:
    """Records of several channels, in any order."""

    __slots__ = ("channels", "count", "of_channel", "sizes")

    def __init__(
        self,
        channels: NDArray[np.uint16],
        sizes: NDArray[np.int64],
        of_channel: Mapping[int, bytes],
    ) -> None:
        self.count = len(sizes)
        self.channels = channels
        """Of each record …"""
        self.sizes = sizes
        """… and its bytes."""
        self.of_channel = of_channel
        """Channel id -> its records, concatenated."""


AnyRun: TypeAlias = Run | MixedRun
Span: TypeAlias = tuple[int, int]
"""Least and greatest happened time; one later than its record counts as that."""

event_run = lru_cache(maxsize=128)(EventRun)
plain_run = lru_cache(maxsize=256)(Run)
"""The same object for the same run: by it the template of a chunk is found again."""


def run_of(
    events: Sequence[Event] | EventBatch, start: Start, wall_ns: int
) -> tuple[AnyRun, bytes, Span]:
    """Return the run of events of fixed sizes, their records, and their span.

    Args:
        events: At least one; `MOST` at most, unless they are columns.
        start: What the first gets.
        wall_ns: When those happened that have no happened time.
    """
    if isinstance(events, EventBatch):
        return _run_of_batch(events, start, wall_ns)
    if isinstance(events, ColumnarEvents):
        happened, kinds = events.times_or(wall_ns), events.kinds
    else:
        happened = [wall_ns if e.happened_ns is None else e.happened_ns for e in events]
        kinds = set(map(type, events))
    span = _span(happened, start.recorded_ns)
    if len(kinds) > 1:
        return *_mixed_run(events, start, happened), span
    run = event_run(events[0].kind, len(events))
    if len(events) == 1:
        return run, run.of_event(events[0], *start, happened[0]), span
    return run, run.of_events(events, start, happened), span


def _mixed_run(
    events: Sequence[Event], start: Start, happened: list[int]
) -> tuple[MixedRun, bytes]:
    """Return the run of events of several kinds, and their records."""
    number, time = start
    kinds = [event.kind for event in events]
    records = [
        event_run(kind, 1).of_event(event, number + i, time + i, happened[i])
        for i, (kind, event) in enumerate(zip(kinds, events, strict=True))
    ]
    of_channel = {
        kind: b"".join([r for r, its in zip(records, kinds, strict=True) if its == kind])
        for kind in set(kinds)
    }
    sizes = np.array([*map(len, records)], np.int64)
    return MixedRun(np.array(kinds, np.uint16), sizes, of_channel), b"".join(records)


def _run_of_batch(batch: EventBatch, start: Start, wall_ns: int) -> tuple[AnyRun, bytes, Span]:
    """Return the same of events as columns; bytes as if each had been packed by itself."""
    steps = np.arange(len(batch), dtype=np.int64)
    happened = _happened_times(batch, wall_ns)
    span = _span_of(happened, start.recorded_ns, steps)
    if len(batch.columns) == 1:
        ((kind, fields),) = batch.columns.items()
        rows = _packed_rows(kind, fields, steps, happened, start)
        return plain_run(kind, len(batch), record_size(kind)), rows.tobytes(), span
    sizes = _sizes_of(batch)
    offsets = np.cumsum(sizes) - sizes
    records = np.empty(int(sizes.sum()), np.uint8)
    of_channel = {}
    for kind, fields in sorted(batch.columns.items()):
        mine = np.flatnonzero(batch.kind == kind)
        rows = _packed_rows(kind, fields, mine, happened[mine], start)
        _put(records, offsets[mine], rows)
        of_channel[kind] = rows.tobytes()
    return MixedRun(batch.kind.astype(np.uint16), sizes, of_channel), records.tobytes(), span


def is_columns(batch: EventBatch) -> bool:
    """Return whether all events of a batch have fixed sizes; `run_of` accepts no others."""
    return not batch.objects and not messages.OBJECT_KINDS & batch.columns.keys()


def record_size(kind: int) -> int:
    """Return the bytes of a whole record of a fixed-size kind."""
    return _template(kind).dtype.itemsize


def split_at(
    events: Sequence[Event] | EventBatch, room: int
) -> tuple[Sequence[Event] | EventBatch, Sequence[Event] | EventBatch]:
    """Return the events that a chunk takes which has so much room, at least one, and the rest.

    A chunk takes one more as long as it has any room: it may become longer than it should.
    """
    if isinstance(events, EventBatch):
        if len(events.columns) == 1:
            (kind,) = events.columns
            return events.split(-(-room // record_size(kind)))
        ends = np.cumsum(_sizes_of(events))
        return events.split(int(np.searchsorted(ends, room, "left")) + 1)
    if len(events) * _largest() <= room:
        return events, ()
    ends_of_some = list(accumulate(record_size(event.kind) for event in events))
    fits = bisect_left(ends_of_some, room) + 1
    return events[:fits], events[fits:]


def _sizes_of(batch: EventBatch) -> NDArray[np.int64]:
    """Return the bytes of each event's record."""
    sizes: NDArray[np.int64] = _sizes()[batch.kind]
    return sizes


@cache
def _largest() -> int:
    """Return the bytes of the longest record of a fixed size."""
    return int(_sizes().max())


def _sequences(first: int, end: int) -> Sequence[int]:
    """Return the low 32 bits of these event numbers."""
    if end <= _LOW_32_BITS:
        return range(first, end)
    return [number & _LOW_32_BITS for number in range(first, end)]


def _span(happened: list[int], start_ns: int) -> Span:
    """Return the least and the greatest happened time; one later than its record counts as that."""
    greatest = max(happened)
    if greatest <= start_ns:
        return min(happened), greatest
    folded = [min(time, start_ns + i) for i, time in enumerate(happened)]
    return min(folded), max(folded)


def _packed_rows(
    kind: int,
    fields: NDArray[np.void],
    steps: NDArray[np.int64],
    happened: NDArray[np.int64],
    start: Start,
) -> NDArray[np.void]:
    """Return the whole records of events of one kind.

    Args:
        kind: Of fixed size.
        fields: Their own fields.
        steps: How many events stand before each of them.
        happened: When each happened.
        start: What the first event of all gets.
    """
    template = _template(kind)
    rows = np.full(len(steps), template.view(f"V{template.dtype.itemsize}")[0]).view(template.dtype)
    rows["sequence"] = (steps + start.event) & _LOW_32_BITS
    rows["log_time"] = steps + start.recorded_ns
    rows["publish_time"] = happened
    for name in messages.fixed_layout(kind).fields:
        column = fields[name]
        rows[name] = column if column.dtype != np.bool_ else column.view(np.uint8) != 0
    return rows


def _happened_times(batch: EventBatch, wall_ns: int) -> NDArray[np.int64]:
    """Return when each event happened: the wall clock's time where it is not given."""
    happened = batch.happened_ns
    if np.minimum.reduce(happened) == NO_TIME:
        return np.where(happened == NO_TIME, wall_ns, happened)
    return happened


def _span_of(happened: NDArray[np.int64], recorded_ns: int, steps: NDArray[np.int64]) -> Span:
    """Return the least and the greatest happened time, of each at most its recorded time."""
    greatest = int(np.maximum.reduce(happened))
    if greatest > recorded_ns:
        happened = np.minimum(happened, steps + recorded_ns)
        greatest = int(np.maximum.reduce(happened))
    return int(np.minimum.reduce(happened)), greatest


@cache
def _template(kind: int) -> NDArray[np.void]:
    """Return one record with all that is the same in every event of a kind."""
    row = np.zeros(1, messages.fixed_layout(kind).behind(mcap.MESSAGE_DTYPE))
    row["opcode"], row["channel_id"] = _MESSAGE, kind
    row["length"] = row.dtype.itemsize - mcap.FRAME.size
    header = slice(mcap.MESSAGE.size, mcap.MESSAGE.size + len(messages.CDR_HEADER))
    row.view(np.uint8)[header] = np.frombuffer(messages.CDR_HEADER, np.uint8)
    return row


@cache
def _sizes() -> NDArray[np.int64]:
    """Return the bytes of a record by its kind; 0: not fixed."""
    kinds = [kind.kind for kind in KINDS]
    sizes = [0, *(0 if kind in messages.OBJECT_KINDS else record_size(kind) for kind in kinds)]
    return np.array(sizes, np.int64)


def _put(records: NDArray[np.uint8], offsets: NDArray[np.int64], rows: NDArray[Any]) -> None:
    """Write structs to these offsets, however unaligned."""
    # A view in which a struct begins at every byte: setting some of them copies whole structs.
    size = rows.dtype.itemsize
    everywhere: NDArray[np.void] = np.ndarray(
        len(records) - size + 1, f"V{size}", records.data, strides=(1,)
    )
    everywhere[offsets] = rows.view(f"V{size}")
