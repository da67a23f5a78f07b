"""A writer that lost its power: whatever the tail, the log opens by itself and loses no commit.

The short form of the sweeps: every byte of the last commits of one small log.
"""

from __future__ import annotations

import os
import random
import shutil
import tracemalloc
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.store.reading.segment_scan import open_segment
from tests.conftest import SteadyClock


@pytest.fixture(scope="module")
def crashed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[int]]:
    """A live segment as a killed writer leaves it, and where each commit ends."""
    path = tmp_path_factory.mktemp("crashed") / "log"
    log = sl.create(path, tz="UTC", clock=SteadyClock(), entropy=random.Random(1).randbytes)
    ends = []
    door = log.add_door(name="front", actor="me")
    for state in ("open", "closed", "open"):
        log.observe(door, state)
        segment = log._writer._chain.live
        assert segment is not None
        ends.append(segment.size)
    copy = tmp_path_factory.mktemp("copy") / "log"
    shutil.copytree(path, copy)
    log.close()
    return copy, ends


def _cut(crashed: Path, to: Path, size: int, tail: bytes = b"") -> Path:
    """Return a copy of the log whose segment ends after `size` bytes and this tail."""
    to.mkdir()
    (to / "log_000000.mcap").write_bytes((crashed / "log_000000.mcap").read_bytes()[:size] + tail)
    return to


@pytest.mark.slow
def test_cut_at_every_byte_of_the_last_commits(
    crashed: tuple[Path, list[int]], tmp_path: Path
) -> None:
    """Bare, with a tail of zeros and with garbage: exactly the whole commits before the cut."""
    source, ends = crashed
    whole = (source / "log_000000.mcap").read_bytes()
    tails = (b"", bytes(300), b"\x05garbage" * 9)
    for size in range(ends[0], ends[2] + 1, 2):
        for tail in tails if size % 8 == 0 else tails[:1]:
            path = _cut(source, tmp_path / "log", size, tail)
            left = whole[:size] + tail  # whose first byte may be the one that was cut off
            stored = len([e for e in _commit_ends(source) if left[:e] == whole[:e]])

            reader = sl.read(path)
            seen = [b.number[-1] for b in reader.batches()][-1] + 1
            with sl.append(path) as log:
                log.observe("front", "open")
            after = sl.read(path)

            assert 2 + stored == seen, (size, tail)
            assert 2 + stored == after.replay().event, (size, tail)
            assert after._reader.segments[-1].closed
            shutil.rmtree(path)


def _commit_ends(source: Path) -> list[int]:
    """Return where the chunk of each sighting's commit ends: that alone makes it count."""
    segment = open_segment(source / "log_000000.mcap")
    return [chunk.offset + chunk.length for chunk in segment.chunks[2:]]


def test_the_torn_tail_is_kept_beside_it(crashed: tuple[Path, list[int]], tmp_path: Path) -> None:
    """Named by where it lay; nothing is thrown away. A second opening changes nothing more."""
    source, ends = crashed
    path = _cut(source, tmp_path / "log", _commit_ends(source)[2] - 40)
    torn = (path / "log_000000.mcap").read_bytes()[ends[1] :]

    sl.append(path).close()
    first = {p.name: p.read_bytes() for p in path.iterdir()}
    sl.append(path).close()

    kept = {name: data for name, data in first.items() if ".torn" in name}
    assert {f"log_000000.mcap.torn-{ends[1]}": torn} == kept
    assert first == {p.name: p.read_bytes() for p in path.iterdir()}


def test_a_long_torn_tail_is_kept_in_little_memory(
    crashed: tuple[Path, list[int]], tmp_path: Path
) -> None:
    """A power cut may leave a hole of any length."""
    source, ends = crashed
    path = _cut(source, tmp_path / "log", ends[1])
    os.truncate(path / "log_000000.mcap", ends[1] + 48 * 2**20)
    again = shutil.copytree(path, tmp_path / "again")

    tracemalloc.start()
    try:
        sl.append(path).close()
        kept = shutil.copy(next(path.glob("*.torn-*")), again)
        sl.append(again).close()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()

    assert Path(kept).stat().st_size == 48 * 2**20
    assert [Path(kept).name] == [p.name for p in again.glob("*.torn-*")]
    assert peak < 16 * 2**20
