"""A CSV file in blocks of whole lines: plain ones as columns of texts, others row by row.

A plain block has no quotes and as many commas in each line: where its cells lie is found at once.
Any other goes through Python's own reader, which knows all of CSV and says what is wrong.
"""

from __future__ import annotations

import csv
import gzip
import zlib
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from semmap_log.errors import FormatError
from semmap_log.formats.files.csv_rows import MOST_LINE_BYTES, MOST_ROWS, Row, has_length, places_of
from semmap_log.formats.parsing.foreign_file import (
    GZIP_MAGIC,
    decode_utf8,
    open_regular,
    text_lines,
    too_long,
)
from semmap_log.formats.parsing.problems import Problems
from semmap_log.formats.parsing.text_column import PADDING, TextColumn

BLOCK_BYTES = 2**20
_NEWLINE, _COMMA = ord("\n"), ord(",")


@dataclass(frozen=True, slots=True)
class Columns:
    """The cells of a plain block: of each wanted column, or None for one that the file has not."""

    lines: int
    """How many rows there are."""
    texts: list[TextColumn | None]


class CsvBlocks:
    """The rows of a CSV file whose columns are found by name."""

    def __init__(
        self,
        path: Path,
        problems: Problems,
        *,
        required: tuple[str, ...],
        optional: tuple[str, ...] = (),
    ) -> None:
        """Read the header.

        Raises:
            FormatError: The file cannot be read or is not CSV; its header has not those columns.
        """
        self._path = path
        self._problems = problems
        self._raw = open_regular(path)
        is_gzip = self._raw.read(2) == GZIP_MAGIC
        self._raw.seek(0)
        self._file: BinaryIO | gzip.GzipFile = (
            gzip.GzipFile(fileobj=self._raw) if is_gzip else self._raw
        )
        self._line = 1
        """Number of the line that is read next."""
        self._pending: deque[bytes] = deque()
        """Lines that Python's reader has still to take."""
        self._total = 0
        """Rows so far."""
        self._in_block = 0
        """Those of them that `columns` found in this block."""
        try:
            header = self._header(required)
            self._width = len(header.texts)
            self._places = places_of(header, path, required, optional)
        except BaseException:
            self._raw.close()
            raise

    def blocks(self) -> Iterator[bytes]:
        """Yield blocks of whole lines, each to be read by `columns` or by `rows`.

        Raises:
            FormatError: The file cannot be read on.
        """
        block = b"".join(self._pending)
        self._pending.clear()
        try:
            while block or (block := self._next()):
                behind = self._line + block.count(b"\n")
                self._in_block = 0
                yield block
                self._line = max(self._line, behind)  # `rows` may have gone further
                block = b""
        finally:
            self._raw.close()

    def columns(self, block: bytes) -> Columns | None:
        """Return a block's cells; None: it is not plain, and wants `rows`."""
        plain = _plain(block)
        if plain is None:
            return None
        data = np.frombuffer(plain, np.uint8, len(plain) - len(PADDING))
        ends = np.flatnonzero(data == _NEWLINE)
        starts = np.concatenate(([0], ends[:-1] + 1))
        if (ends == starts).any():
            starts, ends = starts[ends > starts], ends[ends > starts]
        commas = np.flatnonzero(data == _COMMA)
        if len(commas) != len(starts) * (self._width - 1):
            return None
        edges = np.column_stack((starts - 1, commas.reshape(len(starts), self._width - 1), ends))
        lengths = np.diff(edges, axis=1) - 1
        # A line with a comma more, and another with one less, would give a negative length.
        if lengths.min(initial=0) < 0 or (ends - starts).max(initial=0) >= MOST_LINE_BYTES:
            return None
        self._count(len(starts))
        self._in_block = len(starts)
        found = [
            None if at is None else TextColumn(plain, edges[:, at] + 1, lengths[:, at].copy())
            for at in self._places
        ]
        return Columns(len(starts), found)

    def rows(self, block: bytes) -> list[Row]:
        """Return a block's rows with the texts of the wanted columns.

        Rows of another length than the header's are noted in the problems. Where a cell with line
        breaks goes on behind the block, what is behind it is read, too.

        Raises:
            FormatError: It is not CSV, or not text.
        """
        found = [
            Row(line, [cells[at] if at is not None else "" for at in self._places])
            for line, cells in self._cells(block)
            if has_length(line, cells, self._width, self._problems)
        ]
        self._count(len(found) - self._in_block)
        return found

    def _header(self, required: tuple[str, ...]) -> Row:
        header = next(self._cells(self._next()), None)
        if header is None:
            expected = ",".join(required)
            raise FormatError(self._path, f"expected a header {expected}, got an empty file")
        return header

    def _count(self, rows: int) -> None:
        self._total += rows
        if self._total > MOST_ROWS:
            raise FormatError(self._path, f"expected at most {MOST_ROWS:,} rows; split the file")

    def _cells(self, block: bytes) -> Iterator[Row]:
        """Yield every row that is not blank, all its cells, by Python's reader."""
        self._pending.extend(_lines_of(block))
        before = self._line - 1
        reader = csv.reader(self._texts(), strict=True)
        while self._pending:
            try:
                cells = next(reader, None)
            except csv.Error as error:
                line = before + reader.line_num
                raise self._problems.with_last(line, f"not CSV: {error}") from None
            if cells:
                yield Row(before + reader.line_num, cells)

    def _texts(self) -> Iterator[str]:
        """Yield the lines that are pending, and those behind them if they are asked for."""
        while True:
            if not self._pending:
                self._pending.extend(_lines_of(self._next()))
            if not self._pending:
                return
            line, number = self._pending.popleft(), self._line
            if len(line) > MOST_LINE_BYTES:
                raise too_long(self._path, number, MOST_LINE_BYTES)
            self._line += 1
            yield decode_utf8(line, self._path, first_line=number)

    def _next(self) -> bytes:
        """Return the next block; empty: there is none."""
        try:
            block = self._file.read(BLOCK_BYTES)
            if block and not block.endswith(b"\n"):
                block += self._file.readline(MOST_LINE_BYTES + 1)
        except (OSError, EOFError, zlib.error):
            for _ in text_lines(self._path, most_bytes=MOST_LINE_BYTES):
                pass  # comes to the same place line by line, and says where it is
            raise
        return block


def _lines_of(block: bytes) -> list[bytes]:
    """Return the lines with their ends; a line break inside quotes ends one, too."""
    lines = [line + b"\n" for line in block.split(b"\n")]
    lines[-1] = lines[-1][:-1]
    return lines if lines[-1] else lines[:-1]


def _plain(block: bytes) -> bytes | None:
    """Return lines that end in a line feed only, and `PADDING`; None: they are not so simple."""
    if b"\r" in block:
        block = block.replace(b"\r\n", b"\n")
    if any(special in block for special in (b'"', b"\0", b"\r")):
        return None
    if not block.isascii():
        try:
            block.decode()
        except UnicodeDecodeError:
            return None
    return block + (PADDING if block.endswith(b"\n") else b"\n" + PADDING)
