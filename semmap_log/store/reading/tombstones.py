"""The Tombstones of a trimmed segment: what stands there for records that are gone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from semmap_log.core.model.commits import Commit
from semmap_log.store.byte_layout import TOMBSTONE_CHANNEL
from semmap_log.store.gone_commands import (
    UNKNOWN,
    CommandSeal,
    GoneCommand,
    Tombstone,
    commands_in,
    read_tombstone,
)
from semmap_log.store.pages import TOMBSTONE_BIT
from semmap_log.store.reading.segment_reading import page_at
from semmap_log.store.reading.segment_scan import Segment, numbers_of


def tombstones(segment: Segment, first_chunk: int = 0) -> Iterator[tuple[Tombstone, bytes]]:
    """Yield the Tombstones of a segment from a chunk on, and their Message records.

    Raises:
        CorruptLogError: A chunk, or one of them, is not what was written.
    """
    if segment.header.trimmed is None:
        return
    places = segment.chunks.having(TOMBSTONE_BIT)
    for chunk in places[places >= first_chunk].tolist():
        page = page_at(segment, chunk)
        for i in np.flatnonzero(page.heads["channel_id"] == TOMBSTONE_CHANNEL):
            record = bytes(page.record(int(i)))
            yield read_tombstone(record, segment.path), record


def gone_commands(segment: Segment) -> Iterator[GoneCommand]:
    """Yield the commands of whole commits that are gone, as far as they can be sent again."""
    for tombstone, _ in tombstones(segment):
        yield from commands_in(tombstone)


def seal_of(segment: Segment, commit: Commit) -> CommandSeal | None:
    """Return the seal of a commit that lacks records; None: it lacks none."""
    if segment.header.trimmed is None:
        return None
    _, ends = numbers_of(segment)
    chunk = int(np.searchsorted(ends, commit.last_event, "right"))
    for tombstone, _ in tombstones(segment, chunk):
        if tombstone.first_event > commit.first_event:
            return None
        if (tombstone.first_event, tombstone.commits) == (commit.first_event, 0):
            found = CommandSeal.unpacked(tombstone.hash)
            return found or CommandSeal(UNKNOWN, UNKNOWN, 0, commit.recorded_ns, 0, commit.count)
    return None
