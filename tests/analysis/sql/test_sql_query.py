"""Queries: what names mean, several logs, and what is no question."""

from __future__ import annotations

import gc
import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

pytest.importorskip("duckdb")

import semmap_log as sl
from semmap_log.analysis.sql.answer_rows import json_rows, write_answer
from semmap_log.analysis.sql.sql_query import COLUMNS_OF, table_of_query
from semmap_log.errors import CommandError, CorruptLogError, FormatError, MomentError, SqlError
from semmap_log.log.replay.read_model.events_about import SegmentTables
from semmap_log.log.replay.read_model.indexing import index
from tests.analysis.sql.full_logs import full_log


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    return sl.read(full_log(tmp_path_factory.mktemp("log") / "log", 1))


def rows(log: sl.DoorLog, query: str, **others: Any) -> list[tuple[Any, ...]]:
    found: list[tuple[Any, ...]] = log.sql(query, **others).fetchall()
    return found


TWO_WAYS = {
    "with e as (select * from events) select count(*) from e": "select count(*) from events",
    "select count(*) from (from events where door_id = 1) as x": """
        select count(*) from "events" where door_id = 1""",
    "select count(*) from events e join doors d using (door_id)": """
        select count(*) from events where door_id in (select door_id from doors)""",
    "select door_id from doors_at('event:60') intersect select door_id from doors_at('now')": """
        select a.door_id from doors_at('event:60') a, doors_at('now') b
        where a.door_id = b.door_id""",
    "select count(*) from DOORS_AT('2h ago')": """
        select count(*) from main.doors_at(moment := '2h ago')""",
    "select count(*) from doors_at((select max(happened) from events))": """
        select count(*) from doors_at('now')""",
    """with t(m) as (values ('event:50'), ('event:90'))
       select m, count(*) from t, doors_at(m) group by m""": """
        select 'event:50', count(*) from doors_at('event:50')
        union all select 'event:90', count(*) from doors_at('event:90')""",
}


@pytest.mark.parametrize(("query", "same"), TWO_WAYS.items())
def test_two_ways_to_ask(log: sl.DoorLog, query: str, same: str) -> None:
    """CTEs, aliases, quoted names, any case, several moments, moments that come from a table."""
    assert sorted(rows(log, query)) == sorted(rows(log, same))
    assert rows(log, query)


def test_who_calls_something_by_a_views_name_gets_that(log: sl.DoorLog) -> None:
    """A CTE `events` is the query's own, also beside the function of a moment."""
    assert [(7,)] == rows(log, "with events as (select 7) from events")
    assert [(8,)] == rows(log, "with doors_at as (select 8) from doors_at")


def test_hours_are_those_of_the_building(log: sl.DoorLog) -> None:
    """The log's zone is the session's: an hour later than UTC in a winter of Vienna."""
    query = "select hour(happened), hour(happened at time zone 'UTC') from events limit 20"

    assert all((utc + 1) % 24 == local for local, utc in rows(log, query))


def test_columns_are_as_they_are_told(log: sl.DoorLog) -> None:
    """What the error about a wrong column lists is what `describe` lists."""
    for name, columns in COLUMNS_OF.items():
        view = f"{name}('now')" if name in {"doors_at", "doors_known_at", "beliefs"} else name
        described = [row[0] for row in rows(log, f"describe from {view}")]
        assert described == [column.name for column in columns]


def test_several_logs(log: sl.DoorLog, tmp_path: Path) -> None:
    """The first has the plain names, each its own, functions of a moment too."""
    other = sl.read(full_log(tmp_path / "log", 2, commits=40))
    count = "select count(*) from"

    mine, theirs = (rows(each, f"{count} events") for each in (log, other))
    assert mine != theirs
    assert [*mine, *theirs] == rows(
        log, f"{count} events union all {count} east.events", east=other
    )
    joined = sl.sql(f"{count} events union all {count} a.events union all {count} b.events",
                    a=other, b=log)  # fmt: skip
    assert [*theirs, *theirs, *mine] == joined.fetchall()
    assert rows(other, "from doors_at('event:9')") == rows(
        log, "from east.doors_at('event:9')", east=other
    )


@pytest.mark.parametrize("name", ["main", "a b", "temp", "1x"])
def test_names_that_a_log_cannot_have(log: sl.DoorLog, name: str) -> None:
    """DuckDB has taken them, or they are none."""
    with pytest.raises(CommandError, match="expected a name of letters"):
        log.sql("select 1", **{name: log})


def test_what_is_no_log(log: sl.DoorLog) -> None:
    """A misspelt keyword does not go unheard."""
    with pytest.raises(CommandError, match="allow_file"):
        log.sql("select 1", allow_file=True)
    with pytest.raises(CommandError, match="at least one log"):
        sl.sql("select 1")


def test_a_relation_outlives_its_log(tmp_path: Path) -> None:
    """It is worked out when it is read, and can be asked on."""
    relation = sl.read(full_log(tmp_path / "log", 1)).sql("select kind, event from events")
    gc.collect()

    frame = relation.filter("event < 2").df()

    assert ["LevelAdded", "LevelAdded"] == frame["kind"].tolist()
    assert {"kind", "event"} == set(relation.arrow().read_all().column_names)
    assert 2 == relation.limit(2).pl().height


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("select 1; select 2", "one SELECT statement, got 2 statements"),
        ("", "one SELECT statement, got none"),
        ("selec 1", "syntax error"),
        ("from nothing", r"(?s)nothing does not exist.*There are events, doors, .*doors_at"),
        ("select nix from doors", r"(?s)nix.*\ndoors: door_id, name, level_name"),
        ("from doors_at()", r"(?s)doors_at.*\ndoors_at: door_id"),
        ("select 1/0 + 'a'::int", "Could not convert"),
    ],
)
def test_what_is_no_question(log: sl.DoorLog, query: str, said: str) -> None:
    """DuckDB's message, and ours: which views there are, and their columns."""
    with pytest.raises(SqlError, match=said):
        table_of_query(query, log, {})


@pytest.mark.parametrize(
    ("moment", "said"),
    [("'bad'", "Expected a moment such as"), ("'event:99999'", "no event")],
)
@pytest.mark.parametrize("function", ["doors_at", "doors_known_at", "beliefs"])
def test_moments_that_are_none(log: sl.DoorLog, function: str, moment: str, said: str) -> None:
    """Our own error, as every other question has it."""
    with pytest.raises(sl.SemmapError, match=said) as caught:
        table_of_query(f"from {function}({moment})", log, {})

    assert not isinstance(caught.value, SqlError)
    if moment == "'bad'":
        assert isinstance(caught.value, MomentError)


@pytest.mark.parametrize("function", ["doors_at", "doors_known_at", "beliefs"])
def test_no_moment_has_no_rows(log: sl.DoorLog, function: str) -> None:
    """As of a round that goes on, whose end is null."""
    assert not len(table_of_query(f"from {function}(null)", log, {}))


def test_a_failure_holds_nothing(log: sl.DoorLog) -> None:
    """A query that failed leaves no threads of DuckDB behind."""
    before = len(list(Path("/proc/self/task").iterdir()))
    for _ in range(20):
        with pytest.raises(MomentError):
            table_of_query("from doors_at('bogus')", log, {})
    gc.collect()

    assert len(list(Path("/proc/self/task").iterdir())) <= before + 8


@pytest.mark.parametrize(
    ("query", "said"),
    [
        (None, "expected a query as text, got NoneType"),
        (b"select 1", "got bytes"),
        ("select '\udcff'", "in UTF-8"),
    ],
)
def test_what_is_no_text(log: sl.DoorLog, query: Any, said: str) -> None:
    """Our error, not that of whoever wraps DuckDB."""
    with pytest.raises(SqlError, match=said):
        log.sql(query)


def test_names_of_logs_are_told_apart_without_capitals(log: sl.DoorLog) -> None:
    """As SQL does it."""
    with pytest.raises(sl.SemmapError, match="another log has that name"):
        log.sql("select 1", a=log, A=log)


def test_a_damaged_log_says_so_itself(tmp_path: Path) -> None:
    """The log's own error, with its file, and no traceback of DuckDB's."""
    path = full_log(tmp_path / "log", 1)
    segment = sorted(path.glob("*.mcap"))[1]
    data = bytearray(segment.read_bytes())
    data[data.rindex(b"semmap_index") - 300] ^= 1  # in its last chunk
    segment.write_bytes(data)

    with pytest.raises(CorruptLogError, match=segment.name):
        table_of_query("select max(accuracy_open) from events", sl.read(path), {})


@pytest.mark.parametrize("column", ["kind", "recorded_ns", "actor"])
def test_a_damaged_table_is_not_used(
    tmp_path: Path, column: str, caplog: pytest.LogCaptureFixture
) -> None:
    """A flipped bit in a page that the query wants: the log itself answers."""
    path = full_log(tmp_path / "log", 3)
    query = "select event, kind, state, actor, happened_ns, recorded_ns from events order by 1"
    expected = rows(sl.read(path), query)
    index(path)
    for table in (path / "index").glob("*.events.parquet"):
        place = pq.read_schema(table).names.index(column)
        chunk = pq.read_metadata(table).row_group(0).column(place)
        data = bytearray(table.read_bytes())
        first = chunk.dictionary_page_offset or chunk.data_page_offset
        data[first + chunk.total_compressed_size - 1] ^= 4
        table.write_bytes(data)
    caplog.set_level("INFO", logger="semmap_log")

    assert expected == rows(sl.read(path), query)
    assert "not what was written" in caplog.text


def test_tables_are_used_where_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Few columns of all events come from them, those of the live end from the log."""
    path = full_log(tmp_path / "log", 3)
    made = index(path).made
    given: list[str] = []
    read = SegmentTables.all_rows

    def seen(tables: SegmentTables, names: Any) -> Any:
        given.append(tables.stem)
        return read(tables, names)

    monkeypatch.setattr(SegmentTables, "all_rows", seen)
    rows(sl.read(path), "select door_id, hour(happened), count(*) from events group by all")

    assert sorted(Path(name).stem for name in made) == sorted(given)


@pytest.mark.parametrize(
    ("query", "told"),
    [
        ("select interval '1 month 2 days 3 hours' as x", "1 month 2 days 03:00:00"),
        ("select timestamptz '2026-01-01 12:00+00' - timestamptz '2026-01-01 11:35:00.5+00' as x",
         "00:24:59.5"),
        ("select -interval '90 seconds' as x", "-00:01:30"),
        ("select timestamptz 'infinity' as x", "infinity"),
        ("select date '20000-03-15' as x", "20000-03-15"),
        ("select [timestamptz '-infinity'] as x", ["-infinity"]),
        ("select map {} as x", {}),
        ("select map {'a': 1} as x", {"a": 1}),
    ],
)  # fmt: skip
def test_what_json_does_not_know_is_text(
    log: sl.DoorLog, tmp_path: Path, query: str, told: Any
) -> None:
    """Spans as DuckDB writes them, times that no calendar of Python's has, maps without keys."""
    answer = table_of_query(query, log, {})

    assert [{"x": told}] == list(json_rows(answer))
    write_answer(answer, tmp_path / "x.json")
    assert [{"x": told}] == json.loads((tmp_path / "x.json").read_text())
    if "interval" in query:
        write_answer(answer, tmp_path / "x.parquet")
        assert [{"x": told}] == pq.read_table(tmp_path / "x.parquet").to_pylist()


def test_what_parquet_cannot_have_is_said(log: sl.DoorLog, tmp_path: Path) -> None:
    """And which file can have it."""
    answer = table_of_query("select union_value(num := 2) as x", log, {})

    with pytest.raises(FormatError, match=r"x\.parquet.*write"):
        write_answer(answer, tmp_path / "x.parquet")
    assert [] == list(tmp_path.iterdir())
