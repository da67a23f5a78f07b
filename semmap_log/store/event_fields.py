"""The fixed fields of the events among message records, as columns: by numpy."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.messages import OBJECT_KINDS, fixed_layout
from semmap_log.core.model.events import DOOR_KINDS, KINDS, FloorMap
from semmap_log.store import records as mcap
from semmap_log.store.form import FLOOR_MAP_CHANNEL, kind_of_channel

KIND_OF_CHANNEL = np.full(2**16, FloorMap.kind, np.uint8)
"""Of each channel there can be; those behind the first floor map's carry floor maps, too."""
KIND_OF_CHANNEL[:FLOOR_MAP_CHANNEL] = [
    kind_of_channel(channel) or 0 for channel in range(FLOOR_MAP_CHANNEL)
]

ABOUT_A_DOOR = np.zeros(2**8, np.bool_)
"""Of each kind: whether its events begin with the door that they are about."""
ABOUT_A_DOOR[list(DOOR_KINDS - OBJECT_KINDS)] = True

FIXED_KINDS = frozenset(kind.kind for kind in KINDS) - OBJECT_KINDS
"""Kinds whose events are read in place, as columns."""


def kinds_of(channels: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return the kind of event on each channel; 0: Commit, CommitNote, Keyframe or foreign."""
    kinds: NDArray[np.uint8] = KIND_OF_CHANNEL.take(channels)
    return kinds


@cache
def message_lengths() -> NDArray[np.int64]:
    """Return the length of a message record of each kind, frame left out; -1: any."""
    lengths = np.full(2**8, -1, np.int64)
    for kind in FIXED_KINDS:
        lengths[kind] = mcap.MESSAGE_BODY_HEAD + fixed_layout(kind).dtype.itemsize
    return lengths


class HeadColumns(Protocol):
    """Columns by their names."""

    def __getitem__(self, name: str, /) -> NDArray[Any]:
        """Return a column."""
        ...


class EventFields(NamedTuple):
    """A row for each event."""

    place: NDArray[np.int64]
    """Which of the message records it is."""
    number: NDArray[np.int64]
    """Event number."""
    kind: NDArray[np.uint8]
    happened_ns: NDArray[np.int64]
    """As given."""
    recorded_ns: NDArray[np.int64]
    door_id: NDArray[np.uint32]
    """The door that it is about; 0 if it is about none, or if its payload must be decoded first."""

    @classmethod
    def room_for(cls, count: int) -> EventFields:
        """Return rows that somebody fills."""
        return cls(
            place=np.empty(count, np.int64),
            number=np.empty(count, np.int64),
            kind=np.empty(count, np.uint8),
            happened_ns=np.empty(count, np.int64),
            recorded_ns=np.empty(count, np.int64),
            door_id=np.empty(count, np.uint32),
        )

    def chosen(self, rows: NDArray[np.bool_] | slice) -> EventFields:
        """Return some rows: for each whether it is wanted, or a slice of them."""
        return EventFields(
            self.place[rows],
            self.number[rows],
            self.kind[rows],
            self.happened_ns[rows],
            self.recorded_ns[rows],
            self.door_id[rows],
        )


def fields_of(heads: HeadColumns, first_event: int) -> EventFields:
    """Return the fields of the events among message records.

    Args:
        heads: The fixed fields of all of them: `HEAD_DTYPE`.
        first_event: Event number at which their segment begins.
    """
    kinds = kinds_of(heads["channel_id"])
    place = np.flatnonzero(kinds)
    kind = kinds.take(place)
    door_id = heads["door_id"].take(place)
    door_id[~ABOUT_A_DOOR.take(kind)] = 0
    return EventFields(
        place=place,
        number=numbers_of_sequence(heads["sequence"].take(place), first_event),
        kind=kind,
        happened_ns=heads["publish_time"].take(place),
        recorded_ns=heads["log_time"].take(place),
        door_id=door_id,
    )


def numbers_of_sequence(sequence: NDArray[np.uint32], first_event: int) -> NDArray[np.int64]:
    """Return event numbers, of which a record says the low 32 bits only.

    Args:
        sequence: What the records say.
        first_event: Event number at which their segment begins.
    """
    first = np.uint32(first_event & 0xFFFF_FFFF)
    numbers: NDArray[np.int64] = (sequence - first).astype(np.int64)
    numbers += first_event
    return numbers
