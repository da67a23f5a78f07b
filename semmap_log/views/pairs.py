"""A table of names and values."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import RenderableType

from semmap_log.views.beside import BesideLayout, Pair, beside_or_below
from semmap_log.views.column_table import (
    Cell,
    CellValue,
    ColumnTable,
    TableColumn,
    drawn_cell,
    drawn_text,
)

LAYOUT = BesideLayout(gap=2, indent=2, readable=40)


class PairTable(ColumnTable):
    """Names and values; only programs see its head, `field` and `value`."""

    def __init__(self) -> None:
        super().__init__([TableColumn("field", "field"), TableColumn("value", "value")], LAYOUT.gap)

    def fitted(self, width: int) -> tuple[RenderableType, list[str]]:
        """Return the pairs as rich draws them in that width; nothing is left out."""
        found = [Pair(drawn_text(name), drawn_cell(value)) for (name, value), _ in self.rows]
        return beside_or_below(found, width, LAYOUT), []


def pairs(rows: Iterable[tuple[str, Cell]] = ()) -> PairTable:
    """Return a table of names and values."""
    table = PairTable()
    for name, value in rows:
        add_pair(table, name, value)
    return table


def add_pair(table: PairTable, name: str, value: Cell, *, told_name: str | None = None) -> None:
    """Add a name and a value; where the drawn name says too little alone, programs get another."""
    table.add(name if told_name is None else CellValue(name, told_name), value)
