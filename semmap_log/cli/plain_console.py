"""Rich's console for texts from outside: see `plain_streams`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TextIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from semmap_log.cli.plain_streams import plain, steering


class PlainConsole(Console):
    """What is drawn on it steers nothing, and brackets and colons in it are no markup."""

    def __init__(self, stream: TextIO, *, width: int | None = None) -> None:
        super().__init__(
            file=steering(stream), width=width, highlight=False, markup=False, emoji=False
        )

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Yield the segments of what is drawn, texts plain."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield Segment(plain(segment.text), segment.style)
