"""A query in SQL about one log, or several: as a relation of DuckDB, or as a whole table.

Only one SELECT is taken, in a DuckDB of its own that is closed to all but the logs' views. What a
relation raises while it is read is DuckDB's; `table_of_query` says it in our words.
"""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Mapping
from typing import Any

from semmap_log.analysis.sql.duckdb_sdk import duckdb
from semmap_log.analysis.sql.query_session import NAMELESS, open_session
from semmap_log.analysis.sql.row_making import RowMaking
from semmap_log.analysis.sql.view_words import columns_in_words, views_in_words
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError, SemmapError, SqlError
from semmap_log.log.door_log.door_log import DoorLog

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)
TAKEN = {"main", "temp", "system", "memory", "pg_catalog", "information_schema"}

LOOKS_S = 0.1
"""How often Ctrl-C is looked for."""


def sql(query: str, *, allow_files: bool = False, **logs: DoorLog) -> Any:
    """Return what a query in SQL about some logs answers, as a relation of DuckDB.

        sl.sql("select * from east.doors join west.doors using (name)", east=one, west=other)

    Args:
        query: One SELECT: see `DoorLog.sql`.
        allow_files: It may read files.
        **logs: By the names that stand before their views. The first one's have none, too.

    Raises:
        SqlError: It is no question, or names what is not there.
        MissingExtraError: duckdb or pyarrow is not installed.
    """
    if not logs:
        raise CommandError("sql: expected at least one log, as sql(query, office=log); got none.")
    first = next(iter(logs.values()))
    return Query(query, {NAMELESS: first, **logs}, allow_files=allow_files).relation


def sql_of_log(
    query: str, log: DoorLog, others: Mapping[str, DoorLog], *, allow_files: bool
) -> Any:
    """Return the same about a log, whose views need no name: see `DoorLog.sql`."""
    return Query(query, {NAMELESS: log, **others}, allow_files=allow_files).relation


def table_of_query(
    query: str,
    log: DoorLog,
    others: Mapping[str, DoorLog],
    *,
    allow_files: bool = False,
    limit: int | None = None,
) -> pa.Table:
    """Return all that a query answers as a pyarrow.Table; Ctrl-C ends it at once.

    Args:
        query: One SELECT: see `DoorLog.sql`.
        log: Whose views have no name before them.
        others: More logs, by the names that stand before theirs.
        allow_files: It may read files.
        limit: So many rows at most; None: all.

    Raises:
        SqlError: It is no question, names what is not there, or cannot be worked out.
        CorruptLogError: A log is damaged.
    """
    return Query(query, {NAMELESS: log, **others}, allow_files=allow_files).table(limit)


class Query:
    """A query that DuckDB has understood; nothing was read for it yet."""

    def __init__(self, query: str, logs: Mapping[str, DoorLog], *, allow_files: bool) -> None:
        """Have a query understood.

        Args:
            query: One SELECT.
            logs: By the names that stand before their views.
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
        """Return the answer, of so many rows at most.

        It is worked out on a thread of its own: while DuckDB works, Python hears of no signal.
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
        """Return the error of a view that could not be made, else what DuckDB said, and ours."""
        ours = self._making.taken_failure()
        if isinstance(ours, SemmapError):
            return ours
        said = str(error)
        if isinstance(error, duckdb.CatalogException):
            return SqlError(f"{said}\n{views_in_words([*self._logs])}")
        if isinstance(error, duckdb.BinderException):
            return SqlError(f"{said}\n{columns_in_words(self._query)}")
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
    """Return if a query is a text that DuckDB can be given.

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
    """Return if a query is one SELECT: what else there is writes, or changes settings.

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
    """Return if no part of a SELECT writes: a COPY may stand in a CTE.

    Without files to reach it could not be done; where they are allowed, DuckDB would do it.

    Raises:
        SqlError: One does, or the parts cannot be told.
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
