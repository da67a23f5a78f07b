"""What a fleet answered, for people: a row a log that is bad, and the answer's own rows."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.model.moments import format_utc
from semmap_log.core.texts import counted
from semmap_log.fleet.jobs.job import QueriedLog
from semmap_log.views.column_table import ColumnTable, TableColumn

HIDDEN = ("log_id", "robot", "building")
"""Columns for programs only, since `log` includes them."""
FOLDED = {"log": 12, "door": 8, "file": 16, "finding": 16}
"""Columns whose texts may fold, and down to what width."""
SECONDS = len("2026-03-01T12:00:00")
"""Characters of a time that are shown."""


def bad_logs_table(logs: Iterable[QueriedLog]) -> ColumnTable:
    """Return a row for each log that gave no answer: which, why, where."""
    table = ColumnTable(
        [
            TableColumn("log", "log", least=12),
            TableColumn("outcome", "outcome"),
            TableColumn("file", "file", yields=1),
            TableColumn("byte", "byte", right=True, yields=1),
            TableColumn("why", "why", least=24),
        ]
    )
    for log in logs:
        byte = "" if log.byte is None else str(log.byte)
        table.add(log.place, log.outcome.value, log.file, byte, log.text)
    return table


def outcomes_text(logs: Iterable[QueriedLog]) -> str:
    """Return the number of logs by their outcome: `40 logs: 38 ok, 2 gone`."""
    logs = list(logs)
    found = Counter(log.outcome.value for log in logs)
    told = ", ".join(f"{count:,} {name}" for name, count in found.items())
    kept = sum(log.is_kept for log in logs)
    again = f" ({kept:,} from an earlier run)" if kept else ""
    return f"{counted(len(logs), 'log')}: {told}{again}"


def arrow_rows_table(rows: pa.Table) -> ColumnTable:
    """Return an Arrow table's rows, without the columns that repeat the log."""
    shown = [name for name in rows.column_names if name not in HIDDEN]
    times = {each.name for each in rows.schema if pa.types.is_timestamp(each.type)}
    numbers = {name for name in shown if _is_number(rows.schema.field(name).type)}
    table = ColumnTable(
        [
            TableColumn(name, name, right=name in numbers, least=FOLDED.get(name),
                        yields=max(0, place - 2))
            for place, name in enumerate(shown)
        ]
    )  # fmt: skip
    for row in plain_rows(rows.select(shown)):
        table.add(*(_text(value, is_time=name in times) for name, value in row.items()))
    return table


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))


def _text(value: Any, *, is_time: bool) -> str:
    if is_time and value is not None:
        return f"{value[:SECONDS]}Z"
    return f"{value:.3g}" if isinstance(value, float) else "" if value is None else str(value)


def plain_rows(table: pa.Table) -> Iterator[dict[str, Any]]:
    """Yield rows, column -> value: times as text in UTC, bytes in hexadecimal, NaN as None."""
    columns = [_plain(table[name]) for name in table.column_names]
    for values in zip(*columns, strict=True):
        yield dict(zip(table.column_names, values, strict=True))


def write_csv(path: Path, table: pa.Table) -> None:
    """Write a table as CSV with a head: what is not known is empty.

    Raises:
        OSError: It cannot be written.
    """
    import csv

    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.column_names)
        writer.writerows(row.values() for row in plain_rows(table))


def _plain(column: pa.ChunkedArray) -> list[Any]:
    if pa.types.is_timestamp(column.type):  # to Python's own times nanoseconds are lost
        times = column.cast(pa.int64()).to_pylist()
        return [None if time is None else format_utc(time) for time in times]
    values: list[Any] = column.to_pylist()
    if pa.types.is_binary(column.type):
        return [None if value is None else value.hex() for value in values]
    if pa.types.is_floating(column.type):
        return [None if value is None or math.isnan(value) else value for value in values]
    return values
