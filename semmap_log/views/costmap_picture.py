"""A costmap as a picture for people, with labels that never cover each other.

The picture has a legend, doors with their ids and a scale bar; y points up as in the map. Shades
stand for costs (`palette`). A door's state shows in its stroke as well as its colour: closed is a
thick line, open a thin one in a wide gap, unknown is dashed.
"""

from __future__ import annotations

import io
import math
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, INSCRIBED, LETHAL, NO_INFORMATION
from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.core.model.doors import DoorState, reduced
from semmap_log.errors import CostmapError
from semmap_log.views.event_words import MOST_DRAWN
from semmap_log.views.palette import COST_DOORS, COST_INK, Grid, Rgb, costs_of, shaded

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont, ImageFont


SIDE_PX = 1400
"""How long the map's longer side is drawn, where its cells allow."""
MOST_PX = 2000
MOST_PX_A_CELL = 64
MARGIN_PX = 64
"""Around the map: the title, and metres."""
LEAST_HEIGHT_PX = 520
"""Room for the legend."""
TICKS_EVERY_PX = 90
LABEL_PX = 13
MOST_LABEL_PX = 240
MOST_COLUMNS = 3
"""Columns of names, next to the legend."""
MOST_NAMES = 40
"""With more doors, names would hide the map; they then stand next to it."""
STROKE_PX = 10


@dataclass(frozen=True, slots=True)
class DoorMark:
    """A door to be drawn: its line in metres, frame `map`."""

    door_id: int
    name: str | None
    x0: float
    y0: float
    x1: float
    y1: float
    state: DoorState


def costmap_png(
    grid: Grid, geometry: GridGeometry, doors: Sequence[DoorMark] = (), *, title: str = ""
) -> bytes:
    """Return a PNG; the same bytes for the same arguments.

    Its sides are below 3,200 pixels: a larger grid shows the greatest cost of each block.

    Args:
        grid: uint8 costs, or int8 map values; (height, width), row 0 at the lowest y.
        geometry: Where the cells lie.
        doors: Drawn on top, with their labels, and clipped to the map.
        title: One line, such as the subject and the moment.

    Raises:
        CostmapError: The grid has another shape than its geometry.
    """
    from PIL import Image, ImageDraw

    expected = (geometry.height, geometry.width)
    if grid.shape != expected:
        raise CostmapError(f"a costmap's picture: expected cells {expected}, got {grid.shape}")
    scale = _scale(geometry)
    cells = Image.fromarray(shaded(costs_of(grid), scale))
    view = _View(geometry, scale if scale > 0 else -1 / scale, *cells.size)
    notes = [f"{geometry.width:,} x {geometry.height:,} cells of {geometry.resolution:.4g} m"]
    notes += _draw_doors(ImageDraw.Draw(cells), view, doors)
    below_legend, beside = _columns(notes, view)
    canvas = Image.new("RGB", view.canvas_size(len(beside)), "white")
    canvas.paste(cells, (MARGIN_PX, MARGIN_PX))
    draw = ImageDraw.Draw(canvas)
    _draw_frame(draw, view)
    room = canvas.width - MARGIN_PX - 12
    head = fitted(draw, drawable(title or "costmap"), room, 20)
    draw.text((MARGIN_PX, 14), head, COST_INK, font(20))
    x = MARGIN_PX + view.width + MARGIN_PX // 2
    draw_legend(canvas, (x, MARGIN_PX), below_legend, px_a_metre=view.px_a_metre)
    for column in beside:
        x += LEGEND_PX
        draw_notes(draw, (x, MARGIN_PX), column)
    file = io.BytesIO()
    canvas.save(file, "PNG", compress_level=9)
    return file.getvalue()


def _scale(geometry: GridGeometry) -> int:
    """Return pixels per cell; or, if negative, cells per pixel."""
    longest = max(geometry.width, geometry.height)
    if longest > MOST_PX:
        return -math.ceil(longest / MOST_PX)
    return max(1, min(MOST_PX_A_CELL, SIDE_PX // longest))


@dataclass(frozen=True, slots=True)
class _View:
    """Where metres are in the picture of the map; its size in pixels."""

    geometry: GridGeometry
    px_a_cell: float
    width: int
    height: int

    @property
    def px_a_metre(self) -> float:
        return self.px_a_cell / self.geometry.resolution

    @property
    def canvas_height(self) -> int:
        return max(self.height + 2 * MARGIN_PX, LEAST_HEIGHT_PX)

    def canvas_size(self, columns: int) -> tuple[int, int]:
        """Return (width, height) with so many columns of notes next to the legend."""
        beside = LEGEND_PX * (1 + columns)
        return MARGIN_PX + self.width + MARGIN_PX // 2 + beside, self.canvas_height

    def at(self, x: float, y: float) -> Point:
        """Return the pixel of a place: from the map's upper left corner, y down."""
        return (
            (x - self.geometry.origin_x) * self.px_a_metre,
            self.height - (y - self.geometry.origin_y) * self.px_a_metre,
        )

    def clipped(self, start: Point, end: Point) -> tuple[Point, Point] | None:
        """Return the part of a line on the map, with a stroke's width to spare, or None."""
        first, last = 0.0, 1.0
        for a, b, most in zip(start, end, (self.width, self.height), strict=True):
            if not (math.isfinite(a) and math.isfinite(b - a)):
                return None
            low, high = -STROKE_PX - a, most + STROKE_PX - a
            if a == b:
                if low > 0 or high < 0:
                    return None
                continue
            enter, leave = sorted((low / (b - a), high / (b - a)))
            first, last = max(first, enter), min(last, leave)
        if first > last:
            return None
        (x0, y0), (x1, y1) = start, end
        across, down = x1 - x0, y1 - y0
        return (
            (x0 + first * across, y0 + first * down),
            (x0 + last * across, y0 + last * down),
        )


def _draw_frame(draw: ImageDraw, view: _View) -> None:
    """Draw the map's edge and its metres: x to the right, y up."""
    left, top = MARGIN_PX, MARGIN_PX
    right, bottom = left + view.width, top + view.height
    small, geometry = font(12), view.geometry
    draw.rectangle((left - 1, top - 1, right, bottom), outline=COST_INK)
    for value, label in _ticks(geometry.origin_x, view.width, view.px_a_metre):
        x = left + view.at(value, 0)[0]
        draw.line((x, bottom, x, bottom + 5), COST_INK)
        draw.text((x, bottom + 8), label, COST_INK, small, anchor="mt")
    for value, label in _ticks(geometry.origin_y, view.height, view.px_a_metre):
        y = top + view.at(0, value)[1]
        draw.line((left - 6, y, left - 1, y), COST_INK)
        draw.text((left - 9, y), label, COST_INK, small, anchor="rm")
    draw.text((left + view.width / 2, bottom + 28), "x, metres", COST_INK, small, anchor="mt")
    draw.text((left - 9, top - 10), "y, metres", COST_INK, small, anchor="rb")


def _ticks(start: float, length_px: int, px_a_metre: float) -> list[tuple[float, str]]:
    """Return round metres along an edge, not too close to each other, and their texts."""
    step = round_length(TICKS_EVERY_PX / px_a_metre)
    if not abs(start / step) < 1e15:
        return []  # So far from the frame's origin that its metres look alike.
    first = math.ceil(start / step)
    last = math.floor((start + length_px / px_a_metre) / step)
    return [(n * step, f"{n * step:.12g}") for n in range(first, last + 1)]


def _draw_doors(draw: ImageDraw, view: _View, doors: Sequence[DoorMark]) -> list[str]:
    """Draw the doors that are on the map, then their labels, so that no stroke hides a number.

    Returns:
        The labels that did not fit on the map: names of doors that only have their number there.
    """
    lines = []
    for door in doors:
        seen = view.clipped(view.at(door.x0, door.y0), view.at(door.x1, door.y1))
        if seen is not None:
            lines.append((door, *seen))
    places = LabelPlaces(view.width, view.height)
    for door, start, end in lines:
        draw_door(draw, start, end, reduced(door.state))
        places.keep_clear(start, end, margin=6)
    named = len(lines) <= MOST_NAMES
    left_out = [
        _full_label(door)
        for door, start, end in lines
        if not _draw_label(draw, places, door, (start, end), named=named)
    ]
    lacking = [str(door.door_id) for door, *_ in lines if lacks_letters(door.name or "")]
    if lacking:
        left_out.append(f"no letters for the names of {', '.join(lacking)}")
    return ["", *left_out] if left_out else []


def _full_label(door: DoorMark) -> str:
    """Return a door's number and its name; without the name where letters of it are missing."""
    name = (door.name or "")[:MOST_DRAWN]
    return drawable(f"{door.door_id} {'' if lacks_letters(name) else name}".rstrip())


def _draw_label(
    draw: ImageDraw, places: LabelPlaces, door: DoorMark, line: tuple[Point, Point], *, named: bool
) -> bool:
    """Draw a door's number, and its name if there is room; return whether both were drawn."""
    (x0, y0), (x1, y1) = line
    middle = (x0 + x1) / 2, (y0 + y1) / 2
    across = math.atan2(y1 - y0, x1 - x0) + math.pi / 2
    number = str(door.door_id)
    full = _full_label(door)
    tries = [(full, NEAR_PX)] if named else []
    for text, distances in [*tries, (number, NEAR_PX + FAR_PX)]:
        said = fitted(draw, text, MOST_LABEL_PX, LABEL_PX)
        size = (math.ceil(draw.textlength(said, font(LABEL_PX))) + 8, LABEL_PX + 5)
        box = places.place(middle, size, across=across, distances=distances)
        if box is not None:
            _draw_box(draw, box, said, middle, COST_DOORS[reduced(door.state)])
            return said == full
    return False


def _draw_box(draw: ImageDraw, box: Box, text: str, middle: Point, colour: Rgb) -> None:
    """Draw a label, and a line to its door if it is not next to it."""
    left, top, right, bottom = box
    nearest = min(max(middle[0], left), right), min(max(middle[1], top), bottom)
    if math.dist(middle, nearest) > NEAR_PX[-1] + 4:
        draw.line((*middle, *nearest), colour, 1)
    draw.rounded_rectangle((left, top, right - 1, bottom - 1), 3, "white", (150, 150, 156))
    draw.text(((left + right) / 2, (top + bottom) / 2), text, COST_INK, font(LABEL_PX), anchor="mm")


def _columns(notes: list[str], view: _View) -> tuple[list[str], list[list[str]]]:
    """Return the notes below the legend, and columns of those that have no room there."""
    rows = (view.canvas_height - 2 * MARGIN_PX) // NOTE_PX
    below = max(1, (view.canvas_height - MARGIN_PX - NOTES_BELOW_PX) // NOTE_PX)
    room = below + MOST_COLUMNS * rows
    if len(notes) > room:
        notes = [*notes[: room - 1], f"and {len(notes) - room + 1} more"]
    rest = notes[below:]
    return notes[:below], [rest[n : n + rows] for n in range(0, len(rest), rows)]


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
    """Return whether a letter or a digit would become a question mark."""
    return any(c.isalnum() and not _has_shape(c) and _plain(c) == "?" for c in text)


def fitted(draw: ImageDraw, text: str, room_px: float, size: int) -> str:
    """Return as much of a drawable text as has room."""
    if len(text) > room_px:  # no letter is narrower than a pixel
        text = text[: int(room_px)] + "..."
    while len(text) > 3 and draw.textlength(text, font(size)) > room_px:
        text = text.removesuffix("...")[:-1].rstrip() + "..."
    return text


def _plain(character: str) -> str:
    base = unicodedata.normalize("NFKD", character)[0]
    return base if _has_shape(base) else "?"


@lru_cache(1024)
def _has_shape(character: str) -> bool:
    """Return whether the font has a shape of its own for a character."""
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
    """Return a sample of a cost; None: of all inflation costs, increasing to the right."""
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


NEAR_PX = (5, 12)
FAR_PX = (20, 32, 48, 70, 100)
DIRECTIONS = 16

Point = tuple[float, float]
"""(x, y), pixels, y down."""
Box = tuple[int, int, int, int]
"""Left, top, right, bottom: pixels left <= x < right, top <= y < bottom."""


class LabelPlaces:
    """Assigns places in a picture, one label after the other: near ones first."""

    def __init__(self, width: int, height: int) -> None:
        self._taken = np.zeros((height, width), np.bool_)

    def keep_clear(self, start: Point, end: Point, *, margin: int) -> None:
        """Keep labels at least `margin` pixels away from a line."""
        steps = max(1, math.ceil(math.dist(start, end) / max(1, margin)))
        for share in np.linspace(0, 1, steps + 1):
            x, y = (int(a + share * (b - a)) for a, b in zip(start, end, strict=True))
            self._taken[max(0, y - margin) : max(0, y + margin + 1),
                        max(0, x - margin) : max(0, x + margin + 1)] = True  # fmt: skip

    def place(
        self, at: Point, size: tuple[int, int], *, across: float, distances: tuple[int, ...]
    ) -> Box | None:
        """Reserve a free place for a label, and return it.

        Args:
            at: The point to label.
            size: (width, height) of the label.
            across: The first direction to try, then its opposite; radians, y down.
            distances: The distances to try in order, pixels.

        Returns:
            The nearest place that is free; None where there is none.
        """
        for distance in distances:
            for angle in _turns(across):
                box = _next_to(at, size, distance, angle)
                if self._is_free(box):
                    left, top, right, bottom = box
                    self._taken[top:bottom, left:right] = True
                    return box
        return None

    def _is_free(self, box: Box) -> bool:
        left, top, right, bottom = box
        height, width = self._taken.shape
        inside = left >= 0 and top >= 0 and right <= width and bottom <= height
        return inside and not self._taken[top:bottom, left:right].any()


def _turns(across: float) -> list[float]:
    """Return directions all around: both sides first, then increasingly far from these."""
    quarter = DIRECTIONS // 4
    aside = [0, *(sign * step for step in range(1, quarter + 1) for sign in (1, -1))]
    return [
        across + side + step * 2 * math.pi / DIRECTIONS for step in aside for side in (0, math.pi)
    ]


def _next_to(at: Point, size: tuple[int, int], distance: float, angle: float) -> Box:
    """Return the label's box, so that its edge is that far from the point in that direction."""
    (x, y), (width, height) = at, size
    cos, sin = math.cos(angle), math.sin(angle)
    # How far the box reaches from its middle toward the point.
    reach = min(
        width / 2 / abs(cos) if abs(cos) > 1e-9 else math.inf,
        height / 2 / abs(sin) if abs(sin) > 1e-9 else math.inf,
    )
    left = round(x + (distance + reach) * cos - width / 2)
    top = round(y + (distance + reach) * sin - height / 2)
    return left, top, left + width, top + height


def without_level(name: str, level: str) -> str:
    """Return a door's name without its level prefix, which the plan already shows."""
    return name.removeprefix(level).lstrip(" ._-:/") or name
