"""A query in SQL about one log, or several: as a relation of DuckDB, or as a whole table.

Only one SELECT is allowed, in a DuckDB in memory with the logs' views, closed to all else: no
files, no settings. Errors while a relation is read are DuckDB's; `table_of_query` raises them in
our words. An error about an unknown name lists the views and their columns.
"""

from __future__ import annotations

import json
import re
import threading
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from semmap_log.analysis.recorded_later import recorded_later
from semmap_log.analysis.sql.duckdb_sdk import duckdb
from semmap_log.analysis.sql.log_views import (
    ANNOTATIONS,
    BELIEF_SCHEMA,
    DOOR_SCHEMA,
    EVENTS,
    FUNCTIONS,
    VIEWS,
    RowMaking,
    belief_table,
    door_table,
    log_views,
)
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.event_view import EVENT_VIEW
from semmap_log.core.arrow.table import Column
from semmap_log.core.model.moments import Time
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError, KnownLaterWarning, SemmapError, SqlError
from semmap_log.log import DoorLog

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
TAKEN = {"main", "temp", "system", "memory", "pg_catalog", "information_schema"}

LOOKS_S = 0.1
"""Interval between checks for Ctrl-C."""


def sql(query: str, *, allow_files: bool = False, **logs: DoorLog) -> Any:
    """Return the answer of an SQL query about some logs, as a relation of DuckDB.

        sl.sql("select * from east.doors join west.doors using (name)", east=one, west=other)

    Args:
        query: One SELECT: see `DoorLog.sql`.
        allow_files: It may read files.
        **logs: By the prefixes of their views. The first log's views also have no prefix.

    Raises:
        SqlError: It is no query, or names something unknown.
        MissingExtraError: duckdb or pyarrow is not installed.
    """
    if not logs:
        raise CommandError("sql: expected at least one log, as sql(query, office=log); got none.")
    first = next(iter(logs.values()))
    return Query(query, {NAMELESS: first, **logs}, allow_files=allow_files).relation


def sql_of_log(
    query: str, log: DoorLog, others: Mapping[str, DoorLog], *, allow_files: bool
) -> Any:
    """Return the answer about one log, whose views have no prefix: see `DoorLog.sql`."""
    return Query(query, {NAMELESS: log, **others}, allow_files=allow_files).relation


def table_of_query(
    query: str,
    log: DoorLog,
    others: Mapping[str, DoorLog],
    *,
    allow_files: bool = False,
    limit: int | None = None,
) -> pa.Table:
    """Return the complete answer of a query as a pyarrow.Table; Ctrl-C ends it at once.

    Args:
        query: One SELECT: see `DoorLog.sql`.
        log: The log whose views have no prefix.
        others: More logs, by the prefixes of their views.
        allow_files: It may read files.
        limit: The maximum number of rows; None: all.

    Raises:
        SqlError: It is no query, names something unknown, or fails.
        CorruptLogError: A log is damaged.
    """
    return Query(query, {NAMELESS: log, **others}, allow_files=allow_files).table(limit)


class Query:
    """A query that DuckDB has parsed; nothing was read for it yet."""

    def __init__(self, query: str, logs: Mapping[str, DoorLog], *, allow_files: bool) -> None:
        """Parse a query.

        Args:
            query: One SELECT.
            logs: By the prefixes of their views.
            allow_files: It may read files.
        """
        _check_logs(logs)
        _check_text(query)
        self._query, self._logs = query, logs
        self._making = RowMaking()
        self._connection = open_session(logs, self._making, allow_files=allow_files)
        try:
            _check_is_question(self._connection, query)
            if allow_files:
                _check_only_reads(self._connection, query)
            self.relation = self._connection.sql(query)
        except duckdb.Error as error:
            raise self._in_our_words(error) from error

    def table(self, limit: int | None = None) -> pa.Table:
        """Return the answer, of at most `limit` rows.

        The query runs on a thread of its own: while DuckDB works, Python receives no signal.
        """
        wanted = self.relation if limit is None else self.relation.limit(limit)
        done: dict[str, Any] = {}
        has_ended = threading.Event()  # an interrupted `Thread.join` would take it for ended

        def work() -> None:
            try:
                done["table"] = wanted.to_arrow_table()
            except BaseException as error:  # noqa: BLE001 - raised where somebody waits for it
                done["error"] = error
            finally:
                has_ended.set()

        threading.Thread(target=work, name="semmap-log-sql").start()
        try:
            while not has_ended.wait(LOOKS_S):
                pass
        except BaseException:
            self._making.stop()
            self._connection.interrupt()
            has_ended.wait()  # or it would come back into an interpreter that is gone
            raise
        error = done.get("error")
        if isinstance(error, duckdb.Error | OSError | RuntimeError):
            raise self._in_our_words(error) from error
        if error is not None:
            raise error
        return done["table"]

    def _in_our_words(self, error: Exception) -> Exception:
        """Return the error of a view that could not be made, else DuckDB's with our hints."""
        ours = self._making.taken_failure()
        if isinstance(ours, SemmapError):
            return ours
        said = str(error)
        if isinstance(error, duckdb.CatalogException):
            return SqlError(f"{said}\n{views_text([*self._logs])}")
        if isinstance(error, duckdb.BinderException):
            return SqlError(f"{said}\n{columns_text(self._query)}")
        if isinstance(error, duckdb.PermissionException):
            return SqlError(
                f"{said}\nA query reads no files unless it is allowed to: --allow-files, or "
                "allow_files=True."
            )
        return SqlError(said)


def _check_logs(logs: Mapping[str, Any]) -> None:
    seen: set[str] = set()
    for name, log in reversed([*logs.items()]):  # the nameless one is mostly another's, too
        if not isinstance(log, DoorLog):
            told = f" {name}:" if name else ""
            raise CommandError(f"sql:{told} expected a log, got {type(log).__name__}.")
        if name.lower() in seen:
            raise CommandError(f"{name!r}: another log has that name; SQL knows no capitals.")
        seen.add(name.lower())
        if name != NAMELESS and (not NAME.fullmatch(name) or name.lower() in TAKEN):
            raise CommandError(
                f"{name!r}: expected a name of letters, digits and _ for the log's views, and none "
                "that DuckDB has taken, such as main."
            )


def _check_text(query: Any) -> None:
    """Check that a query is a text that DuckDB accepts.

    Raises:
        SqlError: It is not.
    """
    if not isinstance(query, str):
        raise SqlError(f"expected a query as text, got {type(query).__name__}.")
    try:
        query.encode()
    except UnicodeEncodeError:
        raise SqlError("expected a query in UTF-8, got other bytes.") from None


def _check_is_question(connection: duckdb.DuckDBPyConnection, query: str) -> None:
    """Check that a query is one SELECT: other statements write, or change settings.

    Raises:
        SqlError: It is not.
    """
    statements = connection.extract_statements(query)
    if len(statements) != 1:
        got = counted(len(statements), "statement") if statements else "none"
        raise SqlError(f"expected one SELECT statement, got {got}.")
    kind = statements[0].type
    if kind != duckdb.StatementType.SELECT:
        raise SqlError(
            f"expected a SELECT (or FROM, WITH, DESCRIBE, SUMMARIZE), got {kind.name}: a query "
            "only reads."
        )


ASKING_NODES = {"SELECT_NODE", "SET_OPERATION_NODE", "RECURSIVE_CTE_NODE", "CTE_NODE"}
"""What DuckDB's parser calls the parts of a query that only read."""


def _check_only_reads(connection: duckdb.DuckDBPyConnection, query: str) -> None:
    """Check that no part of a SELECT writes: a COPY may stand in a CTE.

    Without access to files DuckDB refuses this; where they are allowed, it would do it.

    Raises:
        SqlError: One does, or the parts are unknown.
    """
    ((said,),) = connection.execute("SELECT json_serialize_sql(?)", [query]).fetchall()
    parsed = json.loads(said)
    if parsed.get("error", True):
        raise SqlError(f"not allowed with files: {parsed.get('error_message', 'not understood')}")
    waiting: list[Any] = [parsed]
    while waiting:
        part = waiting.pop()
        if isinstance(part, dict):
            kind = str(part.get("type"))
            if kind.endswith("_NODE") and kind not in ASKING_NODES:
                raise SqlError(f"got {kind.removesuffix('_NODE')} in the query: it only reads.")
        waiting += part.values() if isinstance(part, dict) else part
        waiting = [each for each in waiting if isinstance(each, dict | list)]


NAMELESS = ""
"""The key of the log whose views have no prefix."""

CONFIG = {
    "autoinstall_known_extensions": "false",
    "autoload_known_extensions": "false",
    "allow_community_extensions": "false",
    "allow_persistent_secrets": "false",
    "python_enable_replacements": "false",  # or a query would see the variables of its caller
    "temp_directory": "",  # what does not fit into memory is an error, and no file
}


def open_session(
    logs: Mapping[str, DoorLog], making: RowMaking, *, allow_files: bool
) -> duckdb.DuckDBPyConnection:
    """Return a connection with the views of logs, and no access to anything else.

    Args:
        logs: By the prefixes of their views; `NAMELESS`: no prefix.
        making: Records errors while rows are made.
        allow_files: Queries may read files.
    """
    connection = duckdb.connect(":memory:", config=dict(CONFIG))
    zone = next(iter(logs.values())).info.timezone
    connection.execute(f"SET TimeZone = {_text(zone)}")
    for name, log in logs.items():
        _add_log(connection, name, log, making)
    if not allow_files:
        connection.execute("SET enable_external_access = false")
    connection.execute("SET lock_configuration = true")
    return connection


def _add_log(
    connection: duckdb.DuckDBPyConnection, name: str, log: DoorLog, making: RowMaking
) -> None:
    """Add the views and functions of a log; those of a log with a prefix are in a schema."""
    schema = f"{_quoted(name)}." if name else ""
    if name:
        connection.execute(f"CREATE SCHEMA {_quoted(name)}")
    for view, table in log_views(log, making).items():
        hidden = f"__{name}_{view}" if name else view
        connection.register(hidden, table)
        if name:
            connection.execute(f"CREATE VIEW {schema}{view} AS FROM {_quoted(hidden)}")

    functions = (
        _Function("doors_at", ("moment",), DOOR_SCHEMA,
                  lambda at: door_table(log.replay(at=at))),
        _Function("doors_known_at", ("moment",), DOOR_SCHEMA,
                  _KnownAsOf(log).table),
        _Function("beliefs", ("moment := 'now'", "horizon := NULL"), BELIEF_SCHEMA,
                  lambda at, horizon: belief_table(log, at, horizon)),
    )  # fmt: skip
    for function in functions:
        hidden = f"__{name}_{function.name}"
        _add_maker(connection, hidden, function, making.noted(_maker(log, function)))
        _add_macro(connection, f"{schema}{function.name}", function, hidden)


class _Function(NamedTuple):
    """A function that makes rows of a moment."""

    name: str
    parameters: tuple[str, ...]
    """The moment first; each with its default."""
    rows: pa.Schema
    make: Callable[..., pa.Table]
    """Called with the moment, and the text of each other argument."""


class _KnownAsOf:
    """The doors as they were known; it warns once if they were only recorded later."""

    def __init__(self, log: DoorLog) -> None:
        self._log = log
        self._has_noted = False

    def table(self, known_at: Time) -> pa.Table:
        """Return them at a moment."""
        found = self._log.replay(known_at=known_at)
        if not found.doors and not self._has_noted:
            remedy = "with all that is known today, ask doors_at('{then}')"
            if later := recorded_later(self._log, None, known_at, remedy=remedy):
                self._has_noted = True
                warnings.warn(f"doors_known_at: {later}", KnownLaterWarning, stacklevel=2)
        return door_table(found)


Make = Callable[[tuple[Any, ...]], pa.Table]
"""Makes rows of arguments: the moment's text, its type, and the text of each other one."""


def _maker(log: DoorLog, function: _Function) -> Make:
    def rows_of(arguments: tuple[Any, ...]) -> pa.Table:
        moment, type_, *more = arguments
        if moment is None:  # a round that goes on has no end, and so no doors at its end
            return function.rows.empty_table()
        return function.make(_moment(log, moment, type_), *more)

    return rows_of


def _add_maker(
    connection: duckdb.DuckDBPyConnection, hidden: str, function: _Function, make: Make
) -> None:
    """Add the function that makes lists of rows, of many moments at once."""
    rows = function.rows
    takes: dict[int, Callable[..., pa.Array]] = {
        1: lambda moment, type_: _lists(rows, make, moment, type_),
        2: lambda moment, type_, more: _lists(rows, make, moment, type_, more),
    }  # DuckDB counts the parameters of what it calls
    count = len(function.parameters)
    none = pa.array([], pa.list_(pa.struct(list(rows))))
    returned = connection.from_arrow(pa.table({"rows": none})).types[0]
    connection.create_function(
        hidden, takes[count], ["VARCHAR"] * (count + 1), returned,
        type="arrow", null_handling="special",
    )  # fmt: skip


def _add_macro(
    connection: duckdb.DuckDBPyConnection, name: str, function: _Function, hidden: str
) -> None:
    """Add a macro that unfolds the list.

    So the moment may be any expression, also one of another table's columns, and DuckDB itself
    finds out what a name means.
    """
    names = [parameter.partition(" ")[0] for parameter in function.parameters]
    texts = [f"CAST({each} AS VARCHAR)" for each in names]
    texts.insert(1, f"typeof({names[0]})")
    connection.execute(
        f"CREATE MACRO {name}({', '.join(function.parameters)}) AS TABLE "
        f"SELECT unnest({_quoted(hidden)}({', '.join(texts)}), recursive := true)"
    )


def _moment(log: DoorLog, text: str, type_: str) -> Time:
    """Return the moment that a value of a query means.

    An instant of SQL stands for all of its microsecond, so that `doors_at(happened)` includes the
    event of that time.

    Raises:
        MomentError: It is not a moment.
    """
    if not type_.startswith("TIMESTAMP") or "_NS" in type_:
        return text
    ns = log.moment(text).ns
    assert ns is not None, "a time, and no event"
    return ns + 999


def _lists(rows: pa.Schema, make: Make, *arguments: pa.ChunkedArray) -> pa.Array:
    """Return the rows made of each row of arguments, as a list of structs."""
    made = [make(row) for row in zip(*(each.to_pylist() for each in arguments), strict=True)]
    ends = np.cumsum([0, *(table.num_rows for table in made)], dtype=np.int32)
    joined = pa.concat_tables([rows.empty_table(), *made])
    columns = [_in_one_piece(column) for column in joined.columns]
    structs = pa.StructArray.from_arrays(columns, fields=list(rows))
    return pa.ListArray.from_arrays(pa.array(ends), structs)


def _in_one_piece(column: pa.ChunkedArray) -> pa.Array:
    whole = column.combine_chunks()
    return whole.combine_chunks() if isinstance(whole, pa.ChunkedArray) else whole


def _quoted(name: str) -> str:
    doubled = name.replace('"', '""')
    return f'"{doubled}"'


def _text(value: str) -> str:
    doubled = value.replace("'", "''")
    return f"'{doubled}'"


COLUMNS_OF: Mapping[str, tuple[Column, ...]] = {
    EVENTS: EVENT_VIEW,
    **{
        name: (*columns, ANNOTATIONS) if name.startswith("doors") else columns
        for name, columns in (*VIEWS.items(), *FUNCTIONS.items())
    },
}
"""The columns of each view and function."""


def columns_table() -> pa.Table:
    """Return a row for each column of each view, with its meaning."""
    rows = [
        {
            "view": f"{name}('now')" if name in FUNCTIONS else name,
            "column": column.name,
            "meaning": column.says,
        }
        for name, columns in COLUMNS_OF.items()
        for column in columns
    ]
    return pa.Table.from_pylist(rows)


def views_text(logs: Sequence[str]) -> str:
    """Return the views of logs, which are given by their prefixes."""
    functions = [f"{name}('2h ago')" for name in FUNCTIONS]
    told = f"There are {', '.join([EVENTS, *VIEWS, *functions])}."
    named = [name for name in logs if name]
    if named:
        told += f" The same of other logs: {', '.join(f'{name}.{EVENTS}' for name in named)}, …"
    return f"{told} `describe events` shows the columns of one."


def columns_text(query: str) -> str:
    """Return the columns of the views that a query names, or of all if it names none."""
    views = {name: [column.name for column in columns] for name, columns in COLUMNS_OF.items()}
    named = [name for name in views if re.search(rf"\b{name}\b", query, re.IGNORECASE)]
    return "\n".join(f"{name}: {', '.join(views[name])}" for name in named or views)
