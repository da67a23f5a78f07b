"""Which kinds of record a chunk holds, as bits: so that a question reads only what it wants.

Bit k stands for the kind of event with that number, one for all kinds of later versions; the others
are of the log itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.events import (
    KINDS,
    DoorObserved,
    DoorPassed,
    DoorRequested,
    DoorUpdated,
    Event,
    RobotPose,
    SightingsThinned,
)
from semmap_log.store.form import (
    COMMIT_CHANNEL,
    FLOOR_MAP_CHANNEL,
    KEYFRAME_CHANNEL,
    NOTE_CHANNEL,
    TOMBSTONE_CHANNEL,
    kind_of_channel,
)

TOMBSTONE_BIT = 1
UNKNOWN_BIT = 1 << 27
"""Kinds of events that a later version has added."""
FOREIGN_BIT = 1 << 28
COMMIT_BIT = 1 << 29
NOTE_BIT = 1 << 30
KEYFRAME_BIT = 1 << 31
EVENT_BITS = FOREIGN_BIT - 2
"""Any kind of event, unknown ones, too."""

_CARE = {
    COMMIT_CHANNEL: COMMIT_BIT,
    NOTE_CHANNEL: NOTE_BIT,
    KEYFRAME_CHANNEL: KEYFRAME_BIT,
    TOMBSTONE_CHANNEL: TOMBSTONE_BIT,
}


def _bit_of_channel(channel: int) -> int:
    kind = kind_of_channel(channel)
    return _CARE.get(channel, FOREIGN_BIT) if kind is None else _bit_of_kind(kind)


def _bit_of_kind(kind: int) -> int:
    return 1 << kind if kind <= len(KINDS) else UNKNOWN_BIT


BIT_OF_CHANNEL = np.full(2**16, _bit_of_channel(FLOOR_MAP_CHANNEL), np.uint32)
"""Of each channel there can be: those behind the first floor map's carry floor maps, too."""
BIT_OF_CHANNEL[:FLOOR_MAP_CHANNEL] = [
    _bit_of_channel(channel) for channel in range(FLOOR_MAP_CHANNEL)
]


def bits_of_channels(channels: NDArray[np.uint16]) -> NDArray[np.uint32]:
    """Return the bit of each channel."""
    bits: NDArray[np.uint32] = BIT_OF_CHANNEL.take(channels)
    return bits


EXPIRING: tuple[type[Event], ...] = (
    DoorUpdated, DoorObserved, DoorRequested, DoorPassed, RobotPose, SightingsThinned,
)  # fmt: skip
"""What retention takes out of old segments. All other kinds stay: which doors, levels, floor plans
and rounds there were, what was taken back, and who said so."""

_BITS_OF_KINDS = np.array([_bit_of_kind(kind) for kind in range(2**8)], np.uint32)


def bits_of_kind_numbers(kinds: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Return the bit of each event, by its kind's number."""
    bits: NDArray[np.uint32] = _BITS_OF_KINDS.take(kinds)
    return bits


def bits_of_counts(counts: Mapping[int, int]) -> int:
    """Return the bits of all channels that have messages."""
    return sum({_bit_of_channel(channel) for channel, count in counts.items() if count})


def bits_of_kinds(kinds: Iterable[type[Event]]) -> int:
    """Return the bits of these kinds of events together."""
    return sum({_bit_of_kind(kind.kind) for kind in kinds})


EXPIRING_BITS = bits_of_kinds(EXPIRING)


def kinds_of_bits(bits: int) -> list[int]:
    """Return the known kinds of events among bits."""
    return [kind.kind for kind in KINDS if bits >> kind.kind & 1]
