"""A folder of Parquet files that other programs read as one table: its columns, and its files.

OUT/month=2026-03/<log id>-<head>.parquet
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from semmap_log.core.arrow.arrow_sdk import pa
from semmap_log.core.arrow.history_table import plain_texts
from semmap_log.core.arrow.parquet import FOOTER_END, footer_bytes, rows_in, write_parquet
from semmap_log.core.arrow.table import COLUMNS, RETRACTED, SAID, schema_of
from semmap_log.core.io.disk import atomic_file, output_errors
from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.errors import CorruptLogError

_MOST_FOOTER_BYTES = 2**26
EVENT_COLUMNS = (*COLUMNS, *SAID, RETRACTED)
"""Of the events in a lake; existing lakes keep their columns."""


def _lake_schema() -> pa.Schema:
    """Return the columns in types that every lake has: no times, no unsigned numbers."""
    fields = [
        pa.field(
            f"{each.name}_ns" if pa.types.is_timestamp(each.type) else each.name,
            _lake_type(each.type),
            nullable=each.nullable,
            metadata=each.metadata,
        )
        for each in schema_of(plain_texts(EVENT_COLUMNS))
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
LAKE_FILE_FIELDS = (
    pa.field("month", pa.string(), nullable=False),
    pa.field("file", pa.string(), nullable=False),
    pa.field("events", pa.int64(), nullable=False),
    pa.field("bytes", pa.int64(), nullable=False),
)
"""What an export reports about each file."""


class LakeFile(NamedTuple):
    """A file of a lake."""

    log_id: str
    month: str
    file: str
    events: int
    bytes: int

    @property
    def path(self) -> str:
        """Its path below the lake's folder."""
        return f"{_folder_of(self.month)}/{self.file}"


def lake_files(table: pa.Table) -> list[LakeFile]:
    """Return the files that the table of an export names."""
    columns = (table[name].to_pylist() for name in LakeFile._fields)
    return [LakeFile(*row) for row in zip(*columns, strict=True)]


def log_of(path: str) -> str:
    """Return the id of the log whose events are in a file of a lake."""
    return path.rsplit("/", 1)[-1].partition("-")[0]


def remove_earlier_files(out: str, files: Sequence[LakeFile]) -> None:
    """Remove files of the same logs and months from an earlier head.

    Raises:
        LogAccessError: The store denies access.
        OSError: The disk denies access.
    """
    logs, names = {each.log_id for each in files}, {each.file for each in files}
    for month in sorted({each.month for each in files}):
        folder = LakeFolder(out, month)
        for name in folder.names():
            if log_of(name) in logs and name not in names:
                folder.remove(name)


class LakeFolder:
    """The folder of a month, on a disk or in a store."""

    def __init__(self, out: str, month: str) -> None:
        self._place = place_of(out) / _folder_of(month)

    def put(self, name: str, tables: Iterator[pa.Table]) -> tuple[int, int]:
        """Write a file unless it exists, or would be empty; return its rows and bytes."""
        if isinstance(self._place, Path):
            return _put_on_disk(self._place / name, tables)
        store = ObjectStore(self._place)
        try:
            status = store.status(name)
        except FileNotFoundError:
            with TemporaryDirectory() as folder:
                path = Path(folder, name)
                made = _put_on_disk(path, tables)
                if made[0]:
                    store.create(name, path)
                return made
        return _rows_of(store, status), status.size

    def names(self) -> list[str]:
        """Return the Parquet files that are there."""
        if isinstance(self._place, UrlPath):
            found = [each.name for each in ObjectStore(self._place).list()]
        else:
            found = [each.name for each in self._place.iterdir()]
        return sorted(name for name in found if name.endswith(".parquet"))

    def remove(self, name: str) -> None:
        """Remove a file."""
        if isinstance(self._place, UrlPath):
            ObjectStore(self._place).remove(name)
        else:
            (self._place / name).unlink(missing_ok=True)


def _folder_of(month: str) -> str:
    return f"month={month}"


def _put_on_disk(path: Path, tables: Iterator[pa.Table]) -> tuple[int, int]:
    if not path.exists():
        first = next(tables, None)
        if first is None:
            return 0, 0
        path.parent.mkdir(parents=True, exist_ok=True)
        with output_errors(path), atomic_file(path) as temporary:
            write_parquet(temporary, chain([first], tables), LAKE_SCHEMA, {})
    with path.open("rb") as file:
        return rows_in(file), path.stat().st_size


def _rows_of(store: ObjectStore, status: ObjectStatus) -> int:
    """Return the number of rows of an object; only its footer is fetched.

    Raises:
        CorruptLogError: It has no valid footer.
    """
    end = store.part(status, max(0, status.size - FOOTER_END), status.size)
    length = footer_bytes(end)
    if length > min(status.size, _MOST_FOOTER_BYTES):
        problem = f"no Parquet file: its footer cannot have {length:,} bytes"
        raise CorruptLogError(store.url / status.name, None, problem)
    footer = store.part(status, status.size - length, status.size)
    return rows_in(pa.BufferReader(footer))
