"""How values show themselves in a notebook.

What draws them knows them; they do not know it. So the room that draws registers here, and is
loaded when somebody looks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

_loaders: list[Callable[[], NotebookViews]] = []


class NotebookViews(Protocol):
    """What draws the values of this package."""

    def html_of(self, value: Any) -> str:
        """Return a value as HTML, texts escaped."""

    def plot_log(self, log: Any, *, since: Any, until: Any, doors: Any, progress: Any) -> Any:
        """Return the states of a log's doors as a figure of matplotlib."""

    def plot_timeline(self, timeline: Any, *, name: str, tz: str) -> Any:
        """Return the states of one door so."""


def register_notebook_views(load: Callable[[], NotebookViews]) -> None:
    """Let values be drawn by what this returns; the last one that was told counts."""
    _loaders[:] = [load]


def notebook_views() -> NotebookViews:
    """Return what draws values."""
    return _loaders[0]()


class ShownAsTable:
    """A value that a notebook shows as a table."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return notebook_views().html_of(self)
