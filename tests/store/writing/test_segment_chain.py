"""Rolling with a compactor beside: appends go on, and in the end every full segment is small."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

import semmap_log as sl
from semmap_log.store.compaction.merge import needs_compaction
from semmap_log.store.writing import segment_chain


@pytest.fixture(autouse=True)
def small_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 50)


def _patrol(path: Path, sightings: int, *, compact: bool) -> None:
    opened = sl.append if path.exists() else sl.create
    with opened(path, compact=compact) as log:
        door = log.add_door()
        for n in range(sightings):
            log.observe(door, "open" if n % 2 else "closed")


def _full_segments(path: Path) -> list[bool]:
    """Return of each segment but the last whether it wants compaction."""
    return [needs_compaction(segment) for segment in sl.read(path)._reader.segments[:-1]]


def test_full_segments_are_compacted_meanwhile(tmp_path: Path) -> None:
    """What the first writer's thread has no time for, the next writer's does."""
    path = tmp_path / "log"
    _patrol(path, 400, compact=True)
    deadline = time.monotonic() + 100
    while any(_full_segments(path)) and time.monotonic() < deadline:
        sl.append(path).close()

    assert [False] * 8 == _full_segments(path)
    assert 401 == sum(len(batch) for batch in sl.read(path).batches())


def test_without_it_segments_stay_as_they_are_written(tmp_path: Path) -> None:
    """For who wants the same bytes each time."""
    path = tmp_path / "log"
    _patrol(path, 200, compact=False)

    assert [True] * 4 == _full_segments(path)


def test_rosbag2_tools_find_every_closed_segment(tmp_path: Path) -> None:
    """metadata.yaml is written by two threads; it lists each segment once, with its messages."""
    path = tmp_path / "log"
    _patrol(path, 300, compact=True)
    _patrol(path, 100, compact=True)

    with AnyReader([path]) as bag:
        observed = [c for c in bag.connections if c.topic == "/semmap/door_observed"]
        assert 400 == sum(1 for _ in bag.messages(observed))
    assert 402 == sum(len(batch) for batch in sl.read(path).batches())
