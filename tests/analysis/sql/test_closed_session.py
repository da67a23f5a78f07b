"""A query reads the log's views, and nothing else: no file, no setting, no variable of Python."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("duckdb")

import semmap_log as sl
from semmap_log.analysis.sql.sql_query import table_of_query
from semmap_log.errors import SqlError
from tests.analysis.sql.full_logs import full_log


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    return sl.read(full_log(tmp_path_factory.mktemp("log") / "log", 1, commits=20))


SECRET = "secret.csv"
READING = [
    "from read_csv('{file}')",
    "from '{file}'",
    "from read_text('{file}')",
    "from read_blob('{file}')",
    "from sniff_csv('{file}')",
    "from read_parquet('{file}')",
    "from read_json('{file}')",
    "from parquet_metadata('{file}')",
    "from glob('{folder}/*')",
    "select * from events, read_csv('{file}')",
    "select (select count(*) from read_text('{file}'))",
    "with x as (from read_text('{file}')) from x",
    "from query('from read_text(''{file}'')')",
    "from query_table('{file}')",
    "from json_execute_serialized_sql(json_serialize_sql('from read_text(''{file}'')'))",
    "select getenv('HOME')",
    "from secret_of_the_caller",
]
WRITING = [
    "copy (from events) to '{folder}/out.csv'",
    "copy events to '{folder}/out.parquet'",
    "export database '{folder}/out'",
    "attach '{folder}/out.db'",
    "attach ':memory:' as other",
    "create table out as from events",
    "create view out as from events",
    "create macro out() as 1",
    "with x as (copy (select 1) to '{folder}/out.csv' (format csv)) from x",
    "with x as (copy events to '{folder}/out.parquet') from x",
    "explain analyze copy (from events) to '{folder}/out.csv'",
    "insert into events values (1)",
    "delete from events",
    "drop view events",
    "pragma enable_profiling",
    "call enable_logging()",
    "install httpfs",
    "load httpfs",
    "set threads = 1",
    "set enable_external_access = true",
    "reset enable_external_access",
    "set lock_configuration = false",
    "use memory",
    "prepare x as select 1",
    "vacuum",
    "checkpoint",
    "begin",
]


@pytest.mark.parametrize("attack", READING)
def test_no_file_is_read(log: sl.DoorLog, tmp_path: Path, attack: str) -> None:
    """However it is asked for."""
    secret_of_the_caller = log.to_arrow(columns=["event"])
    file = tmp_path / SECRET
    file.write_text("word\nxyzzy\n")

    with pytest.raises(SqlError) as caught:
        table_of_query(attack.format(file=file, folder=tmp_path), log, {})

    assert "xyzzy" not in str(caught.value)
    assert len(secret_of_the_caller)


@pytest.mark.parametrize("attack", WRITING)
@pytest.mark.parametrize("allow_files", [False, True])
def test_nothing_is_written_or_set(
    log: sl.DoorLog, tmp_path: Path, attack: str, allow_files: bool
) -> None:
    """Not even by who may read files: a query is one SELECT."""
    with pytest.raises(SqlError, match=r"only reads|syntax error|no files"):
        table_of_query(attack.format(folder=tmp_path), log, {}, allow_files=allow_files)

    assert [] == list(tmp_path.iterdir())


def test_an_attack_behind_a_question(log: sl.DoorLog, tmp_path: Path) -> None:
    """Several statements are none."""
    with pytest.raises(SqlError, match="2 statements"):
        log.sql(f"select 1; copy (select 1) to '{tmp_path}/out.csv'")


def test_what_does_not_fit_into_memory_goes_into_no_file(log: sl.DoorLog) -> None:
    """DuckDB has no folder to put it in; and nobody can give it one."""
    found = log.sql("select value from duckdb_settings() where name = 'temp_directory'").fetchall()

    assert found in ([("",)], [(None,)])
    with pytest.raises(Exception, match="locked"):
        log.sql("from enable_logging()").fetchall()


def test_who_may_reads_a_file_of_his_own(
    log: sl.DoorLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A CSV to join with, by a path from where the caller is."""
    (tmp_path / "rooms.csv").write_text("door_id,room\n1,kitchen\n")
    monkeypatch.chdir(tmp_path)
    query = "select distinct room from events join 'rooms.csv' using (door_id)"

    assert [("kitchen",)] == log.sql(query, allow_files=True).fetchall()
    with pytest.raises(SqlError, match="allow-files"):
        log.sql(query)
    with pytest.raises(SqlError, match="httpfs"):
        table_of_query("from 'https://example.org/x.csv'", log, {}, allow_files=True)
