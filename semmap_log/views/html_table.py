"""Tables for people as HTML: the same cells that a terminal shows, texts escaped."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.core.texts import counted
from semmap_log.views.column_table import ColumnTable, TableColumn, TextPicture, drawn_text
from semmap_log.views.pairs import PairTable

WIDTH = 120
"""Of what is drawn in letters."""
MOST_ROWS = 60
"""More are counted: a notebook keeps what it shows."""
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
        yield f'<p style="white-space: pre-line">{escape(str(shown))}</p>'


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


def _cell(tag: str, column: TableColumn, text: str) -> str:
    style = STYLE.format(side="right" if column.right else "left")
    return f'<{tag} style="{style}">{escape(text)}</{tag}>'
