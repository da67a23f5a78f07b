"""A CSV file in blocks of whole lines: plain ones as columns of texts, others row by row.

Blanks around a cell do not count.

A plain block has no quotes and as many commas in each line: where its cells lie is found at once.
Any other goes through Python's own reader, which knows all of CSV and says what is wrong.
"""

from __future__ import annotations

import csv
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np

from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.csv_rows import (
    MOST_LINE_BYTES,
    MOST_ROWS,
    Row,
    has_length,
    places_of,
)
from semmap_log.interop.formats.parsing.foreign_file import (
    BLOCK_BYTES,
    decode_utf8,
    numbered_lines,
    open_unpacked,
    too_long,
)
from semmap_log.interop.formats.parsing.problems import Problems
from semmap_log.interop.formats.parsing.text_column import PADDING, TextColumn

_NEWLINE, _COMMA = ord("\n"), ord(",")


_BLANK_LINES = re.compile(rb"(?:\r?\n)*")


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
        hint: str = "",
    ) -> None:
        """Read the header.

        Args:
            path: The file.
            problems: Where wrong rows are noted.
            required: Columns that it has to have.
            optional: Others that it may have.
            hint: What to say where its header is another.

        Raises:
            FormatError: The file cannot be read or is not CSV; its header has not those columns.
        """
        self._path = path
        self._problems = problems
        self._file = open_unpacked(path)
        self._line = 1
        """Number of the line that is read next."""
        self._lines = b""
        """What Python's reader takes; from `_at` on it has still to take it."""
        self._at = 0
        self._total = 0
        """Rows so far."""
        self._in_block = 0
        """Those of them that `columns` found in this block."""
        try:
            header = self._header(required)
            self._width = len(header.texts)
            self._places = places_of(header, path, required, optional, hint=hint)
        except BaseException:
            self._file.close()
            raise

    def blocks(self) -> Iterator[bytes]:
        """Yield blocks of whole lines, each to be read by `columns` or by `rows`.

        Raises:
            FormatError: The file cannot be read on.
        """
        block, self._lines = self._lines[self._at :], b""
        try:
            while block or (block := self._next()):
                behind = self._line + block.count(b"\n")
                self._in_block = 0
                yield block
                self._line = max(self._line, behind)  # `rows` may have gone further
                block = b""
        finally:
            self._file.close()

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
            None if at is None else TextColumn(plain, edges[:, at] + 1, lengths[:, at]).stripped()
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
            Row(line, [cells[at].strip() if at is not None else "" for at in self._places])
            for line, cells in takewhile(lambda _: not self._problems.is_full, self._cells(block))
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
        self._lines, self._at = block, 0
        reader = csv.reader(self._texts(), strict=True, skipinitialspace=True)
        while self._pass_blank_lines():
            try:
                cells = next(reader, None)
            except csv.Error as error:
                raise self._problems.with_last(self._line - 1, f"not CSV: {error}") from None
            if cells:
                yield Row(self._line - 1, cells)

    def _pass_blank_lines(self) -> bool:
        """Go to the next line that is not blank, as Python's reader would; False: there is none."""
        end = _BLANK_LINES.match(self._lines, self._at).end()  # type: ignore[union-attr]
        self._line += self._lines.count(b"\n", self._at, end)
        self._at = end
        return end < len(self._lines)

    def _texts(self) -> Iterator[str]:
        """Yield the lines that are to be taken, and those behind them if they are asked for."""
        while True:
            if self._at == len(self._lines):
                self._lines, self._at = self._next(), 0
            if not self._lines:
                return
            end = self._lines.find(b"\n", self._at) + 1 or len(self._lines)
            line, number = self._lines[self._at : end], self._line
            if len(line) > MOST_LINE_BYTES:
                raise too_long(self._path, number, MOST_LINE_BYTES)
            self._line, self._at = number + 1, end
            yield decode_utf8(line, self._path, first_line=number)

    def _next(self) -> bytes:
        """Return the next block; empty: there is none."""
        try:
            block = self._file.read(BLOCK_BYTES)
            if block and not block.endswith(b"\n"):
                block += self._file.readline(MOST_LINE_BYTES + 1)
        except (OSError, EOFError, zlib.error):
            for _ in numbered_lines(self._path, most_bytes=MOST_LINE_BYTES):
                pass  # comes to the same place line by line, and says where it is
            raise
        return block


def read_rows(
    path: Path, problems: Problems, *, required: tuple[str, ...], optional: tuple[str, ...] = ()
) -> Iterator[list[Row]]:
    """Yield the file's rows, some at a time, with the texts of `required` + `optional` columns.

    An optional column that the file does not have is empty. Rows of another length than the
    header's are noted in `problems`.

    Raises:
        FormatError: The file cannot be read or is not CSV; its header has not those columns.
    """
    table = CsvBlocks(path, problems, required=required, optional=optional)
    for block in table.blocks():
        yield table.rows(block)
        if problems.is_full:
            return


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
