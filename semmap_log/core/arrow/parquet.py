"""Tables -> one Parquet file, group by group: in flat memory, and the same bytes for equal rows.

Parquet files are read only where each byte is what was written: each group of rows has a checksum,
since Parquet's own checksums leave out the heads of pages. The file that was opened is the one that
is checked and read, whatever replaces it meanwhile. It is not mapped, so truncating it raises no
signal; and only regular files are read.
"""

from __future__ import annotations

import os
import stat
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypedDict

from semmap_log.core.arrow.arrow_sdk import pa, pq
from semmap_log.core.io.disk import NO_LINK, PLAIN

if TYPE_CHECKING:
    from typing_extensions import Self


class Seal(TypedDict):
    """What the bytes of a file must be, piece by piece: each group of rows, last the footer."""

    ends: list[int]
    """Where each piece ends; the last where the file does."""
    crcs: list[int]
    """CRC-32 of each."""


def seal_of(path: Path) -> Seal:
    """Return the seal of a Parquet file as it is.

    Raises:
        OSError: It cannot be read, or is no Parquet file.
    """
    crcs, at = [], 0
    with path.open("rb") as file:
        known = pq.read_metadata(file)  # which itself takes no name but UTF-8's
        starts = [_start_of(known.row_group(group)) for group in range(known.num_row_groups)]
        size = file.seek(-FOOTER_END, os.SEEK_END) + FOOTER_END
        ends = [*starts[1:], size - footer_bytes(file.read(FOOTER_END)), size]
        file.seek(0)
        for end in ends:
            crcs.append(zlib.crc32(file.read(end - at)))
            at = end
    return {"ends": ends, "crcs": crcs}


def _start_of(group: Any) -> int:
    """Return where the pages of a group of rows begin."""
    columns = [group.column(place) for place in range(group.num_columns)]
    offsets = [(column.dictionary_page_offset, column.data_page_offset) for column in columns]
    return min(int(offset) for pair in offsets for offset in pair if offset is not None)


class SealedParquet:
    """A file that is open; to be closed, as a context manager."""

    def __init__(self, path: Path, seal: Seal) -> None:
        """Open it, and check its footer.

        Raises:
            OSError: It cannot be opened.
            ValueError: It is not the file that was sealed.
        """
        self._seal = seal
        self._file = os.fdopen(os.open(path, os.O_RDONLY | NO_LINK | PLAIN), "rb")
        try:
            self._check_end()
            self._parquet = pq.ParquetFile(self._file, pre_buffer=False)
        except BaseException:
            self._file.close()
            raise

    @property
    def names(self) -> list[str]:
        """Its columns."""
        names: list[str] = self._parquet.schema_arrow.names
        return names

    @property
    def rows(self) -> int:
        """How many rows it has."""
        return int(self._parquet.metadata.num_rows)

    def spans(self, name: str) -> list[tuple[int, int]]:
        """Return the least and the greatest value of a column in each group; (1, 0): it has none.

        Raises:
            ValueError: There is no such column.
        """
        known, place = self._parquet.metadata, self.names.index(name)
        told = [known.row_group(g).column(place).statistics for g in range(known.num_row_groups)]
        return [(t.min, t.max) if t is not None and t.has_min_max else (1, 0) for t in told]

    def group(self, group: int, columns: Sequence[str]) -> pa.Table:
        """Return some columns of a group of rows.

        Raises:
            ValueError: Its bytes are not what was written.
        """
        self._checked(group)
        return self._parquet.read_row_group(group, columns=list(columns), use_threads=False)

    def all(self, columns: Sequence[str] | None = None) -> pa.Table:
        """Return some columns of all rows, or all of them.

        Raises:
            ValueError: Its bytes are not what was written.
        """
        whole = b"".join(self._checked(piece) for piece in range(len(self._seal["ends"])))
        file = pq.ParquetFile(pa.BufferReader(whole), pre_buffer=False)
        return file.read(columns=None if columns is None else list(columns), use_threads=False)

    def check(self) -> None:
        """Read every byte.

        Raises:
            ValueError: They are not what was written.
        """
        for piece in range(len(self._seal["ends"])):
            self._checked(piece)

    def nothing(self, columns: Sequence[str]) -> pa.Table:
        """Return a table of some columns without rows."""
        return self._parquet.schema_arrow.empty_table().select(list(columns))

    def _check_end(self) -> None:
        status, size = os.fstat(self._file.fileno()), self._seal["ends"][-1]
        if not stat.S_ISREG(status.st_mode):
            raise ValueError("expected a file, got something else")
        if status.st_size != size:
            raise ValueError(f"expected {size} bytes, got {status.st_size}")
        self._checked(len(self._seal["ends"]) - 1)

    def _checked(self, piece: int) -> bytes:
        start = self._seal["ends"][piece - 1] if piece else 0
        end = self._seal["ends"][piece]
        self._file.seek(start)
        data = self._file.read(end - start)
        if zlib.crc32(data) != self._seal["crcs"][piece]:
            raise ValueError(f"bytes {start} to {end} are not what was written")
        return data

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


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
    """Return whether a column is smaller as indices into the list of its values."""
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
