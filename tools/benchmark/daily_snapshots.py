"""The peer DuckDB with a snapshot a day: as a careful user keeps a table that is asked for moments.

One database file: the events in the order in which they happened, so that a day of them is found
without a scan, and how each door was at each midnight. A moment is the snapshot before it and the
events since then. The snapshots are right because the table is complete when they are made: an
event that is told late would change those behind it, which nobody here has to do.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmark.logs import DAY_NS
from benchmark.patrol import START_NS
from benchmark.tables import write_parquet

_KEY = "happened::HUGEINT * 1099511627776 + number"
_VALUES = ("level", "x", "y", "theta", "width", "state", "prob_open", "prob_closed")
_LATEST = f"""
    {", ".join(f"arg_max({name}, key) AS {name}" for name in _VALUES)},
    arg_max(happened, key) FILTER (state IS NOT NULL) AS seen, arg_max(name, key) AS name,
    bool_or(added IS NOT NULL) AS added, bool_or(removed IS NOT NULL) AS removed
"""
_TOLD = (*_VALUES, "seen", "name")

_MAKE = f"""
    CREATE TABLE events AS
        SELECT *, {_KEY} AS key FROM read_parquet(?) WHERE door_id IS NOT NULL ORDER BY key;
    CREATE TABLE snapshots AS
        WITH of_days AS (
            SELECT door_id, (happened - {START_NS}) // {DAY_NS} + 1 AS day, {_LATEST}
            FROM events GROUP BY ALL),
        midnights AS (
            SELECT door_id, day FROM (SELECT DISTINCT door_id FROM events),
                (SELECT unnest(generate_series(0, max(day))) AS day FROM of_days))
        SELECT day, door_id,
            {", ".join(f"last_value({name} IGNORE NULLS) OVER so_far AS {name}" for name in _TOLD)},
            coalesce(bool_or(added) OVER so_far, false) AS added,
            coalesce(bool_or(removed) OVER so_far, false) AS removed
        FROM midnights LEFT JOIN of_days USING (door_id, day)
        WINDOW so_far AS (PARTITION BY door_id ORDER BY day)
        ORDER BY day, door_id;
"""  # noqa: S608

_DOOR_MAP = f"""
    WITH since AS (
        SELECT door_id, {_LATEST} FROM events WHERE happened >= $midnight AND happened <= $at
        GROUP BY door_id)
    SELECT door_id, {", ".join(f"coalesce(since.{name}, midnight.{name})" for name in _TOLD)}
    FROM (SELECT * FROM snapshots WHERE day = $day) AS midnight LEFT JOIN since USING (door_id)
    WHERE (midnight.added OR since.added)
        AND NOT (midnight.removed OR coalesce(since.removed, false))
    ORDER BY door_id
"""  # noqa: S608


def write_snapshots(path: Path, count: int) -> None:
    """Write a patrol as a database of its events and of the doors at each midnight."""
    import duckdb

    parquet = path.with_suffix(".parquet")
    write_parquet(parquet, count)
    with duckdb.connect(str(path)) as connection:
        first, second = _MAKE.split(";")[:2]
        connection.execute(first, (str(parquet),))
        connection.execute(second)
    parquet.unlink()


def connected(path: Path, threads: int) -> Any:
    """Return a connection to that database which may use so many threads."""
    import duckdb

    connection = duckdb.connect(str(path), read_only=True)
    connection.execute(f"SET threads = {threads}")
    return connection


def door_map(connection: Any, at_ns: int) -> list[tuple[Any, ...]]:
    """Return the doors at a moment, as `answer_of_rows` takes them."""
    day = (at_ns - START_NS) // DAY_NS
    moment = {"midnight": START_NS + day * DAY_NS, "at": at_ns, "day": day}
    told: list[tuple[Any, ...]] = connection.execute(_DOOR_MAP, moment).fetchall()
    return told
