r"""The one place that prints tables: drawn in a terminal, a row a line into a pipe or a file.

In a pipe, tables are lines of cells with a tab between, the names of the columns first; nothing is
wrapped, cut or coloured. What stands around them for people (which moment, what the signs mean)
goes to stderr. Tables of one answer have an empty line between. A report without a table stays
text on stdout, and is not wrapped either.

Colours are for terminals (`plain_console.colours_wanted`); the lines of tables never have any.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.cli import plain_streams
from semmap_log.cli.plain_console import PlainConsole
from semmap_log.cli.plain_streams import plain, write_line
from semmap_log.views.column_table import ColumnTable, TextPicture

UNWRAPPED = 100_000
"""Columns of a report in a pipe: wider than any line of it."""


class Printer:
    """Prints what a verb shows, in the form that its reader wants."""

    def __init__(self) -> None:
        self._draws = plain_streams.is_for_people()
        self._console = PlainConsole(sys.stdout, width=None if self._draws else UNWRAPPED)
        self._tables = 0
        self._left_out: list[str] = []

    def print(self, *shown: RenderableType) -> None:
        """Print tables and what stands around them."""
        parts = list(_parts(shown)) or [Text()]
        for part in parts:
            if self._draws:
                self._draw(part)
            elif isinstance(part, (ColumnTable, TextPicture)):
                self._tell(part.table if isinstance(part, TextPicture) else part)
        if not self._draws:
            self._tell_rest([p for p in parts if not isinstance(p, (ColumnTable, TextPicture))])

    def _draw(self, part: RenderableType) -> None:
        if isinstance(part, TextPicture):
            for each in _parts((part.drawn(self._console.width),)):
                self._draw(each)
            return
        if not isinstance(part, ColumnTable):
            is_whole = isinstance(part, Text) and bool(part.no_wrap)  # a line to paste
            self._console.print(part, soft_wrap=is_whole)
            return
        if part.is_empty:
            return
        table, left_out = part.fitted(self._console.width)
        self._console.print(table)
        if left_out and left_out != self._left_out:
            self._left_out = left_out
            sys.stdout.flush()
            sys.stderr.write(
                f"left out, as {self._console.width} columns are too narrow: "
                f"{', '.join(left_out)}. A wider terminal has all, and so has a pipe.\n"
            )

    def _tell(self, table: ColumnTable) -> None:
        """Write lines; an empty one before a table that follows another."""
        if table.has_head and self._tables:
            write_line("")
        self._tables += 1
        for line in table.lines():
            write_line(line)

    def _tell_rest(self, parts: list[RenderableType]) -> None:
        """Write what is no table: beside one to stderr, else it is the answer."""
        texts = [part for part in parts if isinstance(part, Text)]
        if self._tables:
            for text in texts:
                if text.plain.strip():
                    sys.stderr.write(f"{plain(text.plain)}\n")
        else:
            for part in parts:
                self._console.print(part, soft_wrap=True)


def _parts(shown: tuple[RenderableType, ...]) -> Iterator[RenderableType]:
    """Yield the parts of groups, and of groups in them."""
    for each in shown:
        if isinstance(each, Group):
            yield from _parts(tuple(each.renderables))
        else:
            yield each
