"""Tables -> one Parquet file, group by group: in flat memory, and the same bytes for equal rows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import BinaryIO

from semmap_log.core.arrow.arrow_sdk import pa, pq

GROUP_ROWS = 2**16
"""Rows in a group: what a reader can skip, or read on a core of its own."""

GROUP_BYTES = 64 * 2**20
"""A group ends earlier where floor maps make it so big."""

RISING = ("event", "happened", "recorded", "happened_ns", "recorded_ns")
"""Columns that nearly count: their differences are stored, in a tenth of the bytes."""


def write_parquet(
    path: Path, tables: Iterable[pa.Table], schema: pa.Schema, said: Mapping[str, str]
) -> int:
    """Write tables of one schema as one file, zstd, and return how many rows there were.

    Args:
        path: The file; an old one is written over.
        tables: One after the other, of any length.
        schema: Of all of them.
        said: What the file says of itself besides, key -> text.

    Raises:
        OSError: It cannot be written.
    """
    schema = schema.with_metadata({**(schema.metadata or {}), **said})
    with (
        path.open("wb") as file,
        pq.ParquetWriter(  # itself it takes no name but UTF-8's
            file,
            schema,
            compression="zstd",
            use_dictionary=[name for name in schema.names if name not in RISING],
            column_encoding={
                name: "DELTA_BINARY_PACKED" for name in schema.names if name in RISING
            },
        ) as writer,
    ):
        groups = _Groups(writer)
        for table in tables:
            groups.add(table.replace_schema_metadata(schema.metadata))
            file.flush()
        groups.flush()
    return groups.rows


FEW_ROWS = 2**15
"""Rows in a group of a table from which a few are read at a time."""


def write_groups(
    path: Path, tables: Iterable[pa.Table], sample: pa.Table, pause: Callable[[], None] | None
) -> None:
    """Write tables as one file, each as a group of rows.

    Args:
        path: The file; an old one is written over.
        tables: One after the other, each a group.
        sample: Some of their rows, by which it is chosen how each column is stored.
        pause: Called between two groups; what it raises ends it.

    Raises:
        OSError: It cannot be written.
    """
    names = sample.schema.names
    with (
        path.open("wb") as file,
        pq.ParquetWriter(
            file,
            sample.schema,
            compression="zstd",
            write_statistics=["door_id"] if "door_id" in names else False,
            use_dictionary=[name for name in names if _repeats(sample[name])],
            column_encoding={
                name: _ENCODINGS[sample[name].type]
                for name in names
                if sample[name].type in _ENCODINGS and not _repeats(sample[name])
            },
        ) as writer,
    ):
        for table in tables:
            writer.write_table(table, row_group_size=table.num_rows)
            if pause is not None:
                pause()


_ENCODINGS = {pa.int64(): "DELTA_BINARY_PACKED", pa.float64(): "BYTE_STREAM_SPLIT"}
"""How values that hardly repeat become small, where their own bytes do not."""


def _repeats(column: pa.ChunkedArray) -> bool:
    """Tell whether a column is smaller as numbers into the list of its values."""
    if pa.types.is_dictionary(column.type):
        return True
    there: int = len(column) - column.null_count
    return 2 * len(column.unique()) <= there


def rows_in(file: BinaryIO | pa.NativeFile) -> int:
    """Return how many rows a Parquet file has; of its bytes the footer is enough."""
    return int(pq.read_metadata(file).num_rows)


FOOTER_END = 8
"""At the end of a file: how long its footer is, and `PAR1`."""


def footer_bytes(end: bytes) -> int:
    """Return how many bytes the footer of a file is, by the file's last `FOOTER_END` bytes."""
    return int.from_bytes(end[:4], "little") + FOOTER_END


class _Groups:
    """Writes the same groups of `GROUP_ROWS`, however the rows are cut into tables."""

    def __init__(self, writer: pq.ParquetWriter) -> None:
        self.rows = 0
        """Rows that were taken so far."""
        self._writer = writer
        self._waiting: list[pa.Table] = []
        self._free = GROUP_ROWS
        """Rows that the group can still take."""

    def add(self, table: pa.Table) -> None:
        self.rows += table.num_rows
        while table.num_rows:
            part = table.slice(0, self._free)
            self._waiting.append(part)
            self._free -= part.num_rows
            table = table.slice(part.num_rows)
            if not self._free or sum(part.nbytes for part in self._waiting) > GROUP_BYTES:
                self.flush()

    def flush(self) -> None:
        """Write what waits as one group: in one piece, or its pages would show how it was cut."""
        if not self._waiting:
            return
        joined = pa.concat_tables(self._waiting)
        self._waiting, self._free = [], GROUP_ROWS
        self._writer.write_table(joined.combine_chunks())
        del joined
        pa.default_memory_pool().release_unused()
