"""The job that copies events to a lake: Parquet files, a folder a month, a file a log.

Hive's way to name folders: DuckDB, Spark, polars and pandas read OUT as one table with a column
`month`, of the time when an event happened (UTC). `happened_ns` and `recorded_ns` are whole
nanoseconds, which some tables' own times are not. A file is made once, and named by what is in it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import ClassVar

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.fleet.jobs.job import Holds, Told
from semmap_log.fleet.jobs.lake_folder import (
    EVENT_COLUMNS,
    LAKE_FILE_FIELDS,
    LAKE_SCHEMA,
    LakeFolder,
)
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.store.reading.window import Window

HEAD_DIGITS = 12


@dataclass(frozen=True, slots=True)
class MonthExport:
    """Every event of each log, retracted ones marked, with who and why."""

    out: str
    """A folder that each worker sees, absolute, or a URL."""

    name: ClassVar[str] = "export"
    holds: ClassVar[Holds] = Holds.never
    fields: ClassVar[tuple[pa.Field, ...]] = LAKE_FILE_FIELDS

    def parameters(self) -> str:
        """Return where to."""
        return self.out

    def ask(self, log: DoorLog) -> Told:
        """Write what is not there yet; return a row a file."""
        last = log.find_commit(log.last_event())
        if last is None:
            return Told({each.name: [] for each in self.fields})
        name = f"{log.info.log_id}-{last.hash.hex()[:HEAD_DIGITS]}.parquet"
        tables = _MonthTables(log)
        found: list[tuple[str, str, int, int]] = []
        for month in _months_of(log):
            events, size = LakeFolder(self.out, month).put(name, tables.of(month))
            if events:
                found.append((month, name, events, size))
        columns = map(list, zip(*found, strict=True))
        return Told({each.name: c for each, c in zip(self.fields, columns, strict=True)})


class _MonthTables:
    """The tables of a log's months, as it is at the first."""

    def __init__(self, log: DoorLog) -> None:
        self._log = log
        self._limit = log.last_event()

    def of(self, month: str) -> Iterator[pa.Table]:
        """Yield the events that happened in a month, numbers ascending."""
        since_ns, until_ns = _bounds_of(month)
        window = Window(
            happened_from_ns=since_ns,
            happened_before_ns=until_ns,
            before_event=self._limit + 1,
            only_kept=True,
        )
        names = [column.name for column in EVENT_COLUMNS]
        for table in self._log.tables_in(window, columns=names, limit=self._limit):
            yield _as_lake(table, self._log.info.log_id)


def _as_lake(table: pa.Table, log_id: str) -> pa.Table:
    columns = [pa.array([log_id] * table.num_rows, pa.string()), *table.columns]
    return pa.Table.from_arrays(
        [column.cast(field.type) for column, field in zip(columns, LAKE_SCHEMA, strict=True)],
        schema=LAKE_SCHEMA,
    )


def _months_of(log: DoorLog) -> Iterator[str]:
    """Yield the months from a log's first event to its last, earliest first."""
    span = log.happened_span()
    if span is None:
        return
    month, last = (_month_of(time_ns) for time_ns in span)
    while month <= last:
        yield month
        month = _month_of(_bounds_of(month)[1])


def _month_of(time_ns: int) -> str:
    return datetime.fromtimestamp(time_ns // 10**9, timezone.utc).strftime("%Y-%m")


def _bounds_of(month: str) -> tuple[int, int]:
    year, number = map(int, month.split("-"))
    following = (year + number // 12, number % 12 + 1)
    since, until = (datetime(*each, 1, tzinfo=timezone.utc) for each in ((year, number), following))
    return int(since.timestamp()) * 10**9, int(until.timestamp()) * 10**9
