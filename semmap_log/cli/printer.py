"""The one place that prints tables: drawn in a terminal, a row a line into a pipe or a file.

In a pipe, tables are lines of cells with a tab between, the names of the columns first; nothing is
wrapped, cut or coloured. What stands around them for people (which moment, what the signs mean)
goes to stderr. Tables of one answer have an empty line between. A report without a table stays
text on stdout, and is not wrapped either.

Colours are for terminals (`colours_wanted`); the lines of tables never have any. `PlainConsole` is
rich's console for texts from outside: see `sanitized_streams`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from typing import TextIO

from rich.console import Console, ConsoleOptions, Group, RenderableType
from rich.segment import Segment
from rich.text import Text

from semmap_log.cli import sanitized_streams
from semmap_log.cli.sanitized_streams import plain, steering, write_line
from semmap_log.views.column_table import ColumnTable, TextPicture


class PlainConsole(Console):
    """What is drawn on it steers nothing, and brackets and colons in it are no markup."""

    def __init__(self, stream: TextIO, *, width: int | None = None) -> None:
        wanted = colours_wanted()
        super().__init__(
            file=steering(stream), width=width, highlight=False, markup=False, emoji=False,
            no_color=wanted is False, force_terminal=bool(wanted) or stream.isatty(),
        )  # fmt: skip

    def on_broken_pipe(self) -> None:
        """Leave it to who ends all verbs alike when their reader has gone; rich would exit with 1.

        Raises:
            BrokenPipeError: The one that is being handled.
        """
        raise  # noqa: PLE0704 - rich calls it from where that is caught

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the segments of what is drawn, texts plain."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(plain(segment.text), segment.style)


def colours_wanted() -> bool | None:
    """Return what the environment says of colours; None: nothing, so only terminals have them.

    NO_COLOR (https://no-color.org) is stronger than FORCE_COLOR and CLICOLOR_FORCE.
    """
    if os.environ.get("NO_COLOR"):
        return False
    if any(
        os.environ.get(name, "0") not in {"", "0"} for name in ("FORCE_COLOR", "CLICOLOR_FORCE")
    ):
        return True
    return False if os.environ.get("CLICOLOR") == "0" else None


UNWRAPPED = 100_000
"""Columns of a report in a pipe: wider than any line of it."""


class Printer:
    """Prints what a verb shows, in the form that its reader wants."""

    def __init__(self) -> None:
        self._draws = sanitized_streams.is_for_people()
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
            self._print_rest([p for p in parts if not isinstance(p, (ColumnTable, TextPicture))])

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

    def _print_rest(self, parts: list[RenderableType]) -> None:
        """Write what is not a table: to stderr if there is one, else as the answer."""
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
