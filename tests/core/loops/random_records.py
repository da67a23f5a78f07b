"""Records of chunks as nobody would write them, and what numpy makes of them."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.messages import OBJECT_KINDS, fixed_layout
from semmap_log.core.model.events import KINDS
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import EventFields
from semmap_log.store.pages import Page, compiled_scan
from semmap_log.store.reading.invariants import in_chunks
from semmap_log.store.record_scan import ChunkDamage, ScannedChunks, ScannedRecords, scan_together

CHANNELS = (*range(30), *range(95, 105), 300, 65535)
FIRST_EVENTS = (0, 1, 5, 2**31, 2**32 - 3, 2**32 + 7, 2**40 + 1)

Found = tuple[NDArray[np.int64], ScannedChunks, EventFields | None]


@dataclass(frozen=True)
class Chunks:
    """The records of some chunks."""

    records: bytes
    starts: NDArray[np.int64]
    ends: NDArray[np.int64]
    first_event: int
    expected: int
    """How many messages somebody thinks there are."""


def random_chunks(seed: int) -> Chunks:
    """Return chunks whose messages are right, mostly; then something may be wrong with a few."""
    draw = random.Random(seed)
    data, starts, ends, count = b"", [], [], 0
    for _ in range(draw.choice((1, 1, 2, 3, 8))):
        data += draw.randbytes(draw.choice((0, 0, 1, 40)))
        starts.append(len(data))
        for _ in range(draw.choice((0, 1, 1, 2, 7, 30))):
            data += _message(draw)
            count += 1
        ends.append(len(data))
    data += draw.randbytes(draw.choice((0, 0, 3, 50)))
    changed = bytearray(data)
    for _ in range(draw.choice((0, 0, 0, 1, 1, 2, 20)) if data else 0):
        changed[draw.randrange(len(data))] = draw.choice((0, 5, 22, 255, draw.randrange(256)))
    if draw.random() < 0.2:
        place = draw.randrange(len(starts))
        ends[place] = max(starts[place], ends[place] - draw.choice((1, 4, 9, 31, 32)))
    expected = draw.choice((count, count, count + 3, count // 2, 0))
    first_event = draw.choice(FIRST_EVENTS)
    return Chunks(bytes(changed), np.array(starts), np.array(ends), first_event, expected)


def _message(draw: random.Random) -> bytes:
    channel = draw.choice(CHANNELS)
    sizes = {kind.kind: fixed_layout(kind.kind).dtype.itemsize for kind in KINDS
             if kind.kind not in OBJECT_KINDS}  # fmt: skip
    size = sizes.get(channel, draw.choice((0, 4, 8, 9, 33)))
    if draw.random() < 0.01:
        size = draw.randrange(60)
    times = [draw.choice((0, 1, 10**18, 2**63 - 1, draw.getrandbits(64))) for _ in range(2)]
    return mcap.message(channel, draw.getrandbits(32), times[0], times[1], draw.randbytes(size))


def by_numpy(chunks: Chunks) -> Found | None:
    """Return what numpy finds: offsets, chunks, and the events unless one has a wrong length."""
    try:
        offsets = scan_together(chunks.records, chunks.starts, chunks.ends)
    except ChunkDamage:
        return None
    page = Page(chunks.records, chunks.first_event, PurePath(), 0, ScannedRecords(offsets))
    try:
        fields = page.event_fields
    except ValueError:
        fields = None
    return offsets, in_chunks(page, chunks.ends), fields


def by_loop(chunks: Chunks) -> Found | None:
    """Return what the loop finds."""
    found = compiled_scan(
        chunks.records,
        chunks.starts,
        chunks.ends,
        first_event=chunks.first_event,
        expected=chunks.expected,
    )
    if found is None:
        return None
    assert found.chunks is not None
    return found.offsets, found.chunks, found.events


def are_same(one: Found | None, other: Found | None) -> bool:
    """Tell whether both found the same, in columns of the same types."""
    if one is None or other is None:
        return one is other
    return all(
        (mine is theirs is None)
        or (mine is not None and theirs is not None and _are_same_columns(mine, theirs))
        for mine, theirs in (((one[0],), (other[0],)), (one[1], other[1]), (one[2], other[2]))
    )


def _are_same_columns(
    mine: tuple[NDArray[np.generic], ...], theirs: tuple[NDArray[np.generic], ...]
) -> bool:
    return all(
        a.dtype == b.dtype and np.array_equal(a, b) for a, b in zip(mine, theirs, strict=True)
    )
