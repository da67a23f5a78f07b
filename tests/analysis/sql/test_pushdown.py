"""What a query filters by is left out of the reading: counted in chunks and rows of tables."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("duckdb")

import semmap_log as sl
from semmap_log.log.replay.read_model.events_about import SegmentTables
from semmap_log.log.replay.read_model.indexing import index
from semmap_log.store.reading import segment_reading
from semmap_log.store.writing import segment_chain
from tests.conftest import SteadyClock

DOORS, COMMITS, SECOND_NS = 5, 400, 10**9


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of 400 sightings, a second apart, each a chunk of its own; a third of it is live."""
    path, clock = tmp_path_factory.mktemp("log") / "log", SteadyClock()
    writing = path.parent / "writing" / "log"
    writing.parent.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "ROLL_COMMITS", 150)
        with sl.create(writing, tz="UTC", clock=clock, durability="none", compact=False) as log:
            doors = [log.add_door(name=f"d{n}") for n in range(DOORS)]
            for number in range(COMMITS):
                clock.now_ns += SECOND_NS
                if number == 100:
                    log.start_patrol()
                log.observe(doors[number % DOORS], "open")
            log.sync()
            shutil.copytree(writing, path)
    return path


@pytest.fixture
def chunks(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """How many chunks were read, reading by reading."""
    counts: list[int] = []
    read = segment_reading.read_page

    def counted(group: Any, *args: Any, **kwargs: Any) -> Any:
        counts.append(len(group))
        return read(group, *args, **kwargs)

    monkeypatch.setattr(segment_reading, "read_page", counted)
    return counts


def ask(
    log: sl.DoorLog, chunks: list[int], condition: str, view: str = "events"
) -> tuple[int, int]:
    """Return how many rows pass, and how many chunks were read for it."""
    chunks.clear()
    (found,) = log.sql(f"select count(event) from {view} where {condition}").fetchall()
    return found[0], sum(chunks)


def test_times_numbers_and_kinds(path: Path, chunks: list[int]) -> None:
    """A hundredth of the events costs a few chunks, by whichever time or number it is told."""
    log = sl.read(path)
    last_ns = log.end_ns()
    since = f"make_timestamptz({last_ns // 1000 - 3 * 10**6})"
    everything, all_chunks = ask(log, chunks, "true")
    assert (DOORS * 2 + COMMITS + 1, True) == (everything, all_chunks >= COMMITS)

    assert ask(log, chunks, f"happened >= {since}") <= (4, 12)
    assert ask(log, chunks, f"recorded > {since}") <= (4, 12)
    assert ask(log, chunks, f"happened_ns > {last_ns - 3 * SECOND_NS}") <= (4, 12)
    assert ask(log, chunks, f"happened between {since} and {since} + interval 1 second") <= (4, 12)
    assert ask(log, chunks, "event between 200 and 203") == (4, ANY_FEW)
    assert ask(log, chunks, "event in (7, 350)") == (2, ANY_FEW)
    assert ask(log, chunks, "kind = 'PatrolStarted'") == (1, ANY_FEW)
    assert ask(log, chunks, "kind = 'PatrolFinished'") == (0, ANY_FEW)
    assert ask(log, chunks, "door_name = 'nobody'") == (0, ANY_FEW)
    assert ask(log, chunks, "door_name = 'nobody'", "intervals") == (0, ANY_FEW)
    assert ask(log, chunks, "event > 400", "poses") == (0, ANY_FEW)


class _Few:
    """Equal to any small number."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, int) and other <= 12

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return "up to 12"


ANY_FEW = _Few()


@pytest.mark.parametrize(
    ("condition", "added"), [("door_id = 3", 2), ("door_name = 'd2'", 2), ("door_id in (3, 3)", 2)]
)
def test_doors_by_the_read_model(
    path: Path, chunks: list[int], condition: str, added: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One door's events come from the tables' rows about it."""
    asked: list[Any] = []
    about = SegmentTables.about

    def seen(tables: SegmentTables, doors: Any) -> Any:
        asked.append((tables.stem, list(doors)))
        return about(tables, doors)

    monkeypatch.setattr(SegmentTables, "about", seen)
    index(path)
    log = sl.read(path)
    live = len(log._reader.segments[-1].chunks)

    found, read = ask(log, chunks, condition)

    assert COMMITS // DOORS + added == found
    assert {tuple(doors) for _, doors in asked} == {(3,)}
    assert len(asked) == len(log._reader.segments) - 1
    assert read <= live + 40  # which say doors' names


def test_two_filters_at_once(path: Path, chunks: list[int]) -> None:
    """Each leaves out what it can."""
    log = sl.read(path)

    assert (1, ANY_FEW) == ask(log, chunks, "event > 405 and kind = 'DoorObserved' and door_id = 2")


def test_a_limit_ends_the_reading(path: Path, chunks: list[int]) -> None:
    """Who wants ten rows does not wait for all."""
    log, pages = sl.read(path), np.inf
    chunks.clear()

    assert 10 == len(log.sql("select event from changes limit 10").fetchall())
    assert sum(chunks) < pages


def test_a_rare_kind_is_worth_no_table(
    path: Path, chunks: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The few chunks that have it are read sooner than all the rows of a table."""
    index(path)
    monkeypatch.setattr(SegmentTables, "all_rows", None)  # who calls it fails

    assert (1, ANY_FEW) == ask(sl.read(path), chunks, "kind = 'PatrolStarted'")
