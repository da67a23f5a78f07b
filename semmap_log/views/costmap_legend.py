"""What stands beside a costmap's picture: what shades and strokes mean, how long a metre is."""

from __future__ import annotations

import math
import unicodedata
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, INSCRIBED, LETHAL, NO_INFORMATION
from semmap_log.core.model.doors import DoorState
from semmap_log.views.costmap_shading import shaded
from semmap_log.views.palette import COST_DOORS, COST_INK

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont, ImageFont

LEGEND_PX = 250
NOTE_PX = 17
NOTES_BELOW_PX = 8 * 32 + 6 + 48
"""How far below the legend's upper edge its notes start."""
_SWATCH = (44, 22)
_LINE_PX = 32

_SHADES = (
    (FREE_SPACE, "free (0)"),
    (None, "inflated (1 to 252)"),
    (INSCRIBED, "inscribed (253)"),
    (LETHAL, "lethal (254)"),
    (NO_INFORMATION, "unknown (255)"),
)
_STROKES = (
    (DoorState.CLOSED, "door, closed"),
    (DoorState.OPEN, "door, open"),
    (DoorState.UNKNOWN, "door, not known"),
)


def font(size: int) -> FreeTypeFont | ImageFont:
    """Return the font that comes with Pillow: the same on every machine."""
    from PIL import ImageFont

    return ImageFont.load_default(size)


def draw_legend(canvas: Image, at: tuple[int, int], notes: list[str], *, px_a_metre: float) -> None:
    """Draw it from its upper left corner down; the notes stand below."""
    from PIL.ImageDraw import Draw

    draw = Draw(canvas)
    x, y = at
    for cost, text in _SHADES:
        canvas.paste(_swatch(cost), (x, y))
        draw.rectangle((x, y, x + _SWATCH[0] - 1, y + _SWATCH[1] - 1), outline=COST_INK)
        draw.text((x + _SWATCH[0] + 10, y + _SWATCH[1] / 2), text, COST_INK, font(14), anchor="lm")
        y += _LINE_PX
    y += 6
    for state, text in _STROKES:
        middle = y + _SWATCH[1] / 2
        draw_door(draw, (x + 2, middle), (x + _SWATCH[0] - 2, middle), state)
        draw.text((x + _SWATCH[0] + 10, middle), text, COST_INK, font(14), anchor="lm")
        y += _LINE_PX
    _draw_scale_bar(draw, (x, y + 14), px_a_metre)
    draw_notes(draw, (x, at[1] + NOTES_BELOW_PX), notes)


def draw_notes(draw: ImageDraw, at: tuple[int, int], notes: list[str]) -> None:
    """Draw lines of small text, each cut off where its column ends."""
    for line, note in enumerate(notes):
        said = fitted(draw, note, LEGEND_PX - 16, 12)
        draw.text((at[0], at[1] + NOTE_PX * line), said, COST_INK, font(12))


def drawable(text: str) -> str:
    """Return the text in letters that the font has: without accents, or a question mark."""
    return "".join(c if _has_shape(c) else _plain(c) for c in text)


def lacks_letters(text: str) -> bool:
    """Tell whether a letter or a digit would become a question mark."""
    return any(c.isalnum() and not _has_shape(c) and _plain(c) == "?" for c in text)


def fitted(draw: ImageDraw, text: str, room_px: float, size: int) -> str:
    """Return as much of a drawable text as has room."""
    while len(text) > 3 and draw.textlength(text, font(size)) > room_px:
        text = text.removesuffix("...")[:-1].rstrip() + "..."
    return text


def _plain(character: str) -> str:
    base = unicodedata.normalize("NFKD", character)[0]
    return base if _has_shape(base) else "?"


@lru_cache(1024)
def _has_shape(character: str) -> bool:
    """Tell whether the font has a shape of its own for it."""
    mask = font(14).getmask
    return character == " " or (
        character.isprintable() and bytes(mask(character)) != bytes(mask("\U0010fffd"))
    )


def draw_door(
    draw: ImageDraw, start: tuple[float, float], end: tuple[float, float], state: DoorState
) -> None:
    """Draw a door's line; each state has a stroke of its own, on white, to stand off any cell."""
    colour = COST_DOORS[state]
    draw.line((*start, *end), "white", 11)
    if state == DoorState.CLOSED:
        draw.line((*start, *end), colour, 7)
    elif state == DoorState.OPEN:
        draw.line((*start, *end), colour, 2)
    else:
        for dash_start, dash_end in _dashes(start, end):
            draw.line((*dash_start, *dash_end), colour, 5)
    for x, y in (start, end):
        draw.ellipse((x - 3, y - 3, x + 3, y + 3), colour)


def round_length(metres: float) -> float:
    """Return 1, 2 or 5 times a power of ten: the least that is not shorter."""
    power = 10.0 ** math.floor(math.log10(metres))
    return next(power * factor for factor in (1, 2, 5, 10) if power * factor >= metres * 0.999)


def in_metres(length: float) -> str:
    """Return a round length in the unit that people use."""
    if length >= 1000:
        return f"{length / 1000:g} km"
    if length >= 1:
        return f"{length:g} m"
    return f"{length * 100:g} cm" if length >= 0.01 else f"{length * 1000:g} mm"


def _swatch(cost: int | None) -> Image:
    """Return a sample of a cost; None: of all costs of inflation, the dear to the right."""
    from PIL.Image import fromarray

    width, height = _SWATCH
    costs = np.linspace(1, 252, width) if cost is None else np.full(width, cost)
    return fromarray(shaded(np.tile(costs.astype(np.uint8), (height, 1)), 1))


def _draw_scale_bar(draw: ImageDraw, at: tuple[int, int], px_a_metre: float) -> None:
    """Draw a bar of a round length, half of it black."""
    length = round_length(80 / px_a_metre)
    x, y = at
    width = length * px_a_metre
    draw.rectangle((x, y, x + width, y + 7), "white", COST_INK)
    draw.rectangle((x, y, x + width / 2, y + 7), COST_INK)
    draw.text((x + width + 8, y + 4), in_metres(length), COST_INK, font(14), anchor="lm")


def _dashes(
    start: tuple[float, float], end: tuple[float, float], *, dash_px: float = 6
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Return the parts of a line that are drawn: as long as the gaps, one at each end."""
    count = max(1, round(math.dist(start, end) / dash_px / 2))
    cuts = [n / (2 * count + 1) for n in range(2 * count + 2)]

    def at(share: float) -> tuple[float, float]:
        return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])

    return [(at(cuts[n]), at(cuts[n + 1])) for n in range(0, 2 * count + 1, 2)]
