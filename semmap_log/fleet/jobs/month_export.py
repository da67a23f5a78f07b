"""The job that copies events to a lake: Parquet files, a folder a month, a file a log.

    OUT/month=2026-03/<log id>-<head>.parquet

Hive's way to name folders: DuckDB, Spark, polars and pandas read OUT as one table with a column
`month`, of the time when an event happened (UTC). `happened_ns` and `recorded_ns` are whole
nanoseconds, which some tables' own times are not. A file is made once, and named by what is in it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timezone
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

from semmap_log.arrow.arrow_sdk import pa
from semmap_log.arrow.history_table import HISTORY_SCHEMA, HistoryTables
from semmap_log.arrow.parquet import rows_in, write_parquet
from semmap_log.door_log.door_log import DoorLog
from semmap_log.fleet.jobs.job import Holds, Told
from semmap_log.io.disk import output_errors, whole_file
from semmap_log.io.object_store import ObjectStore
from semmap_log.io.url_path import UrlPath, place_of
from semmap_log.store.reading.window import Window

HEAD_DIGITS = 12


MONTH = pa.field("month", pa.string())
"""What the folders say."""


def _lake_schema() -> pa.Schema:
    """Return the columns in types that every lake has: times and unsigned numbers are not."""
    fields = [
        pa.field(
            f"{each.name}_ns" if pa.types.is_timestamp(each.type) else each.name,
            _lake_type(each.type),
            nullable=each.nullable,
            metadata=each.metadata,
        )
        for each in HISTORY_SCHEMA
    ]
    return pa.schema([pa.field("log_id", pa.string(), nullable=False), *fields])


def _lake_type(kind: pa.DataType) -> pa.DataType:
    if pa.types.is_timestamp(kind):
        return pa.int64()
    if pa.types.is_dictionary(kind):
        return kind.value_type
    if pa.types.is_list(kind):
        return pa.list_(_lake_type(kind.value_type))
    if pa.types.is_integer(kind):
        return pa.int64() if kind.bit_width > 16 else pa.int32()
    return kind


LAKE_SCHEMA = _lake_schema()


@dataclass(frozen=True, slots=True)
class MonthExport:
    """Every event of each log, retracted ones marked, with who and why."""

    out: str
    """A folder that each worker sees, or a URL."""
    keeps_old: bool = False
    """Leave what a log had there of an earlier head: a table names it still."""

    name: ClassVar[str] = "export"
    holds: ClassVar[Holds] = Holds.never
    fields: ClassVar[tuple[pa.Field, ...]] = (
        pa.field("month", pa.string(), nullable=False),
        pa.field("file", pa.string(), nullable=False),
        pa.field("events", pa.int64(), nullable=False),
        pa.field("bytes", pa.int64(), nullable=False),
    )

    def parameters(self) -> str:
        """Return where to."""
        return str(place_of(self.out))

    def ask(self, log: DoorLog, place: str) -> Told:  # noqa: ARG002
        """Write what is not there yet; return a row a file."""
        last = log.last_commit()
        head = "0" * HEAD_DIGITS if last is None else last.hash.hex()[:HEAD_DIGITS]
        name = f"{log.info.log_id}-{head}.parquet"
        rows: dict[str, list[Any]] = {each.name: [] for each in self.fields}
        tables = _MonthTables(log)
        for month in _months_of(log):
            lake = _LakeFolder(place_of(self.out), f"month={month}")
            events, size = lake.put(name, tables, month)
            for column, value in zip(rows, (month, name, events, size), strict=True):
                if events:
                    rows[column].append(value)
            if not self.keeps_old:
                lake.remove_others(log.info.log_id, name if events else "")
        return Told(rows)


class _MonthTables:
    """The tables of a log's months; its commits are read once, if months follow each other."""

    def __init__(self, log: DoorLog) -> None:
        self._log = log
        self._limit = log.last_event()
        self._retractions = log.retractions(self._limit if self._limit >= 0 else None)
        self._joined: HistoryTables | None = None
        self._next = 0

    def of(self, month: str) -> Iterator[pa.Table]:
        """Yield the events that happened in a month, numbers ascending."""
        since_ns, until_ns = _bounds_of(month)
        window = Window(
            happened_from_ns=since_ns, happened_before_ns=until_ns, before_event=self._limit + 1
        )
        for batch in self._log.batches_in(window):
            first = int(batch.number[0])
            if self._joined is None or first < self._next:
                self._joined = HistoryTables(self._log.commits())
            self._next = int(batch.number[-1]) + 1
            yield _as_lake(
                self._joined.table(batch, self._retractions.hidden(batch)), self._log.info.log_id
            )


class _LakeFolder:
    """A month's folder, on a disk or in a store."""

    def __init__(self, out: Path | UrlPath, name: str) -> None:
        self._place = out / name

    def put(self, name: str, tables: _MonthTables, month: str) -> tuple[int, int]:
        """Make a file unless it is there, or would be empty; return its rows and bytes."""
        if isinstance(self._place, Path):
            return self._put_on_disk(self._place / name, tables.of(month))
        store = ObjectStore(self._place)
        with TemporaryDirectory() as folder:
            path = Path(folder, name)
            if any(each.name == name for each in store.list()):
                got = store.whole(name)
                assert got is not None
                path.write_bytes(got[0])
                return rows_in(path), len(got[0])
            made = self._put_on_disk(path, tables.of(month))
            if made[0]:
                store.create(name, path)
            return made

    @staticmethod
    def _put_on_disk(path: Path, tables: Iterator[pa.Table]) -> tuple[int, int]:
        if not path.exists():
            first = next(tables, None)
            if first is None:
                return 0, 0
            path.parent.mkdir(parents=True, exist_ok=True)
            with output_errors(path), whole_file(path) as temporary:
                write_parquet(temporary, chain([first], tables), LAKE_SCHEMA, {})
        return rows_in(path), path.stat().st_size

    def remove_others(self, log_id: str, but: str) -> None:
        """Remove what the log had there of an earlier head."""
        begins = f"{log_id}-"
        if isinstance(self._place, Path):
            for path in self._place.glob(f"{begins}*.parquet"):
                if path.name != but:
                    path.unlink(missing_ok=True)
            return
        store = ObjectStore(self._place)
        for each in store.list():
            if each.name.startswith(begins) and each.name != but:
                store.remove(each.name)


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
