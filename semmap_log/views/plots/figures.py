"""What all figures share; the only file that imports matplotlib.

If it is missing, the error says how to install it.
"""

from __future__ import annotations

import warnings
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

from semmap_log.core.io.disk import atomic_file, output_errors
from semmap_log.errors import FormatError, MissingExtraError
from semmap_log.views.event_words import HasShape

try:
    import matplotlib as mpl
    from matplotlib import font_manager, patches, text
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
except ImportError:
    raise MissingExtraError("matplotlib", "plots") from None

__all__ = [
    "Figure",
    "Line2D",
    "LineCollection",
    "has_shape",
    "letters_of",
    "mpl",
    "new_figure",
    "patches",
    "save_figure",
]

FORMATS = (".png", ".svg")
DPI = 120
MOST_PIXELS = 2**16 - 1
"""A side of a picture, as far as matplotlib goes: thousands of lanes are drawn smaller."""
SVG_STYLE = {"svg.hashsalt": "semmap-log", "svg.fonttype": "none"}
"""Settings that make equal plots equal files, with searchable text."""
MORE_FONTS = (
    "Noto Sans CJK SC", "Noto Sans CJK JP", "Source Han Sans SC", "WenQuanYi Zen Hei",
    "WenQuanYi Micro Hei", "PingFang SC", "Hiragino Sans", "Microsoft YaHei", "Malgun Gothic",
    "Noto Sans Arabic", "Noto Sans Hebrew", "Noto Sans Thai", "Noto Sans Devanagari",
)  # fmt: skip
"""Where there are any, they have the letters of names that matplotlib's own font lacks."""


class ShownFigure(Figure):
    """A figure that a notebook shows wherever it was made, also without `%matplotlib`."""

    def _repr_png_(self) -> bytes:
        data = BytesIO()
        _add_letters(self)
        self.savefig(data, format="png", dpi=DPI)
        return data.getvalue()


def new_figure(width: float, height: float, **how: Any) -> Any:
    """Return a figure, inches, that needs no screen."""
    figure = ShownFigure(figsize=(width, height), dpi=DPI, **how)
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure, whole or not at all, in the format that the name's suffix names.

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
        atomic_file(path) as temporary,
        mpl.rc_context(SVG_STYLE),
        warnings.catch_warnings(),
    ):
        # Names have no such letter; of a zone or a robot it may be a box in the picture.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        figure.savefig(temporary, format=path.suffix[1:], dpi=dpi, metadata=metadata)


def _add_letters(figure: Any) -> None:
    """Use available fonts for text whose letters the usual font lacks."""
    families = _families()
    for words in figure.findobj(text.Text) if len(families) > 1 else []:
        words.set_fontfamily(families)


def letters_of(path: Path) -> HasShape:
    """Return a function that checks whether a picture of that name can draw a character.

    In an .svg a letter stays a letter: the program that shows it chooses a font that has it.
    """
    return _has_any_shape if path.suffix == ".svg" else has_shape


@cache
def has_shape(character: str) -> bool:
    """Return whether an available font has a shape for a character."""
    return any(font.get_char_index(ord(character)) for font in _fonts())


def _has_any_shape(_: str) -> bool:
    return True


@cache
def _families() -> list[str]:
    here = set(font_manager.get_font_names())
    return [*mpl.rcParams["font.family"], *(name for name in MORE_FONTS if name in here)]


@cache
def _fonts() -> list[Any]:
    wanted = (font_manager.FontProperties(family=[family]) for family in _families())
    return [font_manager.get_font(font_manager.findfont(each)) for each in wanted]
