"""What a fleet answered, for people: a row a log that is bad, and the answer's own rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.plain_rows import plain_rows
from semmap_log.core.texts import counted
from semmap_log.fleet.jobs.job import AskedLog
from semmap_log.views.column_table import ColumnTable, TableColumn

HIDDEN = ("log_id", "robot", "building")
"""Columns for programs only, since `log` includes them."""
FOLDED = {"log": 12, "door": 8, "file": 16, "finding": 16}
"""Columns whose texts may fold, and down to what width."""
SECONDS = len("2026-03-01T12:00:00")
"""Characters of a time that are shown."""


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
