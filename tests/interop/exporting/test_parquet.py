"""A log as a Parquet file: what is in it, and that others read it."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.model.events import Event, Retracted
from semmap_log.interop.exporting.log_files import export
from semmap_log.log.replay.replay import Scope
from semmap_log.store.compaction import compact
from tests.core.arrow.rows import history_rows, rows_of, write_any
from tests.store.eventful import eventful_log
from tests.strategies import events, texts

notes = st.builds(sl.Note, actor=texts, source=texts, reason=texts, correlation=texts)
commits = st.lists(st.tuples(st.lists(events, max_size=6), st.just(sl.Note()) | notes), max_size=8)


def exported(log: sl.DoorLog, path: Path, scope: Scope = Scope()) -> pa.Table:
    export(log, path, scope)
    return pq.read_table(path)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(commits)
def test_the_file_is_the_log(drawn: list[tuple[list[Event], sl.Note]]) -> None:
    """Every event of every kind, every field, who and why, and whether it was taken back."""
    with tempfile.TemporaryDirectory() as folder:
        log = sl.read(write_any(Path(folder) / "log", drawn))
        rows = rows_of(exported(log, Path(folder) / "x.parquet"))
        entries = list(log.history())

    assert list(history_rows(entries)) == rows


@pytest.fixture
def log(tmp_path: Path) -> sl.DoorLog:
    """A log with something of everything, in several files."""
    return sl.read(eventful_log(tmp_path / "log"))


def test_at_known_at_and_event_bound_the_rows(log: sl.DoorLog, tmp_path: Path) -> None:
    """What had happened by then; what was known by then, so that nothing is retracted yet."""
    everything = exported(log, tmp_path / "x.parquet")
    retraction = next(e for e in log.history() if isinstance(e.event, Retracted))
    fifth = log.entry(5)

    happened = exported(log, tmp_path / "x.parquet", Scope(at_ns=fifth.happened_ns))
    known = exported(log, tmp_path / "x.parquet", Scope(known_at_ns=retraction.recorded_ns - 1))
    numbered = exported(log, tmp_path / "x.parquet", Scope(event=3))
    nothing = exported(log, tmp_path / "x.parquet", Scope(known_at_ns=0))

    assert 1 == sum(everything.column("retracted").to_pylist())
    assert everything.filter(pa.compute.less_equal(everything["event"], 5)).equals(happened)
    assert retraction.number == known.num_rows
    assert 0 == sum(known.column("retracted").to_pylist())
    assert [0, 1, 2, 3] == numbered.column("event").to_pylist()
    assert 0 == nothing.num_rows


def test_the_file_tells_which_log_it_is_of(log: sl.DoorLog, tmp_path: Path) -> None:
    """Its id, zone, building, robot, and the version of the schema."""
    schema = exported(log, tmp_path / "x.parquet").schema

    assert {
        b"semmap_log.log_id": log.info.log_id.encode(),
        b"semmap_log.timezone": b"UTC",
        b"semmap_log.building": b"",
        b"semmap_log.robot": b"",
        b"semmap_log.schema": b"1",
    } == {key: value for key, value in schema.metadata.items() if key.startswith(b"semmap_log")}
    assert b"when it happened, as given" == schema.field("happened").metadata[b"description"]


@pytest.mark.slow
def test_the_same_log_gives_the_same_bytes(tmp_path: Path) -> None:
    """Once more, from another process, and after it was compacted."""
    log = eventful_log(tmp_path / "log")
    export(sl.read(log), tmp_path / "a.parquet")
    command = ["-m", "semmap_log", "export", log, tmp_path / "b.parquet"]
    subprocess.run([sys.executable, *command], check=True, env={"PYTHONHASHSEED": "7"})
    compact(log)
    export(sl.read(log), tmp_path / "c.parquet")

    first = (tmp_path / "a.parquet").read_bytes()

    assert first == (tmp_path / "b.parquet").read_bytes()
    assert first == (tmp_path / "c.parquet").read_bytes()


def test_pandas_reads_it_with_useful_types(log: sl.DoorLog, tmp_path: Path) -> None:
    """By `read_parquet` without a word: the same frame as `to_pandas()`, and who and why."""
    export(log, tmp_path / "x.parquet")

    frame = pd.read_parquet(tmp_path / "x.parquet")

    own = pd.concat([batch.to_pandas() for batch in log.batches(retracted=True)])
    pd.testing.assert_frame_equal(own.reset_index(drop=True), frame[own.columns])
    assert ("datetime64[ns, UTC]", "category", "category", "UInt32", "bool") == tuple(
        str(frame.dtypes[n]) for n in ("happened", "kind", "state", "door_id", "retracted")
    )
    assert {"OPEN": 4, "CLOSED": 3} == {
        state: count
        for state, count in frame[frame.kind == "DoorObserved"].state.value_counts().items()
        if count
    }


def test_duckdb_reads_it(log: sl.DoorLog, tmp_path: Path) -> None:
    """The state of each door, by SQL, is what a replay says."""
    duckdb: Any = pytest.importorskip("duckdb", reason="duckdb (extra `test`) is not installed")
    export(log, tmp_path / "x.parquet")

    rows = duckdb.sql(f"""
        select door_id, arg_max(state, (least(happened, recorded), event))
        from '{tmp_path / "x.parquet"}'
        where not retracted and state is not null and kind <> 'DoorRequested'
        group by door_id order by door_id
    """).fetchall()

    assert [(door.door_id, door.state.name) for door in log.replay().doors.values()] == rows
