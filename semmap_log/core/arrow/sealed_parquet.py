"""Parquet files read only where each byte is what was written: a checksum for each group of rows.

Parquet's own checksums leave out the heads of pages. The file that was opened is the one that is
checked and read, whatever comes to its place meanwhile; it is not mapped, so who cuts it ends
nothing by a signal; and what is no regular file is not read at all.
"""

from __future__ import annotations

import os
import stat
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

from semmap_log.core.arrow.arrow_sdk import pa, pq
from semmap_log.core.arrow.parquet import FOOTER_END, footer_bytes
from semmap_log.core.io.file_calls import NO_LINK, PLAIN

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
        OSError: It cannot be read, or is none.
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
