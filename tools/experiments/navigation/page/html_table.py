"""A table as a page shows it."""

from __future__ import annotations

from html import escape
from itertools import groupby

from navigation.tables.table import Table


def html_table(table: Table) -> str:
    """Return a table with its title and note; a phone scrolls it sideways."""
    head = "".join(_head(column.head, is_words=not column.form) for column in table.drawn)
    rows = "".join(
        _row(cells, table, is_thesis=str(row.get("source", "")).startswith("thesis"))
        for cells, row in zip(table.cells(), table.rows, strict=True)
    )
    note = f'<p class="note">{escape(table.note)}</p>' if table.note else ""
    return (
        f"<h3>{escape(table.title)}</h3>"
        f'<div class="scroll"><table><thead>{_groups(table)}<tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>{note}\n"
    )


def _head(words: str, *, is_words: bool) -> str:
    return f"<th{_class(is_words)}>{escape(words)}</th>"


def _row(cells: list[str], table: Table, *, is_thesis: bool) -> str:
    drawn = "".join(
        f"<td{_class(not column.form)}>{escape(cell)}</td>"
        for cell, column in zip(cells, table.drawn, strict=True)
    )
    return f"<tr{' class=thesis' if is_thesis else ''}>{drawn}</tr>"


def _groups(table: Table) -> str:
    if not any(column.group for column in table.drawn):
        return ""
    spans = [(group, len(list(some))) for group, some in groupby(table.drawn, lambda c: c.group)]
    cells = "".join(f'<th colspan="{count}">{escape(group)}</th>' for group, count in spans)
    return f"<tr>{cells}</tr>"


def _class(is_words: bool) -> str:  # noqa: FBT001 - a cell's only question
    return ' class="words"' if is_words else ""
