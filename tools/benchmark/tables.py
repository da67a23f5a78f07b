"""A patrol as the table that somebody else would keep: a column for each thing an event sets.

An event that does not set a field has NULL there. The tables are written before anything is
measured; so these peers are spared what our log does when it reads: to tell kinds apart, to check.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmark.patrol import BLOCK, OBSERVED, PASSED, POSE, Rows, blocks, name_of
from benchmark.plain_fold import states, writers

COLUMNS = {
    "number": "BIGINT", "happened": "BIGINT", "kind": "TINYINT", "door_id": "INTEGER",
    "added": "TINYINT", "removed": "TINYINT", "level": "SMALLINT", "x": "DOUBLE", "y": "DOUBLE",
    "theta": "DOUBLE", "width": "DOUBLE", "state": "TINYINT", "prob_open": "DOUBLE",
    "prob_closed": "DOUBLE", "name": "VARCHAR", "opening": "DOUBLE", "waited_s": "DOUBLE",
    "robot_x": "DOUBLE", "robot_y": "DOUBLE", "robot_theta": "DOUBLE",
}  # fmt: skip
"""Name -> SQL type."""

_ARROW = {"BIGINT": "int64", "TINYINT": "uint8", "INTEGER": "uint32", "SMALLINT": "uint16",
          "DOUBLE": "float64", "VARCHAR": "string"}  # fmt: skip


def write_parquet(path: Path, count: int) -> None:
    """Write a patrol as Parquet: zstd, in the order of numbers, row groups as DuckDB makes them."""
    import pyarrow as pa
    from pyarrow import parquet

    kinds = {"string": pa.string()} | {
        name: getattr(pa, name)() for name in _ARROW.values() if name != "string"
    }
    schema = pa.schema([(name, kinds[_ARROW[sql]]) for name, sql in COLUMNS.items()])
    with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        for rows in blocks(count):
            columns = [pa.array(values, mask=~there, type=schema.field(name).type)
                       for name, (values, there) in _columns(rows).items()]  # fmt: skip
            writer.write_table(pa.Table.from_arrays(columns, schema=schema), row_group_size=BLOCK)


def write_sqlite(path: Path, count: int) -> None:
    """Write a patrol as a SQLite table with an index for each question that is asked."""
    import sqlite3

    database = sqlite3.connect(path, isolation_level=None)
    database.execute("PRAGMA journal_mode = OFF")
    database.execute("PRAGMA synchronous = OFF")
    columns = ", ".join(f"{name} {sql}" for name, sql in COLUMNS.items() if name != "number")
    database.execute(f"CREATE TABLE events (number INTEGER PRIMARY KEY, {columns})")
    database.execute("BEGIN")
    for rows in blocks(count):
        database.executemany(
            f"INSERT INTO events VALUES ({', '.join('?' * len(COLUMNS))})",  # noqa: S608
            _tuples(rows),
        )
    for field in ("added", "removed", "x", "state", "prob_open", "prob_closed", "name"):
        database.execute(f"CREATE INDEX latest_{field} ON events (door_id, happened, number) "
                         f"WHERE {field} IS NOT NULL")  # fmt: skip
    database.execute("CREATE INDEX of_door ON events (door_id, number, happened)")
    database.execute("CREATE INDEX by_time ON events (happened, number)")
    database.execute("COMMIT")
    database.execute("ANALYZE")
    database.close()


def _columns(rows: Rows) -> dict[str, tuple[NDArray[Any], NDArray[np.bool_]]]:
    """Return each column's values, and where it has one."""
    sets, what = writers(rows), rows["what"]
    everywhere = np.ones(len(rows), np.bool_)
    is_pose, one = what == POSE, np.ones(len(rows), "u1")
    names = np.array([None] * len(rows), object)
    for i in np.flatnonzero(sets["name"]).tolist():
        names[i] = name_of(int(rows["door_id"][i]))
    return {
        "number": (rows["number"], everywhere),
        "happened": (rows["happened_ns"], everywhere),
        "kind": (what, everywhere),
        "door_id": (rows["door_id"], ~is_pose),
        "added": (one, sets["added"]),
        "removed": (one, sets["removed"]),
        "level": (np.zeros(len(rows), "u2"), sets["place"]),
        **{name: (rows[name], sets["place"]) for name in ("x", "y", "theta", "width")},
        "state": (states(rows), sets["state"]),
        "prob_open": (rows["value"], sets["prob_open"]),
        "prob_closed": (rows["value"], sets["prob_closed"]),
        "name": (names, sets["name"]),
        "opening": (rows["value"], what == OBSERVED),
        "waited_s": (rows["value"] * 30, what == PASSED),
        **{f"robot_{name}": (rows[name], is_pose) for name in ("x", "y", "theta")},
    }


def _tuples(rows: Rows) -> Iterator[tuple[Any, ...]]:
    columns = []
    for values, there in _columns(rows).values():
        told = values.tolist()
        for i in np.flatnonzero(~there).tolist():
            told[i] = None
        columns.append(told)
    return zip(*columns, strict=True)
