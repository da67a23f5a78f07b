"""The peer DuckDB over Parquet: the same answers from one file, by the best queries we found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

_KEY = "happened::HUGEINT * 1099511627776 + number"
"""One number that orders as (happened, number) does; a pair takes DuckDB three times as long."""
_VALUES = ("level", "x", "y", "theta", "width", "state", "prob_open", "prob_closed")

_DOOR_MAP = f"""
    SELECT door_id, {", ".join(f"arg_max({name}, key)" for name in _VALUES)},
        arg_max(happened, key) FILTER (state IS NOT NULL), arg_max(name, key)
    FROM (SELECT *, {_KEY} AS key FROM read_parquet(?)
          WHERE door_id IS NOT NULL AND happened <= ?)
    GROUP BY door_id
    HAVING bool_or(added IS NOT NULL) AND NOT bool_or(removed IS NOT NULL)
    ORDER BY door_id
"""  # noqa: S608
"""`arg_max` passes over NULLs: each field's last writer. One scan; a query for each field, or
QUALIFY row_number(), takes longer."""

_RANGE = """
    SELECT * FROM read_parquet(?) WHERE happened >= ? AND happened < ? ORDER BY number
"""
_HISTORY = "SELECT * FROM read_parquet(?) WHERE door_id = ? ORDER BY number"

_SORTED = """
    COPY (SELECT * FROM read_parquet(?) ORDER BY door_id, number)
    TO '{target}' (FORMAT parquet, COMPRESSION zstd)
"""

LAST_NS = 2**63 - 1


def connected(threads: int) -> Any:
    """Return a new connection that may use so many threads."""
    import duckdb

    connection = duckdb.connect()
    connection.execute(f"SET threads = {threads}")
    return connection


def door_map(connection: Any, path: Path, at_ns: int = LAST_NS) -> list[tuple[Any, ...]]:
    """Return the doors at a moment, as `answer_of_rows` takes them."""
    told: list[tuple[Any, ...]] = connection.execute(_DOOR_MAP, (str(path), at_ns)).fetchall()
    return told


def history(connection: Any, path: Path, door: int) -> dict[str, Any]:
    """Return all events about a door, as numpy columns."""
    told: dict[str, Any] = connection.execute(_HISTORY, (str(path), door)).fetchnumpy()
    return told


def write_sorted(connection: Any, path: Path, target: Path) -> int:
    """Write all events by door as another Parquet file, and return how many there are."""
    written = connection.execute(_SORTED.format(target=target), (str(path),)).fetchone()
    return int(written[0])


def between(connection: Any, path: Path, since_ns: int, until_ns: int) -> dict[str, Any]:
    """Return all events that happened in a range, as numpy columns."""
    told: dict[str, Any] = connection.execute(_RANGE, (str(path), since_ns, until_ns)).fetchnumpy()
    return told
