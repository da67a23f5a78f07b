"""A table: for people as text, for programs as CSV and JSON."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from semmap_log.core.texts import counted

Value = str | int | float | None
GAP = "  "


@dataclass(frozen=True)
class Column:
    """A column: its name for programs, its head and its form for people."""

    name: str
    head: str = ""
    form: str = ""
    """As `format` takes it; empty: text."""
    interval: bool = False
    """The row has NAME_pm, too: half of its 95 % interval."""
    group: str = ""
    """What stands above its head, and above those of the same group beside it."""
    is_drawn: bool = True
    """False: it is for programs alone."""
    once: bool = False
    """Drawn only where it is another than in the row above."""

    def cell(self, row: Mapping[str, Value]) -> str:
        """Return the cell of a row, as it is drawn."""
        drawn = _drawn(row.get(self.name), self.form)
        half = row.get(f"{self.name}_pm")
        if not self.interval or not isinstance(half, int | float) or math.isnan(half):
            return drawn
        return f"{drawn} ±{format(half, self.form.lstrip('+'))}"


@dataclass(frozen=True)
class Table:
    """Rows of values, by the columns' names."""

    name: str
    title: str
    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Value]]
    about: Mapping[str, Value] = field(default_factory=dict)
    """What all its rows are of, such as the building; columns of the CSV, too."""
    note: str = ""
    """What a reader must know of it."""

    @property
    def drawn(self) -> list[Column]:
        """The columns that people see."""
        return [column for column in self.columns if column.is_drawn]

    def text(self) -> str:
        """Return it for a terminal."""
        columns = self.drawn
        grid = [[column.head for column in columns], *self.cells()]
        widths = [max(map(len, cells)) for cells in zip(*grid, strict=True)]
        lines = [self.title, *_groups(columns, widths)]
        for cells in grid:
            fitted = [
                cell.rjust(width) if column.form else cell.ljust(width)
                for cell, width, column in zip(cells, widths, columns, strict=True)
            ]
            lines.append(GAP.join(fitted).rstrip())
        return "\n".join([*lines, *([self.note] if self.note else [])]) + "\n"

    def cells(self) -> list[list[str]]:
        """Return the cells of all rows, as they are drawn."""
        cells: list[list[str]] = []
        above: Mapping[str, Value] = {}
        for row in self.rows:
            same = [c.once and row.get(c.name) == above.get(c.name) for c in self.drawn]
            drawn = zip(self.drawn, same, strict=True)
            cells.append(["" if is_same else column.cell(row) for column, is_same in drawn])
            above = row
        return cells

    def json(self) -> dict[str, Any]:
        """Return it as a document; what is not known is null."""
        rows = [{name: _plain(value) for name, value in row.items()} for row in self.rows]
        return {"table": self.name, **self.about, "title": self.title, "rows": rows,
                "note": self.note}  # fmt: skip

    def names(self) -> list[str]:
        """Return the names of all values of a row."""
        halves = ((c.name, f"{c.name}_pm") if c.interval else (c.name,) for c in self.columns)
        return [name for names in halves for name in names]


def csv_of(tables: Sequence[Table]) -> str:
    """Return tables of one kind as one CSV document, what they are about in front."""
    about = list(dict.fromkeys(name for table in tables for name in table.about))
    names = list(dict.fromkeys(name for table in tables for name in table.names()))
    text = io.StringIO()
    writer = csv.DictWriter(text, [*about, *names], restval="", lineterminator="\n")
    writer.writeheader()
    for table in tables:
        for row in table.rows:
            values = {**table.about, **{name: row.get(name) for name in names}}
            writer.writerow({name: _plain(value) for name, value in values.items()})
    return text.getvalue()


def runs_said(count: int) -> str:
    """Return `1 run` or `30 runs`."""
    return counted(count, "run")


def _drawn(value: Value, form: str) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    if isinstance(value, float) and math.isinf(value):
        return "∞"
    return format(value, form) if form else str(value)


def _plain(value: Value) -> Value:
    """Return a value as JSON and CSV hold it: nine digits, nothing for what is not known."""
    if isinstance(value, float):
        return float(f"{value:.9g}") if math.isfinite(value) else None
    return value


def _groups(columns: Sequence[Column], widths: Sequence[int]) -> list[str]:
    """Return the line of what stands above the heads, if anything does."""
    line, at, before = "", 0, ""
    for column, width in zip(columns, widths, strict=True):
        if column.group and column.group != before:
            line = line.ljust(at) + column.group
        before, at = column.group, at + width + len(GAP)
    return [line] if line else []
