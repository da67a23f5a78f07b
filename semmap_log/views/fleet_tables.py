"""What a fleet answered, for people: a row a log that is bad, and the answer's own rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from datetime import datetime, timezone
from typing import Any

from semmap_log.arrow.arrow_sdk import pa
from semmap_log.common.texts import counted
from semmap_log.fleet.jobs.log_outcome import AskedLog
from semmap_log.views.column_table import ColumnTable, TableColumn

HIDDEN = ("log_id", "robot", "building")
"""Columns for programs: `log` says it already."""


def bad_logs_table(logs: Iterable[AskedLog]) -> ColumnTable:
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


def outcomes_in_words(logs: Iterable[AskedLog]) -> str:
    """Return how many logs there were, and what became of them: `40 logs: 38 ok, 2 gone`."""
    logs = list(logs)
    found = Counter(log.outcome.value for log in logs)
    told = ", ".join(f"{count:,} {name}" for name, count in found.items())
    kept = sum(log.is_kept for log in logs)
    again = f" ({kept:,} from an earlier run)" if kept else ""
    return f"{counted(len(logs), 'log')}: {told}{again}"


def arrow_rows_table(rows: pa.Table) -> ColumnTable:
    """Return an Arrow table's rows, without the columns that say the log once more."""
    shown = [name for name in rows.column_names if name not in HIDDEN]
    numbers = {name for name in shown if _is_number(rows.schema.field(name).type)}
    table = ColumnTable(
        [
            TableColumn(name, name, right=name in numbers, least=None if name in numbers else 8,
                        yields=max(0, place - 2))
            for place, name in enumerate(shown)
        ]
    )  # fmt: skip
    columns = [rows[name].to_pylist() if not _is_time(rows.schema.field(name).type)
               else rows[name].cast(pa.int64()).to_pylist() for name in shown]  # fmt: skip
    times = [_is_time(rows.schema.field(name).type) for name in shown]
    for values in zip(*columns, strict=True):
        table.add(*(_text(value, is_time) for value, is_time in zip(values, times, strict=True)))
    return table


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))


def _is_time(kind: pa.DataType) -> bool:
    return bool(pa.types.is_timestamp(kind))


def _text(value: Any, is_time: bool) -> str:  # noqa: FBT001
    if value is None:
        return ""
    if is_time:
        second = datetime.fromtimestamp(value // 10**9, timezone.utc)
        return second.strftime("%Y-%m-%d %H:%M:%SZ")
    if isinstance(value, float):
        return f"{value:.3g}"
    if isinstance(value, bytes):
        return counted(len(value), "byte")
    return str(value)
