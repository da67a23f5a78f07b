"""A log whose bytes do not lie on a disk of ours: the same answers, from what was asked for."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.store.byte_layout import CHUNK_BYTES
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.batches import batch_of
from tests.conftest import SteadyClock
from tests.log.replay.test_state import START_NS, sightings, tiny_steps
from tests.store.logs import answers_of
from tests.store.reading.far_segments import PATTERN, FarSegment, FarSegments
from tests.test_replay import random_log

HEAD_AND_TAIL = 2**12 + 2**15 + 2**10
"""Of each segment: its head, its footer, and a summary that lies within the usual bytes."""


def far(path: Path) -> tuple[sl.DoorLog, FarSegments]:
    """Open a log as one that lies elsewhere."""
    store = FarSegments(path)
    return sl.DoorLog(LogReader(store)), store


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(n, marks=pytest.mark.slow) for n in range(1, 3))]
)
@pytest.mark.parametrize("step", ["as written", "rechunked", "merged"])
def test_every_answer_is_that_of_the_same_log_on_a_disk(
    seed: int, step: str, tmp_path: Path
) -> None:
    """Now, at many moments, of both times; history, single events, commits, all bytes."""
    path = tmp_path / "log"
    with tiny_steps():
        random_log(path, random.Random(seed), commits=40)
        if step != "as written":
            compact(path, merge=step == "merged")

    opened, store = far(path)

    assert answers_of(sl.read(path)) == answers_of(opened)
    assert {file.name for file in path.glob("*.mcap")} == set(store.asked)
    assert opened.path == Path("far/log")


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A door and 320,000 sightings of it, one a second, in 8 segments of some MiB."""
    path = tmp_path_factory.mktemp("long") / "log"
    batch = batch_of(sightings(40_000))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", 1)
        with sl.create(path, tz="UTC", compact=False) as log:
            log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
            for n in range(8):
                later = n * len(batch) * 10**9
                log.append(replace(batch, happened_ns=batch.happened_ns + later))
    return path


@pytest.mark.parametrize("second", [5, 100_000, 319_999])
def test_a_moment_asks_for_few_bytes(second: int, long_log: Path) -> None:
    """Head and tail of each segment, a keyframe and about a chunk."""
    opened, store = far(long_log)
    whole = sum(file.stat().st_size for file in long_log.glob("*.mcap"))

    door = opened.replay(at=START_NS + second * 10**9).doors[DoorId(1)]

    asked = store.bytes_asked()
    print(f"asked for {asked:,} of {whole:,} bytes: {asked / whole:.1%}")  # noqa: T201  pytest -rP
    assert START_NS + second * 10**9 == door.last_seen_ns
    assert asked < len(store.asked) * HEAD_AND_TAIL + CHUNK_BYTES / 2
    assert asked < whole / 10


def test_opening_asks_for_heads_and_ends_only(long_log: Path) -> None:
    """No chunk of a closed log is fetched before there is a question."""
    _, store = far(long_log)

    assert store.bytes_asked() < len(store.asked) * 2 * 2**12 + 2**15
    assert 9 == len(store.asked)


def test_a_log_that_is_written_meanwhile_is_followed(tmp_path: Path, clock: SteadyClock) -> None:
    """Segments grow and roll; each commit comes once, and what is known is not fetched again."""
    with tiny_steps(), sl.create(tmp_path / "log", tz="UTC", clock=clock, compact=False) as log:
        log.append([DoorAdded(door_id=DoorId(1), happened_ns=START_NS - 1)])
        opened, store = far(tmp_path / "log")
        news = iter(sightings(30))

        def written() -> bool:
            event = next(news, None)
            if event is not None:
                log.append([event])
            return event is None

        seen = [c.commit.first_event for c in opened.follow(-1, poll_s=0, stop=written)]

        assert list(range(31)) == seen
        assert 2 < len(store.asked)


def test_a_log_that_is_gone_or_damaged_is_told(tmp_path: Path) -> None:
    """By where it lies, as for a folder."""
    path = tmp_path / "log"
    with tiny_steps():
        random_log(path, random.Random(4), commits=30)
    opened, _ = far(path)
    file = min(path.glob("*.mcap"))
    offset = opened._reader.segments[0].chunks[1].data_offset + 20
    data = bytearray(file.read_bytes())
    data[offset] ^= 1
    file.write_bytes(data)

    with pytest.raises(CorruptLogError, match=r"^far/log/log_000000.mcap: damaged at byte"):
        list(far(path)[0].history())
    for each in path.glob("*.mcap"):
        each.unlink()
    with pytest.raises(LogError, match=r"^far/log: no segments"):
        opened.refresh()


def test_bytes_that_were_not_fetched_are_no_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A source that forgets to fetch a chunk: damage, never an answer."""
    path = tmp_path / "log"
    with tiny_steps():
        random_log(path, random.Random(4), commits=30)
    opened, _ = far(path)
    assert opened.replay().doors
    monkeypatch.setattr(FarSegment, "need", lambda *_: None)
    fresh = sl.DoorLog(opened._reader.refreshed())
    for segment in fresh._reader.segments:
        segment.source.let_go(0, segment.size)
        assert {PATTERN} == set(segment.source.read(0, segment.size))

    with pytest.raises(CorruptLogError):
        list(fresh.history())
