"""Rich's console for texts from outside: see `plain_streams`."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TextIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from semmap_log.cli.plain_streams import plain, steering


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
