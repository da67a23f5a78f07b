"""Events as columns -> message records: each kind's as one array, every field set at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.batches.taken_columns import NO_TIME
from semmap_log.core.messages import CDR_HEADER, OBJECT_KINDS, fixed_layout
from semmap_log.core.model.events import KINDS
from semmap_log.store import records as mcap

_LOW_32_BITS = 0xFFFF_FFFF


class Start(NamedTuple):
    """What a log gives the first of some events; each other gets one more of both."""

    event: int
    recorded_ns: int


@dataclass(frozen=True, slots=True)
class Block:
    """Message records that follow each other, and what a chunk has to know of them."""

    records: bytes
    of_channel: Mapping[int, bytes]
    """Channel id -> its records, concatenated."""
    places: Mapping[int, tuple[NDArray[np.int64], NDArray[np.int64]]]
    """Channel id -> of each of its records: how many stand before it, and where it begins."""
    sizes: NDArray[np.int64]
    """Bytes of each record, in order."""
    span: tuple[int, int]
    """Least and greatest happened time; one later than its record counts as that."""

    @property
    def count(self) -> int:
        """How many records it has."""
        return len(self.sizes)


def is_columns(batch: EventBatch) -> bool:
    """Return whether all events of a batch have fixed sizes; `block_of` accepts no others."""
    return not batch.objects and not OBJECT_KINDS & batch.columns.keys()


def record_size(kind: int) -> int:
    """Return the bytes of a whole record of a fixed-size kind."""
    return _template(kind).dtype.itemsize


def sizes_of(batch: EventBatch) -> NDArray[np.int64]:
    """Return the bytes of each event's record."""
    sizes: NDArray[np.int64] = _sizes()[batch.kind]
    return sizes


def block_of(batch: EventBatch, start: Start, wall_ns: int) -> Block:
    """Return the records of events as columns; bytes as if each had been packed by itself.

    Args:
        batch: Events of fixed sizes, at least one.
        start: What the first gets.
        wall_ns: When those happened that have no happened time.
    """
    steps = np.arange(len(batch), dtype=np.int64)
    happened = happened_times(batch, wall_ns)
    span = span_of(happened, start.recorded_ns, steps)
    sizes = sizes_of(batch)
    ends = np.cumsum(sizes)
    offsets = ends - sizes
    if len(batch.columns) == 1:
        (kind,) = batch.columns
        data = packed_rows(kind, batch.columns[kind], steps, happened, start).tobytes()
        return Block(data, {kind: data}, {kind: (steps, offsets)}, sizes, span)
    records = np.empty(int(ends[-1]), np.uint8)
    of_channel, places = {}, {}
    for kind, fields in sorted(batch.columns.items()):
        mine = np.flatnonzero(batch.kind == kind)
        rows = packed_rows(kind, fields, mine, happened[mine], start)
        _put(records, offsets[mine], rows)
        of_channel[kind] = rows.tobytes()
        places[kind] = (mine, offsets[mine])
    return Block(records.tobytes(), of_channel, places, sizes, span)


def packed_rows(
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
    for name in fixed_layout(kind).fields:
        column = fields[name]
        rows[name] = column if column.dtype != np.bool_ else column.view(np.uint8) != 0
    return rows


def happened_times(batch: EventBatch, wall_ns: int) -> NDArray[np.int64]:
    """Return when each event happened: the wall clock's time where it is not given."""
    happened = batch.happened_ns
    if np.minimum.reduce(happened) == NO_TIME:
        return np.where(happened == NO_TIME, wall_ns, happened)
    return happened


def span_of(
    happened: NDArray[np.int64], recorded_ns: int, steps: NDArray[np.int64]
) -> tuple[int, int]:
    """Return the least and the greatest happened time, of each at most its recorded time."""
    greatest = int(np.maximum.reduce(happened))
    if greatest > recorded_ns:
        happened = np.minimum(happened, steps + recorded_ns)
        greatest = int(np.maximum.reduce(happened))
    return int(np.minimum.reduce(happened)), greatest


@cache
def _template(kind: int) -> NDArray[np.void]:
    """Return one record with all that is the same in every event of a kind."""
    row = np.zeros(1, fixed_layout(kind).behind(mcap.MESSAGE_DTYPE))
    row["opcode"], row["channel_id"] = int(Opcode.MESSAGE), kind
    row["length"] = row.dtype.itemsize - mcap.FRAME.size
    header = slice(mcap.MESSAGE.size, mcap.MESSAGE.size + len(CDR_HEADER))
    row.view(np.uint8)[header] = np.frombuffer(CDR_HEADER, np.uint8)
    return row


@cache
def _sizes() -> NDArray[np.int64]:
    """Return the bytes of a record by its kind; 0: not fixed."""
    kinds = [kind.kind for kind in KINDS]
    sizes = [0, *(0 if kind in OBJECT_KINDS else record_size(kind) for kind in kinds)]
    return np.array(sizes, np.int64)


def _put(records: NDArray[np.uint8], offsets: NDArray[np.int64], rows: NDArray[Any]) -> None:
    """Write structs to these offsets, however unaligned."""
    # A view in which a struct begins at every byte: setting some of them copies whole structs.
    size = rows.dtype.itemsize
    everywhere: NDArray[np.void] = np.ndarray(
        len(records) - size + 1, f"V{size}", records.data, strides=(1,)
    )
    everywhere[offsets] = rows.view(f"V{size}")
