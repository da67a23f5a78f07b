"""What closing a segment says of its chunks: the happened times by which late events are found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mcap.reader import SeekingReader

import semmap_log as sl
from semmap_log.log.compaction import compact
from semmap_log.log.header import read_index
from semmap_log.log.reading.segment_reading import read_chunk
from tests.conftest import SteadyClock


def test_the_index_spans_the_happened_times_of_each_chunk(
    tmp_path: Path, clock: SteadyClock
) -> None:
    """
    As written and compacted: least and greatest of its events, recorded time where that is
    earlier, and -1 for the keyframe, which has none.
    """
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        door = log.add_door()
        for late_ms in (0, 500, 3, -(10**6)):
            log.observe(door, "open", at=clock.now_ns - late_ms * 10**6)
    for _ in range(2):
        (segment,) = sl.read(path).reader.segments
        with segment.path.open("rb") as file:
            stored = {m.name: m for m in SeekingReader(file).iter_metadata()}

        told = read_index(stored["semmap_index"])

        assert _spans(path) == list(zip(*told, strict=True))
        assert (0, -1, -1) == tuple(column[0] for column in told)
        compact(path)


def _spans(path: Path) -> list[tuple[int, int, int]]:
    """Return the number and the span of each chunk's events, by our own reading."""
    from semmap_log.log.pages import Page

    (segment,) = sl.read(path).reader.segments
    spans = []
    for chunk in segment.chunks:
        page = Page(read_chunk(segment, chunk), segment.header.first_event, segment.path)
        times = page.events().folds_ns
        span = (int(np.min(times)), int(np.max(times))) if len(times) else (-1, -1)
        spans.append((len(times), *span))
    return spans
