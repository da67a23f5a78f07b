"""Render one table in several forms: drawn for people, as lines for programs, and as HTML.

Drawn, columns that do not fit are left out, the least important first, and named. Where not even
the important ones fit, the cells of a row stand below each other, all of them. As lines, every
column is present at any width, under a name that never changes; cells are separated by a tab, so
that `cut -f` takes them. HTML shows the same cells as a terminal, with texts escaped. Tables of
names and values place a text next to its head, or below it where there is no room.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from semmap_log.core.texts import counted

WIDTH = 120
"""Columns of text."""
MOST_ROWS = 60
"""Rows to show; more are only counted, since a notebook stores what it shows."""
STYLE = "text-align: {side}; vertical-align: top; white-space: pre-line"


def html_of(shown: RenderableType) -> str:
    """Return tables and texts as HTML, in their order."""
    return "<div>" + "".join(_parts(shown)) + "</div>"


def _parts(shown: RenderableType) -> Iterator[str]:
    if isinstance(shown, Group):
        for part in shown.renderables:
            yield from _parts(part)
    elif isinstance(shown, TextPicture):
        yield from _parts(shown.drawn(WIDTH))
    elif isinstance(shown, ColumnTable):
        yield _table(shown)
    elif isinstance(shown, (Text, str)) and str(shown):
        yield f'<p style="white-space: pre-line">{_escaped(str(shown))}</p>'


def _table(table: ColumnTable) -> str:
    places = [place for place, column in enumerate(table.columns) if column.is_drawn]
    columns = [table.columns[place] for place in places]
    head = ""
    if table.has_head and not isinstance(table, PairTable):
        cells = (_cell("th", column, column.head or "") for column in columns)
        head = f"<thead><tr>{''.join(cells)}</tr></thead>"
    rows = (
        "".join(_cell("td", table.columns[place], drawn_text(cells[place])) for place in places)
        for cells, _ in table.rows[:MOST_ROWS]
    )
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    left_out = len(table.rows) - MOST_ROWS
    more = f"<p>… and {counted(left_out, 'row')} more</p>" if left_out > 0 else ""
    return f"<table>{head}<tbody>{body}</tbody></table>{more}"


def _escaped(text: str) -> str:
    from html import escape  # a terminal does not need it

    return escape(text)


def _cell(tag: str, column: TableColumn, text: str) -> str:
    style = STYLE.format(side="right" if column.right else "left")
    return f'<{tag} style="{style}">{_escaped(text)}</{tag}>'


@dataclass(frozen=True, slots=True)
class Pair:
    """A head and its text."""

    head: str
    text: str | Text
    style: str = ""
    """Of the text."""


@dataclass(frozen=True, slots=True)
class PairLayout:
    """How pairs stand."""

    gap: int
    """Between a head and a text next to it."""
    indent: int
    """Of a text below its head."""
    readable: int
    """The least number of columns in which a text is folded next to its head."""


def aligned_pairs(pairs: Sequence[Pair], width: int, layout: PairLayout) -> Group:
    """Return pairs in that width, no text cut; texts next to heads are aligned."""
    heads = max((w for p in pairs if (w := cell_len(p.head)) <= width // 2), default=0)
    room = width - heads - layout.gap

    def fits(pair: Pair) -> bool:
        return cell_len(pair.head) <= heads and _has_room(str(pair.text), room, layout.readable)

    parts: list[RenderableType] = []
    for is_next_to, group in groupby(pairs, key=fits):
        if is_next_to:
            parts.append(_next_to(group, heads, room, layout.gap))
        else:
            parts += _below(group, layout.indent)
    return Group(*parts)


def _has_room(text: str, room: int, readable: int) -> bool:
    """Return whether a text fits, on one line or folded legibly at its spaces."""
    if cell_len(text) <= room:
        return True
    return room >= readable and all(cell_len(word) <= room for word in text.split())


def _next_to(pairs: Iterable[Pair], heads: int, room: int, gap: int) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0), show_header=False)
    table.add_column(width=heads, no_wrap=True)
    table.add_column(max_width=room, overflow="fold")
    for pair in pairs:
        table.add_row(_head(pair), pair.text, style=pair.style)
    return table


def _below(pairs: Iterable[Pair], indent: int) -> Iterator[RenderableType]:
    for pair in pairs:
        if pair.head:
            yield _head(pair)
        text = Text(style=pair.style, overflow="fold").append(pair.text)
        yield Padding(text, (0, 0, 0, indent), expand=False)


def _head(pair: Pair) -> Text:
    return Text(pair.head, style="dim", overflow="fold")


GAP = 1
"""Between two drawn columns."""
UNBOUNDED = 2**30
BELOW = PairLayout(gap=GAP, indent=0, readable=16)
"""Of a row's cells that stand below each other."""


@dataclass(frozen=True, slots=True)
class CellValue:
    """A cell with one text for people and another for programs."""

    drawn: str | Text
    told: str


Cell = str | Text | CellValue


@dataclass(frozen=True, slots=True)
class TableColumn:
    """A column: its names, and how it is drawn."""

    name: str = ""
    """Its head for programs; empty: it is only drawn."""
    head: str | None = None
    """Its head when drawn; None: it is not drawn."""
    right: bool = False
    """Aligned to the right, for numbers."""
    least: int | None = None
    """The least width to which its texts may fold; None: they stay on one line."""
    most: int | None = None
    """It folds texts that are wider."""
    width: int | None = None
    """Always as wide as this, so that the pages of a long table line up; longer texts fold."""
    ratio: int | None = None
    """Its share of the remaining width."""
    yields: int = 0
    """In a narrow terminal, columns of the greatest number are left out first, together;
    0: never."""

    @property
    def is_drawn(self) -> bool:
        """False for a column that is for programs alone."""
        return self.head is not None


@dataclass(slots=True)
class ColumnTable:
    """Columns, and rows of a cell for each."""

    columns: list[TableColumn]
    gap: int = GAP
    has_head: bool = True
    """False for all pages of a long table but the first."""
    rows: list[tuple[tuple[Cell, ...], str]] = field(default_factory=list)
    """Cells, and the style of their row."""

    def add(self, *cells: Cell, style: str = "") -> None:
        """Add a row."""
        if len(cells) != len(self.columns):
            raise ValueError(f"expected {len(self.columns)} cells, got {len(cells)}")
        self.rows.append((cells, style))

    @property
    def is_empty(self) -> bool:
        """True without a row."""
        return not self.rows

    def lines(self) -> Iterator[str]:
        """Yield the row of names, if it has a head, and the rows, each one line."""
        told = [place for place, column in enumerate(self.columns) if column.name]
        if self.has_head:
            yield line_of(self.columns[place].name for place in told)
        for cells, _ in self.rows:
            yield line_of(_told(cells[place]) for place in told)

    def fitted(self, width: int) -> tuple[RenderableType, list[str]]:
        """Return the table as rich draws it in that width, and the heads of columns left out."""
        wanted = [place for place, column in enumerate(self.columns) if column.is_drawn]
        needs = self._fitting(wanted, width)
        spare = width - sum(needs.values()) - self.gap * (len(needs) - 1)
        if spare < 0:
            return self._draw_below(wanted, width), []
        out = [_flat(self.columns[place].head or "") for place in wanted if place not in needs]
        return self._draw(needs, spare), out

    def _fitting(self, places: list[int], width: int) -> dict[int, int]:
        """Return the columns that fit, or are never left out, and the width that they need."""
        needs = {place: self._need(place) for place in places}
        order = sorted(
            (p for p in places if self.columns[p].yields), key=self._yields, reverse=True
        )
        for _, group in groupby(order, key=self._yields):
            if sum(needs.values()) + self.gap * (len(needs) - 1) <= width:
                break
            for place in group:
                del needs[place]
        return needs

    def _yields(self, place: int) -> int:
        return self.columns[place].yields

    def _need(self, place: int) -> int:
        """Return the least width in which a column can be read."""
        column = self.columns[place]
        if column.width is not None:
            return column.width
        if column.ratio is not None:
            return column.least or 0
        widest = self._widest(place)
        return widest if column.least is None else min(widest, column.least)

    def _widest(self, place: int) -> int:
        """Return the width of a column's longest line, and its head's."""
        texts = [self.columns[place].head or ""] * self.has_head
        texts += [drawn_text(cells[place]) for cells, _ in self.rows]
        return max((cell_len(line) for text in texts for line in text.split("\n")), default=0)

    def _widths(self, needs: dict[int, int], spare: int) -> dict[int, int]:
        """Return the widths of the columns that fold: what they need, and their share of the rest.

        Narrow columns come first. Rich would shrink wide ones below what they need.
        """
        folding = {p for p in needs if self.columns[p].least is not None}
        folding -= {p for p in folding if self.columns[p].ratio is not None}
        wanted = {p: min(self._widest(p), self.columns[p].most or UNBOUNDED) for p in folding}

        def up_to(most: int) -> dict[int, int]:
            return {p: max(needs[p], min(wanted[p], most)) for p in folding}

        in_all = spare + sum(needs[p] for p in folding)
        fitting = (most for most in range(in_all, -1, -1) if sum(up_to(most).values()) <= in_all)
        return up_to(next(fitting))

    def _draw(self, needs: dict[int, int], spare: int) -> Table:
        places, widths = list(needs), self._widths(needs, spare)
        columns = [self.columns[place] for place in places]
        table = Table(
            box=None,
            pad_edge=False,
            padding=(0, self.gap, 0, 0),
            show_header=self.has_head,
            expand=any(column.ratio for column in columns),
        )
        for place, column in zip(places, columns, strict=True):
            folds = column.least is not None or column.width is not None
            table.add_column(
                column.head or "",
                justify="right" if column.right else "left",
                overflow="fold" if folds else "ellipsis",
                no_wrap=not folds,
                min_width=None if column.least is None else needs[place],
                width=widths.get(place, column.width),
                ratio=column.ratio,
            )
        for cells, style in self.rows:
            table.add_row(*(drawn_cell(cells[place]) for place in places), style=style)
        return table

    def _draw_below(self, places: list[int], width: int) -> Group:
        """Return the cells of each row below each other, each after the head of its column."""
        pairs: list[Pair] = []
        for number, (cells, style) in enumerate(self.rows):
            if number or not self.has_head:
                pairs.append(Pair("", ""))
            for place in places:
                if drawn_text(cells[place]):
                    head = _flat(self.columns[place].head or "")
                    pairs.append(Pair(head, _on_one_line(drawn_cell(cells[place])), style))
        return aligned_pairs(pairs, width, BELOW)

    def __rich_console__(self, _: Console, options: ConsoleOptions) -> RenderResult:
        if self.rows:
            yield self.fitted(options.max_width)[0]


@dataclass(frozen=True, slots=True)
class TextPicture:
    """A picture for the terminal, and a table for programs."""

    drawn: Callable[[int], RenderableType]
    """Of the width of the terminal."""
    table: ColumnTable

    def __rich_console__(self, _: Console, options: ConsoleOptions) -> RenderResult:
        yield self.drawn(options.max_width)


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
    return cell.told if isinstance(cell, CellValue) else str(cell)


def drawn_cell(cell: Cell) -> str | Text:
    """Return a cell as people see it."""
    return cell.drawn if isinstance(cell, CellValue) else cell


def _on_one_line(drawn: str | Text) -> str | Text:
    if isinstance(drawn, str):
        return _flat(drawn)
    return Text(" ").join(drawn.split("\n"))


def drawn_text(cell: Cell) -> str:
    """Return the text that people see."""
    return str(cell.drawn if isinstance(cell, CellValue) else cell)


def _flat(text: str) -> str:
    return text.replace("\n", " ")


LAYOUT = PairLayout(gap=2, indent=2, readable=40)


class PairTable(ColumnTable):
    """Names and values; only programs see its head, `field` and `value`."""

    def __init__(self) -> None:
        super().__init__([TableColumn("field", "field"), TableColumn("value", "value")], LAYOUT.gap)

    def fitted(self, width: int) -> tuple[RenderableType, list[str]]:
        """Return the pairs as rich draws them in that width; nothing is left out."""
        found = [Pair(drawn_text(name), drawn_cell(value)) for (name, value), _ in self.rows]
        return aligned_pairs(found, width, LAYOUT), []


def pairs(rows: Iterable[tuple[str, Cell]] = ()) -> PairTable:
    """Return a table of names and values."""
    table = PairTable()
    for name, value in rows:
        add_pair(table, name, value)
    return table


def add_pair(table: PairTable, name: str, value: Cell, *, machine_name: str | None = None) -> None:
    """Add a name and a value; programs get another name if the drawn one is too short alone."""
    table.add(name if machine_name is None else CellValue(name, machine_name), value)
