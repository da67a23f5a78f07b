"""A CSV file in blocks of whole lines: plain ones as columns of texts, others row by row.

Blanks around a cell do not count. A plain block has no quotes and as many commas in each line, so
that its cells are found at once. Any other goes through Python's own reader, which knows all of CSV
and reports what is wrong. Columns are found by name in the header, and the rows of another
system's file are converted to the words of a door CSV.
"""

from __future__ import annotations

import csv
import re
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.door_table import COLUMNS, DIGITS, TableForm
from semmap_log.interop.formats.parsing.foreign_file import (
    BLOCK_BYTES,
    decode_utf8,
    numbered_lines,
    open_unpacked,
    too_long,
)
from semmap_log.interop.formats.parsing.problems import Problems, shown
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
        breaks continues after the block, the rest of the cell is read, too.

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
        """Yield the lines to take, and those after them if they are wanted."""
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


AT_ONCE = 10_000
"""Rows that are handed on together."""
MOST_NAMED = 5
DELIMITERS = (",", ";", "\t", "|")


@dataclass(slots=True)
class ForeignRows:
    """Reads a file by a form; what it does not read of it is counted."""

    path: Path
    form: TableForm
    problems: Problems
    others: Counter[str] = field(default_factory=Counter)
    """Doors that no pattern names -> their rows."""
    other_lines: int = 0
    """Lines that are not of the form."""

    def blocks(self) -> Iterator[list[Row]]:
        """Yield rows with the texts of time, door, state and accuracy.

        Raises:
            FormatError: The file cannot be read, or has not these columns.
        """
        rows: list[Row] = []
        every = self._lines() if self.form.line is not None else self._table()
        for line, (at, door, state, accuracy) in every:
            if not self.form.takes(door):
                self.others[door] += 1
                continue
            rows.append(Row(line, [self._time(at), door, self.form.state(state), accuracy]))
            if len(rows) >= AT_ONCE:
                yield rows
                rows = []
            if self.problems.is_full:
                return
        yield rows

    def left_out(self) -> tuple[str, ...]:
        """Return what was not read, in words."""
        told = []
        if self.others:
            names = [shown(name) for name, _ in self.others.most_common(MOST_NAMED)]
            more = f" and {len(self.others) - MOST_NAMED} more" if len(self.others) > 5 else ""
            told.append(
                f"rows: {self.others.total():,}, of what --only does not name: "
                f"{', '.join(names)}{more}"
            )
        if self.other_lines:
            told.append(f"lines that say nothing of a door: {self.other_lines:,}")
        return tuple(told)

    def _lines(self) -> Iterator[Row]:
        assert self.form.line is not None
        for number, text in numbered_lines(self.path, most_bytes=MOST_LINE_BYTES):
            found = self.form.line(text)
            if found is None:
                self.other_lines += 1
                continue
            at, door, state = found
            yield Row(number, [" ".join(at.replace("T", " ").split()), door, state, ""])

    def _table(self) -> Iterator[Row]:
        lines = numbered_lines(self.path, most_bytes=MOST_LINE_BYTES)
        number, header = next(lines, (1, ""))
        delimiter = max(DELIMITERS, key=header.count)
        names = [cell.strip().lower() for cell in _cells(header, delimiter)]
        wanted = {key: self.form.columns.get(key, "").lower() for key in COLUMNS}
        lacking = [self.form.columns[key] for key in COLUMNS[:3] if wanted[key] not in names]
        if lacking:
            problem = (
                f"expected the columns {', '.join(lacking)}, got {shown(header.strip())}; "
                "--columns says what they are called"
            )
            raise FormatError(self.path, [(number, problem)])
        places = [names.index(wanted[key]) if wanted[key] in names else None for key in COLUMNS]
        for number, text in lines:
            cells = [cell.strip() for cell in _cells(text, delimiter)]
            if len(cells) < len(names):
                self.problems.add(
                    number, f"expected {len(names)} cells as in the header, got {len(cells)}"
                )
                continue
            at, door, state, accuracy = ("" if at is None else cells[at] for at in places)
            if delimiter != ",":  # in such tables a comma stands before decimals
                accuracy = accuracy.replace(",", ".")
            yield Row(number, [_day_first(at), door, state, accuracy])

    def _time(self, text: str) -> str:
        """Return a time that is a number of the form's unit as `@seconds`."""
        if self.form.unit is None:
            return text
        try:
            value = Decimal(text)
        except InvalidOperation:
            return text
        if not value.is_finite() or abs(value.adjusted()) > MOST_DIGITS:
            return text
        return f"@{value.scaleb(-DIGITS[self.form.unit]):f}"


MOST_DIGITS = 30
_DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})(?:[T,; ]+(\S.*))?")


def _day_first(text: str) -> str:
    """Return a time such as `2.3.2026 14:02` with its day as `2026-03-02`; others as they are."""
    if (found := _DAY_FIRST.fullmatch(text)) is None:
        return text
    day, month, year, clock = found.groups()
    return f"{year}-{month:0>2}-{day:0>2}" + (f" {clock}" if clock else "")


def _cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; a cell does not go on in the next."""
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        return []


MOST_LINE_BYTES = 65_536
MOST_ROWS = 50_000_000


class Row(NamedTuple):
    """A row: its line in the file and the texts of the requested columns."""

    line: int
    texts: list[str]


def places_of(
    header: Row, path: Path, required: tuple[str, ...], optional: tuple[str, ...], *, hint: str = ""
) -> list[int | None]:
    """Return at which place each wanted column stands; None: the file has it not.

    Raises:
        FormatError: A required one is not there, another is, or one is there twice.
    """
    names = [name.strip().lower() for name in header.texts]
    wanted = [*required, *optional]
    expected = ",".join(required) + "".join(f"[,{name}]" for name in optional)
    lacking = [name for name in required if name not in names]
    extra = [name for name in names if name not in wanted]
    twice = [name for name in wanted if names.count(name) > 1]
    if lacking or extra or twice:
        got = shown(",".join(header.texts))
        problem = f"expected a header {expected} (in any order), got {got}{hint}"
        raise FormatError(path, [(header.line, problem)])
    return [names.index(name) if name in names else None for name in wanted]


def has_length(line: int, cells: list[str], length: int, problems: Problems) -> bool:
    """Return whether a row has as many cells as the header, and note it if not."""
    if len(cells) == length:
        return True
    problems.add(line, f"expected {length} cells as in the header, got {len(cells)}")
    return False
