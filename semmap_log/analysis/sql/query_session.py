"""A DuckDB in memory with the views of some logs, closed to all else: no files, no settings."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from semmap_log.analysis.sql.duckdb_sdk import duckdb
from semmap_log.analysis.sql.log_views import log_views
from semmap_log.analysis.sql.moment_rows import BELIEF_SCHEMA, DOOR_SCHEMA, belief_table, door_table
from semmap_log.analysis.sql.row_making import RowMaking
from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.errors import KnownLaterWarning
from semmap_log.log.door_log.door_log import DoorLog, Time
from semmap_log.log.door_log.known_later import known_later

NAMELESS = ""
"""Stands for the log whose views have no name before them."""

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
    """Return a connection that has the views of logs, and no way to get at anything else.

    Args:
        logs: By the names that stand before their views; `NAMELESS`: none does.
        making: Takes in what goes wrong while rows are made.
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
    """Add the views and functions of a log; those of a named one stand in a schema."""
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
                  _KnownThen(log).table),
        _Function("beliefs", ("moment := 'now'", "horizon := NULL"), BELIEF_SCHEMA,
                  lambda at, horizon: belief_table(log, at, horizon)),
    )  # fmt: skip
    for function in functions:
        hidden = f"__{name}_{function.name}"
        _add_maker(connection, hidden, function, making.noted(_maker(log, function)))
        _add_macro(connection, f"{schema}{function.name}", function, hidden)


class _Function(NamedTuple):
    """What makes rows of a moment."""

    name: str
    parameters: tuple[str, ...]
    """The moment first; each with its default."""
    rows: pa.Schema
    make: Callable[..., pa.Table]
    """Called with the moment, and the text of each other argument."""


class _KnownThen:
    """The doors as they were known; it says once if they were only told of later."""

    def __init__(self, log: DoorLog) -> None:
        self._log = log
        self._has_said = False

    def table(self, known_at: Time) -> pa.Table:
        """Return them at a moment."""
        found = self._log.replay(known_at=known_at)
        if not found.doors and not self._has_said:
            remedy = "with all that is known today, ask doors_at('{then}')"
            if later := known_later(self._log, None, known_at, remedy=remedy):
                self._has_said = True
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
    """Add what makes lists of rows, of many moments at once."""
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

    An instant of SQL stands for all of its microsecond, so that `doors_at(happened)` has seen what
    happened then.

    Raises:
        MomentError: It means none.
    """
    if not type_.startswith("TIMESTAMP") or "_NS" in type_:
        return text
    ns = log.moment(text).ns
    assert ns is not None, "a time, and no event"
    return ns + 999


def _lists(rows: pa.Schema, make: Make, *arguments: pa.ChunkedArray) -> pa.Array:
    """Return for each row of arguments the rows that are made of it, as a list of structs."""
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
