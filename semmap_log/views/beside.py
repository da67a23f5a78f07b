"""Heads and texts beside each other, or a text below its head where it has no room beside it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from rich.cells import cell_len
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from semmap_log.core.lazy.late_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Pair:
    """A head and its text."""

    head: str
    text: str | Text
    style: str = ""
    """Of the text."""


@dataclass(frozen=True, slots=True)
class BesideLayout:
    """How pairs stand."""

    gap: int
    """Between a head and a text beside it."""
    indent: int
    """Of a text below its head."""
    readable: int
    """A text is folded beside its head where it has so many columns there."""


def beside_or_below(pairs: Sequence[Pair], width: int, layout: BesideLayout) -> Group:
    """Return pairs in that width, all their texts whole; texts beside a head stand in line."""
    heads = max((w for p in pairs if (w := cell_len(p.head)) <= width // 2), default=0)
    room = width - heads - layout.gap

    def fits(pair: Pair) -> bool:
        return cell_len(pair.head) <= heads and _has_room(str(pair.text), room, layout.readable)

    parts: list[RenderableType] = []
    for is_beside, group in groupby(pairs, key=fits):
        if is_beside:
            parts.append(_beside(group, heads, room, layout.gap))
        else:
            parts += _below(group, layout.indent)
    return Group(*parts)


def _has_room(text: str, room: int, readable: int) -> bool:
    """Tell whether a text fits: on one line, or folded at its spaces so that it reads well."""
    if cell_len(text) <= room:
        return True
    return room >= readable and all(cell_len(word) <= room for word in text.split())


def _beside(pairs: Iterable[Pair], heads: int, room: int, gap: int) -> Table:
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
