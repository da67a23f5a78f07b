"""Pictures that stand in a page: drawn by matplotlib, in the colours of the page around them."""

from __future__ import annotations

import base64
import io
import re
from typing import Any

from semmap_log.views.plots.figures import SVG_STYLE, mpl, new_figure

__all__ = ["BAR", "INK", "LINE", "MARK", "RED", "axes", "new_figure", "png_of", "styled", "svg_of"]

INK, LINE = "#0a0b0c", "#0c0b0a"
"""Stand for the page's own ink and lines, which a dark page has lighter."""
BAR, RED, MARK = "#4f83cc", "#d43d3d", "#d98324"
"""Bars; the thesis's dashed red; the thesis's figures beside ours. Seen on white and on black."""
_PAGE_COLOURS = {INK: "currentColor", LINE: "var(--line)"}
_STYLE = {
    **SVG_STYLE,
    "font.size": 9,
    "text.color": INK,
    "axes.edgecolor": LINE,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "legend.frameon": False,
    "legend.fontsize": 8,
}


def styled() -> Any:
    """Return a context in which figures are made and drawn."""
    return mpl.rc_context(_STYLE)


def axes(width: float, height: float) -> tuple[Any, Any]:
    """Return a figure, inches, and its only axes."""
    figure = new_figure(width, height, layout="constrained")
    return figure, figure.add_subplot()


def svg_of(figure: Any, label: str) -> str:
    """Return a figure as an element of a page, as wide as its place.

    Args:
        figure: Made in `styled`.
        label: What who cannot see it is told.
    """
    drawn = io.StringIO()
    with styled():
        figure.savefig(drawn, format="svg", dpi=160, metadata={"Date": None, "Creator": None})
    svg = drawn.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(<svg [^>]*?)width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg [^>]*?)height="[^"]*"', r"\1", svg, count=1)
    for colour, of_page in _PAGE_COLOURS.items():
        svg = svg.replace(colour, of_page)
    words = label.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    return svg.replace("<svg ", f'<svg role="img" aria-label="{words}" ', 1)


def png_of(figure: Any) -> bytes:
    """Return a figure as a picture on white."""
    drawn = io.BytesIO()
    with styled():
        figure.savefig(drawn, format="png", dpi=150, facecolor="white", metadata={"Software": None})
    return drawn.getvalue()


def data_url(png: bytes) -> str:
    """Return a picture as a page holds it in itself."""
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
