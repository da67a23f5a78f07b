"""The one place that imports matplotlib; without it, says how to get it."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from semmap_log.errors import FormatError, MissingExtraError
from semmap_log.log.disk import output_errors, whole_file

try:
    import matplotlib as mpl
    from matplotlib import font_manager, patches, text
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
except ImportError:
    raise MissingExtraError("matplotlib", "plots") from None

__all__ = ["Figure", "mpl", "new_figure", "patches", "save_figure"]

FORMATS = (".png", ".svg")
DPI = 120
MOST_PIXELS = 2**16 - 1
"""A side of a picture, as far as matplotlib goes: thousands of lanes are drawn smaller."""
SVG_STYLE = {"svg.hashsalt": "semmap-log", "svg.fonttype": "none"}
"""So that the same plot is the same file, and its words can be searched."""
MORE_FONTS = (
    "Noto Sans CJK SC", "Noto Sans CJK JP", "Source Han Sans SC", "WenQuanYi Zen Hei",
    "WenQuanYi Micro Hei", "PingFang SC", "Hiragino Sans", "Microsoft YaHei", "Malgun Gothic",
    "Noto Sans Arabic", "Noto Sans Hebrew", "Noto Sans Thai", "Noto Sans Devanagari",
)  # fmt: skip
"""Where there are any, they have the letters of names that matplotlib's own font lacks."""


def new_figure(width: float, height: float, **how: Any) -> Any:
    """Return a figure, inches, that needs no screen."""
    figure = Figure(figsize=(width, height), dpi=DPI, **how)
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure, whole or not at all; the name tells the format.

    Raises:
        FormatError: The name ends in neither .png nor .svg.
        OutputError: The file cannot be written; what was there stays.
    """
    if path.suffix not in FORMATS:
        raise FormatError(path, f"expected a name that ends in {' or '.join(FORMATS)}")
    metadata = {"Date": None} if path.suffix == ".svg" else {}
    dpi = min(DPI, int(MOST_PIXELS / max(figure.get_size_inches())))
    if path.suffix == ".png":
        _add_letters(figure)
    with (
        output_errors(path),
        whole_file(path) as temporary,
        mpl.rc_context(SVG_STYLE),
        warnings.catch_warnings(),
    ):
        # A letter that no font has is a box in the picture; in an .svg it stays a letter.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        figure.savefig(temporary, format=path.suffix[1:], dpi=dpi, metadata=metadata)


def _add_letters(figure: Any) -> None:
    """Let words be written in fonts that are here, where the usual one lacks their letters."""
    here = set(font_manager.get_font_names())
    more = [name for name in MORE_FONTS if name in here]
    for words in figure.findobj(text.Text) if more else []:
        words.set_fontfamily([*mpl.rcParams["font.family"], *more])
