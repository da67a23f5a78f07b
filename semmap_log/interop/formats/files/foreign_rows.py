"""The rows of another system's file, in the words of a door CSV."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from pathlib import Path

from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.csv_rows import MOST_LINE_BYTES, Row
from semmap_log.interop.formats.files.table_forms import COLUMNS, DIGITS, TableForm
from semmap_log.interop.formats.parsing.foreign_file import numbered_lines
from semmap_log.interop.formats.parsing.problems import Problems, shown

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
