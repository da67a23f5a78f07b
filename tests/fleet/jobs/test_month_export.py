"""Events as a lake: what `export` writes of each log alone, by month, once."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import duckdb
import pytest
from obstore.store import from_url

import semmap_log as sl
from tests.fleet.jobs.fleets import HOUR_NS, START_NS, make_log

MONTH_NS = 31 * 24 * HOUR_NS


def run(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "semmap_log", "fleet", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """Two logs; the first has an event that happened two months before the rest."""
    folder = tmp_path / "logs"
    folder.mkdir()
    for seed in range(2):
        make_log(folder / f"tug{seed}", seed)
    with sl.append(folder / "tug0") as log:
        log.observe("d0", "open", at=START_NS - 2 * MONTH_NS, reason="told late")
        log.observe("d0", "closed", at=START_NS + 1)
    return folder


def test_every_event_is_in_the_month_in_which_it_happened(logs: Path, tmp_path: Path) -> None:
    """With nanoseconds as whole numbers; DuckDB reads the folder as one table."""
    done = run("export", logs, "--out", tmp_path / "lake", "--engine", "serial")
    assert 0 == done.returncode, done.stderr

    rows = duckdb.sql(
        f"select log_id, event, kind, happened_ns, month, retracted, reason "
        f"from '{tmp_path}/lake/*/*.parquet' order by log_id, event"
    ).fetchall()

    expected = []
    for log in sorted(logs.iterdir()):
        out = tmp_path / "one.jsonl"
        subprocess.run(
            [sys.executable, "-m", "semmap_log", "export", log, out], check=True,
            capture_output=True,
        )  # fmt: skip
        log_id = sl.read(log).info.log_id
        for line in map(json.loads, out.read_text().splitlines()):
            number = sl.read(log).event(line["event"])
            expected.append(
                (log_id, line["event"], line["kind"], number.happened_ns,
                 min(line["happened"], line["recorded"])[:7], line.get("retracted", False),
                 line.get("reason") or None)
            )  # fmt: skip
    assert sorted(expected, key=lambda row: row[:2]) == rows
    assert 1 == [row[-1] for row in rows].count("told late")
    assert {"2025-12", "2026-03"} <= {row[4] for row in rows}


def test_again_writes_nothing_and_a_log_that_has_grown_takes_its_files_place(
    logs: Path, tmp_path: Path
) -> None:
    lake = tmp_path / "lake"
    words = ("export", logs, "--out", lake, "--engine", "serial")
    assert 0 == run(*words).returncode
    before = {path: path.stat().st_mtime_ns for path in lake.rglob("*.parquet")}

    assert 0 == run(*words).returncode
    assert before == {path: path.stat().st_mtime_ns for path in lake.rglob("*.parquet")}
    next(iter(before)).unlink()
    assert 0 == run(*words).returncode
    assert before.keys() == set(lake.rglob("*.parquet"))

    with sl.append(logs / "tug1") as log:
        log.observe("d0", "open")
    assert 0 == run(*words).returncode
    counted = duckdb.sql(
        f"select log_id, count(*), count(distinct event) from '{lake}/*/*.parquet' group by 1"
    ).fetchall()
    ends = {sl.read(log).info.log_id: sl.read(log).last_event() + 1 for log in logs.iterdir()}
    assert {log_id: (events, events) for log_id, events in ends.items()} == {
        log_id: (rows, events) for log_id, rows, events in counted
    }


def test_a_lake_in_a_bucket_has_the_same_files(logs: Path, tmp_path: Path, bucket: str) -> None:
    for _ in range(2):
        assert 0 == run("export", logs, "--out", f"{bucket}/lake", "--engine", "serial").returncode
    assert 0 == run("export", logs, "--out", tmp_path / "lake", "--engine", "serial").returncode

    store = from_url(bucket, client_options={"allow_http": True})
    there = {
        each["path"]: bytes(store.get(each["path"]).bytes())
        for page in store.list("lake")
        for each in page
    }
    here = {
        f"lake/{path.relative_to(tmp_path / 'lake')}": path.read_bytes()
        for path in (tmp_path / "lake").rglob("*.parquet")
    }
    assert here == there
    shutil.rmtree(tmp_path / "lake")
