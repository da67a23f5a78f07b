"""A table in its two forms: drawn in a terminal for people, and a row a line for programs.

Drawn, columns that do not fit are left out, the least important first, and named. As lines, every
column is there at any width, under a name that never changes; cells are separated by a tab, so that
`cut -f` takes them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.table import Table
from rich.text import Text

GAP = 1
"""Between two drawn columns."""


@dataclass(frozen=True, slots=True)
class Both:
    """A cell that is drawn as one text and told to programs as another."""

    drawn: str | Text
    told: str


Cell = str | Text | Both


@dataclass(frozen=True, slots=True)
class Column:
    """A column: how it is called, and how it is drawn."""

    name: str = ""
    """Its head for programs; empty: it is only drawn."""
    head: str | None = None
    """Its head where it is drawn; None: it is not."""
    right: bool = False
    """Numbers: their ends stand below each other."""
    least: int | None = None
    """It may fold its texts, down to this width; None: they stay on one line."""
    most: int | None = None
    """It folds texts that are wider."""
    width: int | None = None
    """Always as wide as this, so that the pages of a long table line up; longer texts fold."""
    ratio: int | None = None
    """Its part of what the others leave."""
    yields: int = 0
    """Columns of the greatest number are left out first, together, where a terminal is too narrow;
    0: never."""

    @property
    def is_drawn(self) -> bool:
        """True unless it is for programs alone."""
        return self.head is not None


@dataclass(slots=True)
class ColumnTable:
    """Columns, and rows of a cell for each."""

    columns: list[Column]
    gap: int = GAP
    has_head: bool = True
    """False for the pages of a long table behind the first."""
    draws_head: bool = True
    """False: only programs see the names of the columns."""
    _rows: list[tuple[tuple[Cell, ...], str]] = field(default_factory=list)

    def add(self, *cells: Cell, style: str = "") -> None:
        """Add a row."""
        if len(cells) != len(self.columns):
            raise ValueError(f"expected {len(self.columns)} cells, got {len(cells)}")
        self._rows.append((cells, style))

    @property
    def is_empty(self) -> bool:
        """True without a row."""
        return not self._rows

    def lines(self) -> Iterator[str]:
        """Yield the row of names, if it has a head, and the rows, each one line."""
        told = [place for place, column in enumerate(self.columns) if column.name]
        if self.has_head:
            yield line_of(self.columns[place].name for place in told)
        for cells, _ in self._rows:
            yield line_of(_told(cells[place]) for place in told)

    def fitted(self, width: int) -> tuple[Table, list[str]]:
        """Return the table as rich draws it in that width, and the heads of columns left out."""
        wanted = [place for place, column in enumerate(self.columns) if column.is_drawn]
        kept = self._fitting(wanted, width)
        out = [_flat(self.columns[place].head or "") for place in wanted if place not in kept]
        return self._draw(kept), out

    def _fitting(self, places: list[int], width: int) -> list[int]:
        """Return those of the columns that fit, or that never yield."""
        needs = {place: self._need(place) for place in places}
        order = sorted(
            (p for p in places if self.columns[p].yields), key=self._yields, reverse=True
        )
        for _, group in groupby(order, key=self._yields):
            if sum(needs.values()) + self.gap * (len(needs) - 1) <= width:
                break
            for place in group:
                del needs[place]
        return list(needs)

    def _yields(self, place: int) -> int:
        return self.columns[place].yields

    def _need(self, place: int) -> int:
        """Return the least width in which a column can be read."""
        column = self.columns[place]
        if column.width is not None:
            return column.width
        if column.ratio is not None:
            return column.least or 0
        texts = [column.head or ""] * self._shows_head
        texts += [_drawn_text(cells[place]) for cells, _ in self._rows]
        widest = max((cell_len(line) for text in texts for line in text.split("\n")), default=0)
        return widest if column.least is None else min(widest, column.least)

    @property
    def _shows_head(self) -> bool:
        return self.has_head and self.draws_head

    def _draw(self, places: list[int]) -> Table:
        columns = [self.columns[place] for place in places]
        table = Table(
            box=None,
            pad_edge=False,
            padding=(0, self.gap, 0, 0),
            show_header=self._shows_head,
            expand=any(column.ratio for column in columns),
        )
        for place, column in zip(places, columns, strict=True):
            folds = column.least is not None or column.width is not None
            table.add_column(
                column.head or "",
                justify="right" if column.right else "left",
                overflow="fold" if folds else "ellipsis",
                no_wrap=not folds,
                min_width=None if column.least is None else self._need(place),
                max_width=column.most,
                width=column.width,
                ratio=column.ratio,
            )
        for cells, style in self._rows:
            table.add_row(*(_drawn(cells[place]) for place in places), style=style)
        return table

    def __rich_console__(self, _: Console, options: ConsoleOptions) -> RenderResult:
        if self._rows:
            yield self.fitted(options.max_width)[0]


@dataclass(frozen=True, slots=True)
class Picture:
    """What a terminal shows as a picture, and programs read as a table."""

    drawn: Callable[[int], RenderableType]
    """Of the width of the terminal."""
    table: ColumnTable

    def __rich_console__(self, _: Console, options: ConsoleOptions) -> RenderResult:
        yield self.drawn(options.max_width)


def pairs(rows: Iterable[tuple[str, Cell]] = ()) -> ColumnTable:
    """Return a table of names and values; only programs see its head, `field` and `value`."""
    table = ColumnTable(
        [Column("field", "field"), Column("value", "value", least=1)], gap=2, draws_head=False
    )
    for name, value in rows:
        add_pair(table, name, value)
    return table


def add_pair(table: ColumnTable, name: str, value: Cell, *, told_name: str | None = None) -> None:
    """Add a name and a value; where the drawn name says too little alone, programs get another."""
    drawn = Text(name, style="dim")
    table.add(drawn if told_name is None else Both(drawn, told_name), value)


def with_line_end(text: str, width: int) -> str:
    """Return a text with what is longer than that in a second line."""
    return "\n".join(filter(None, (text[:width], text[width:])))


def line_of(cells: Iterable[str]) -> str:
    """Return cells as a line for programs."""
    return "\t".join(plain_cell(cell) for cell in cells)


def plain_cell(text: str) -> str:
    r"""Return a text as the cell of a line: tabs, line ends and their like are spelt `\t`, `\n`."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def _told(cell: Cell) -> str:
    return cell.told if isinstance(cell, Both) else str(cell)


def _drawn(cell: Cell) -> RenderableType:
    return cell.drawn if isinstance(cell, Both) else cell


def _drawn_text(cell: Cell) -> str:
    return str(cell.drawn if isinstance(cell, Both) else cell)


def _flat(head: str) -> str:
    return head.replace("\n", " ")
