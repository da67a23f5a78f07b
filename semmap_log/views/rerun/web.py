"""The rerun viewer in a browser of this machine: a page, and the port its recordings come from."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from urllib.parse import urlencode

from semmap_log.errors import ViewerError
from semmap_log.views.rerun.process import LOCAL, RerunProcess, reserved_port, running

START_S = 60.0
MEMORY_LIMIT = "75%"
"""Of all: what is beyond is dropped, the oldest first, which would be the history."""

Theme = Literal["light", "dark"]


@dataclass(frozen=True, slots=True)
class WebViewer:
    """A web server of rerun's, and what it serves."""

    program: RerunProcess
    page_port: int

    @property
    def url(self) -> str:
        """Where recordings are sent to, and where other viewers get them."""
        return self.program.url

    def page(self, theme: Theme | None = None) -> str:
        """Return the address of the page to open; without a theme it has the browser's."""
        asked = {"url": self.url, "hide_welcome_screen": "1"}
        if theme is not None:
            asked["theme"] = theme
        return f"http://{LOCAL}:{self.page_port}/?{urlencode(asked)}"


@contextmanager
def web_viewer(source: Path | None = None) -> Iterator[WebViewer]:
    """Serve the viewer to browsers on this machine alone; it is gone when the block ends.

    Args:
        source: A recording to show; None: what will be sent to it.

    Raises:
        MissingExtraError: rerun is not installed.
        ViewerError: There is no such recording, or rerun failed.
    """
    if source is not None and not source.is_file():
        raise ViewerError(f"{source}: there is no such recording.")
    shown = [] if source is None else [str(source)]
    with reserved_port() as port, running(_options(port) + shown, os.environ) as program:
        program.wait_for(
            "serve its page",
            lambda: program.is_listening(port) and program.is_listening(),
            most_s=START_S,
        )
        yield WebViewer(program, port)


def _options(port: int) -> list[str]:
    return ["--serve-web", "--web-viewer-port", str(port), "--server-memory-limit", MEMORY_LIMIT]
