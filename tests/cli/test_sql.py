"""`sql` as a user types it."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

pytest.importorskip("duckdb")

import semmap_log as sl
from semmap_log.analysis.sql.sql_query import COLUMNS_OF
from semmap_log.cli import INTERRUPTED
from tests.verbs import Refuses, run

COUNT = "select name, count(*) as n, max(last_seen) as seen from doors group by all order by all"
DEADLINE_S = 60


@pytest.fixture
def office(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the log `office`: `front` was seen open, `back` never."""
    monkeypatch.chdir(tmp_path)
    with sl.create("office", tz="Europe/Vienna") as log:
        door = log.add_door(name="front", at="2026-03-01T08:00")
        log.add_door(name="back", at="2026-03-01T08:00")
        log.observe(door, "open", at="2026-03-01T09:00:00.123456789")
    return tmp_path


def test_json(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One list of rows, times in UTC with nanoseconds, what is not known null."""
    query = """
        select d.name, last_seen, d.prob_open, annotations, happened_ns from doors d, events
        where event = 4 and d.name = 'front'"""
    assert 0 == run("sql", "office", query, "--json")

    (row,) = json.loads(capsys.readouterr().out)
    assert {
        "name": "front", "last_seen": "2026-03-01T08:00:00.123456000Z", "prob_open": None,
        "annotations": {"name": "front"}, "happened_ns": 1772352000123456789,
    } == row  # fmt: skip


def test_csv(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With a head; what is not known is empty."""
    query = "select name, prob_open, annotations from doors order by name"
    assert 0 == run("sql", "office", query, "--csv")

    rows = list(csv.reader(io.StringIO(capsys.readouterr().out)))
    assert [["name", "prob_open", "annotations"], ["back", "", '{"name": "back"}'],
            ["front", "", '{"name": "front"}']] == rows  # fmt: skip


def test_a_pipe(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Lines with tabs, and how many rows there are on stderr."""
    assert 0 == run("sql", "office", "select name, door_id / 3 as third from doors order by 1")

    out, err = capsys.readouterr()
    assert out == "name\tthird\nback\t0.6666666666666666\nfront\t0.3333333333333333\n"
    assert err == "2 rows\n"


@pytest.mark.usefixtures("terminal")
def test_a_terminal(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A table, times by the building's clocks, and no more rows than are wanted."""
    assert 0 == run("sql", "office", "select name, last_seen from doors order by 1 desc",
                    "--limit", "1")  # fmt: skip

    out, err = capsys.readouterr()
    assert "front" in out
    assert "2026-03-01 09:00:00.123+01:00" in out
    assert "back" not in out
    assert "the first 1 row; there are more." in err


@pytest.mark.parametrize("name", ["x.parquet", "x.csv", "x.json"])
def test_files(office: Path, name: str) -> None:
    """Their name tells the format; they are whole, or as they were."""
    assert 0 == run("sql", "office", "select name from doors order by 1", "--out", name)

    match name:
        case "x.parquet":
            assert ["back", "front"] == pq.read_table(name)["name"].to_pylist()
        case "x.csv":
            assert Path(name).read_text() == "name\nback\nfront\n"
        case "x.json":
            assert [{"name": "back"}, {"name": "front"}] == json.loads(Path(name).read_text())
    before = Path(name).read_bytes()
    assert 1 == run("sql", "office", "select 'a'::int from doors", "--out", name)
    assert before == Path(name).read_bytes()
    assert {"office", name} == {path.name for path in office.iterdir()}


def test_an_answer_without_rows(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Has its head, or is an empty list."""
    query = "select name from doors where door_id = 9"

    assert 0 == run("sql", "office", query)
    assert capsys.readouterr().out == "name\n"
    assert 0 == run("sql", "office", query, "--json")
    assert [] == json.loads(capsys.readouterr().out)
    assert 0 == run("sql", "office", query, "--out", "x.json")
    assert [] == json.loads(Path("x.json").read_text())


def test_a_query_from_a_file_or_a_pipe(
    office: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With line ends and comments, as people keep them."""
    Path("q.sql").write_text("-- how many\nselect count(*) as n\nfrom doors;\n")
    assert 0 == run("sql", "office", "--file", "q.sql", "--json")
    monkeypatch.setattr(sys, "stdin", io.StringIO("select 2 as n"))
    assert 0 == run("sql", "office", "-", "--json")

    out = capsys.readouterr().out
    assert '[\n{"n": 2}\n]\n' * 2 == out
    assert 1 == run("sql", "office", "--file", "nothing.sql")
    assert 2 == run("sql", "office", "select 1", "--file", "q.sql")


def test_without_a_query_the_views_are_told(
    office: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each column of each view, with what it means."""
    assert 0 == run("sql", "office", "--json")

    told = json.loads(capsys.readouterr().out)
    assert sum(map(len, COLUMNS_OF.values())) == len(told)
    assert {"view": "doors_at('now')", "column": "name", "meaning": "its name then"} in told


def test_several_logs(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The others bear their names."""
    with sl.create("west") as log:
        log.add_door(name="gate")
    query = "select name from west.doors except select name from doors"

    assert 0 == run("sql", "office", query, "--log", "west=west", "--json")
    assert [{"name": "gate"}] == json.loads(capsys.readouterr().out)
    for wrong in ("west", "=west", "west="):
        assert 2 == run("sql", "office", query, "--log", wrong) or wrong == "=west"
    assert 1 == run("sql", "office", query, "--log", "main=west")


def test_files_of_ones_own(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only for who says so."""
    Path("rooms.csv").write_text("name,room\nfront,hall\n")
    query = "select room from doors join 'rooms.csv' using (name)"

    assert 1 == run("sql", "office", query)
    assert "--allow-files" in capsys.readouterr().err
    assert 0 == run("sql", "office", query, "--allow-files", "--json")
    assert [{"room": "hall"}] == json.loads(capsys.readouterr().out)


def test_bad_input(office: Path, refuses: Refuses) -> None:
    """DuckDB's message with ours, and nothing is written."""
    refuses("""
        sql office 'from nothing'
        sql office 'select nix from doors'
        sql office 'from doors_at('"'"'bad'"'"')'
        sql office 'delete from events'
        sql office 'select 1' --out x.txt
        sql office 'select 1' --csv --json
        sql office 'select 1' --out office/x.csv
        sql office 'select 1' --limit 0
    """)

    assert ["office"] == [path.name for path in office.iterdir()]


def test_an_error_for_machines(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As every verb has it."""
    assert 1 == run("sql", "office", "from nothing", "--json")

    assert "SqlError" == json.loads(capsys.readouterr().out)["error"]["kind"]


WAITS = """
import os, sys, threading, time
from semmap_log.cli import main
from semmap_log.analysis.sql import sql_query

def tell(relation=sql_query.Query.table):
    def table(self, limit=None):
        threading.Timer(0.3, lambda: os.write(1, b"asked\\n")).start()
        return relation(self, limit)
    return table

sql_query.Query.table = tell()
main()
"""

ENDLESS = [
    "select sum(a.range * b.range) from range(100000000) a, range(100000000) b",
    "select count(*) from events a, events b, range(100000000000) c where c.range % 7 = a.event",
]


@pytest.mark.parametrize("query", ENDLESS)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_a_query_that_has_no_end(
    office: Path, query: str, number: signal.Signals
) -> None:
    """At once, with the exit code that other verbs have, and no traceback."""
    command = [sys.executable, "-c", WAITS, "sql", "office", query, "--out", "x.csv"]
    env = {**os.environ, "PYTHONPATH": str(Path(sl.__file__).parents[1])}
    with subprocess.Popen(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as one:
        assert one.stdout is not None
        assert one.stderr is not None
        assert one.stdout.readline() == b"asked\n"
        one.send_signal(number)
        code = one.wait(DEADLINE_S)
        err = one.stderr.read()

    assert (INTERRUPTED if number == signal.SIGINT else 128 + number) == code
    assert err == b""
    assert ["office"] == [path.name for path in office.iterdir()]


def test_a_query_from_a_pipe_that_is_no_text_is_an_error(tmp_path: Path) -> None:
    """In a line, as every other."""
    sl.create(tmp_path / "log", tz="UTC").close()

    done = subprocess.run(
        [sys.executable, "-m", "semmap_log", "sql", tmp_path / "log", "-"],
        input=b"SELECT \xff", capture_output=True, check=False, timeout=200,
        env={**os.environ, "PYTHONIOENCODING": "utf-8:strict"},
    )  # fmt: skip

    assert 1 == done.returncode
    assert b"Traceback" not in done.stderr
    assert done.stderr.startswith(b"semmap-log: ")


def test_a_query_from_a_pipe_that_never_ends_is_refused(
    office: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is read no further than the longest query may be."""
    endless = io.StringIO("select " + "1" * 2**23)
    monkeypatch.setattr(sys, "stdin", endless)

    assert 1 == run("sql", "office", "-")

    assert "expected a query of at most 1,048,576 characters" in capsys.readouterr().err
    assert endless.tell() < 2**21
