"""Where the messages of chunks begin, and the events among them, in one compiled pass."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.loops import compiled
from semmap_log.store import records as mcap
from semmap_log.store.event_fields import (
    ABOUT_A_DOOR,
    KIND_OF_CHANNEL,
    EventFields,
    message_lengths,
)
from semmap_log.store.kind_bits import BIT_OF_CHANNEL
from semmap_log.store.record_scan import ScannedChunks, ScannedRecords


def compiled_scan(
    records: bytes | memoryview,
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
    *,
    first_event: int,
    expected: int,
) -> ScannedRecords | None:
    """Return what is in the records of chunks; None: there are no compiled loops, or damage.

    Damage is for `scan_together` to name.

    Args:
        records: What holds the chunks' records.
        starts: Where those of each chunk begin …
        ends: … and where they end.
        first_event: Event number at which their segment begins.
        expected: About how many messages there are; if there are more, it takes longer.
    """
    loops = compiled()
    if loops is None or not 0 <= first_event < _MOST_FIRST_EVENT:
        return None
    for room in (expected, int((ends - starts).sum()) // mcap.MESSAGE.size):
        offsets, fields = np.empty(room, np.int64), EventFields.room_for(room)
        chunks = ScannedChunks.room_for(len(starts))
        messages, events, has_wrong_length = loops.scan(
            records,
            starts,
            ends,
            first_event,
            *_tables(),
            offsets,
            fields.place,
            fields.number,
            fields.kind,
            fields.happened_ns,
            fields.recorded_ns,
            fields.door_id,
            *chunks,
        )
        if messages >= 0:
            found = None if has_wrong_length else fields.chosen(slice(events))
            return ScannedRecords(offsets[:messages], None, chunks, found)
        if messages == loops.DAMAGED:
            break
    return None


_MOST_FIRST_EVENT = 2**62
"""So far numbers can be counted on without a look at each."""


class _Tables(NamedTuple):
    kind_of: NDArray[np.uint8]
    bit_of: NDArray[np.uint32]
    length_of: NDArray[np.int64]
    is_about: NDArray[np.uint8]


@cache
def _tables() -> _Tables:
    is_about = ABOUT_A_DOOR.view(np.uint8)
    return _Tables(KIND_OF_CHANNEL, BIT_OF_CHANNEL, message_lengths(), is_about)
