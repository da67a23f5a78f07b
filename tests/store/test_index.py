"""What closing a segment says of its chunks: the happened times by which late events are found."""

from __future__ import annotations

import base64
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import SeekingReader
from mcap.records import Metadata

import semmap_log as sl
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.byte_layout import DIGEST_KEY
from semmap_log.store.compaction import compact
from semmap_log.store.header import _signed, index_metadata, read_index
from semmap_log.store.reading.segment_reading import read_chunk
from tests.conftest import SteadyClock


def test_the_index_spans_the_happened_times_of_each_chunk(
    tmp_path: Path, clock: SteadyClock
) -> None:
    """Least and greatest happened time of its events; -1 for the keyframe, which has none."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        door = log.add_door()
        for late_ms in (0, 500, 3, -(10**6)):
            log.observe(door, "open", at=clock.now_ns - late_ms * 10**6)
    for _ in range(2):
        (segment,) = sl.read(path)._reader.segments
        with segment.path.open("rb") as file:
            stored = {m.name: m for m in SeekingReader(file).iter_metadata()}

        told = read_index(stored["semmap_index"], most=10)

        assert _spans(path) == list(zip(*told, strict=True))
        assert (0, -1, -1) == tuple(column[0] for column in told)
        compact(path)


BOMB = base64.b64encode(zlib.compress(bytes(2**26))).decode()
"""64 kB that unpack to 64 MiB."""


def _with_entries(path: Path, change: Callable[[dict[str, str]], None]) -> None:
    """Write a closed log whose index has other entries, under the digest that fits them."""

    def changed(*columns: Any) -> Metadata:
        usual = index_metadata(*columns)
        entries = {k: v for k, v in usual.metadata.items() if k != DIGEST_KEY}
        change(entries)
        return _signed(usual.name, entries)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("semmap_log.store.segment.index_metadata", changed)
        with sl.create(path, tz="UTC", compact=False) as log:
            door = log.add_door()
            log.observe(door, "open")


@pytest.mark.parametrize("column", ["events", "least_happened_ns", "greatest_happened_ns"])
def test_an_index_is_unpacked_no_further_than_its_segment_has_chunks(
    tmp_path: Path, column: str
) -> None:
    """A stranger's log, sound by its checksums, is refused in little memory."""
    path = tmp_path / "log"
    _with_entries(path, lambda entries: entries.update({column: BOMB}))
    good = tmp_path / "good"
    _with_entries(good, lambda _: None)
    sl.read(good).replay()  # what is imported on the way takes memory, too
    assert not verify(good).findings
    tracemalloc.start()

    with pytest.raises(CorruptLogError, match=r"_000000.mcap.*semmap_index.*at most \d+ chunks"):
        sl.read(path).replay()
    found = verify(path)

    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert "at most 65536 chunks" in str(found.findings)
    assert peak < 2**24


@pytest.mark.parametrize("cut", [-1, -4, 1])
def test_an_index_ends_where_what_is_packed_ends(tmp_path: Path, cut: int) -> None:
    """Neither is its end missing, nor does anything lie behind."""

    def changed(entries: dict[str, str]) -> None:
        packed = base64.b64decode(entries["events"])
        wrong = packed[:cut] if cut < 0 else packed + bytes(cut)
        entries["events"] = base64.b64encode(wrong).decode()

    path = tmp_path / "log"
    _with_entries(path, changed)

    with pytest.raises(CorruptLogError, match="does not end where what is packed ends"):
        _ = sl.read(path)._reader.segments[0].spans


def test_a_column_of_one_value_stands_for_no_other(tmp_path: Path) -> None:
    """Each column of an index has one value for each chunk."""
    one = base64.b64encode(zlib.compress(bytes(8))).decode()
    path = tmp_path / "log"
    _with_entries(path, lambda entries: entries.update({"least_happened_ns": one}))

    with pytest.raises(CorruptLogError, match="not of one length"):
        _ = sl.read(path)._reader.segments[0].spans


def _spans(path: Path) -> list[tuple[int, int, int]]:
    """Return the number and the span of each chunk's events, by our own reading."""
    from semmap_log.store.pages import Page

    (segment,) = sl.read(path)._reader.segments
    spans = []
    for chunk in segment.chunks:
        page = Page(read_chunk(segment, chunk), segment.header.first_event, segment.path)
        times = page.events().folds_ns
        span = (int(np.min(times)), int(np.max(times))) if len(times) else (-1, -1)
        spans.append((len(times), *span))
    return spans
