"""All colours that are drawn, in one place; the report's page has its own paper in `page.css`.

Probabilities run from dark (surely closed) to bright (surely open), in matplotlib's viridis, for
all eyes and in grey; terminal, plot and viewer agree. Adjacent rooms of a level get different
tints. A costmap's shades are clear on a grey print and for colour-blind eyes: free is white,
inflation runs from pale to deep violet, inscribed is darker than all of it, lethal is black.
Unknown is hatched, as no cost is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    INSCRIBED,
    LETHAL,
    NO_INFORMATION,
    to_occupancy,
)
from semmap_log.analysis.rooms.level_rooms import LevelRooms
from semmap_log.analysis.rooms.room_graph import RoomId
from semmap_log.core.model.doors import DoorState, reduced

COLOUR_MAP = "viridis"
"""Its name in matplotlib."""


def shade(probability: float) -> Rgb:
    """Return the colour of a probability in [0, 1]."""
    anchors = np.array(VIRIDIS, np.float64)
    places = np.linspace(0.0, 1.0, len(VIRIDIS))
    red, green, blue = (
        int(np.rint(np.interp(probability, places, anchors[:, channel]))) for channel in range(3)
    )
    return red, green, blue


def ink_on(colour: Rgb) -> Rgb:
    """Return black or white, whichever is easier to read on a colour."""
    red, green, blue = colour
    return BLACK if 0.299 * red + 0.587 * green + 0.114 * blue > 128 else WHITE


ADJACENT_CELLS = 9
"""Rooms within this distance are adjacent: only a wall lies between them."""
MOST_CELLS = 4_000_000

Image = NDArray[np.uint8]


def rooms_image(rooms: LevelRooms, *, alpha: int = 255, most_cells: int = MOST_CELLS) -> Image:
    """Return the rooms in their tints: (rows, columns, RGBA), row 0 at the lowest y.

    Cells outside rooms are left out. Of a larger plan only each second, third … cell is drawn, over
    the same area.

    Args:
        rooms: The rooms of a level.
        alpha: How much a tint covers, 0..255.
        most_cells: The largest number of cells of the picture.
    """
    labels = sampled(rooms, most_cells)
    tint_of = room_tints(labels)
    colours = np.zeros((int(labels.max(initial=0)) + 1, 4), np.uint8)
    for room, tint in tint_of.items():
        colours[room] = (*ROOM_TINTS[tint], alpha)
    image: Image = colours[labels]
    return image


def sampled(rooms: LevelRooms, most_cells: int) -> NDArray[np.int64]:
    """Return the room of each cell, or of each second …: (rows, columns); 0: none."""
    grid = rooms.geometry
    stride = max(1, math.ceil(math.sqrt(grid.width * grid.height / most_cells)))
    rows = np.arange(stride // 2, grid.height, stride)
    columns = np.arange(stride // 2, grid.width, stride)
    found = rooms.room_of[rooms.regions.label_at(rows[:, None], columns[None, :])]
    return np.maximum(found, 0)


def room_tints(labels: NDArray[np.int64]) -> dict[RoomId, int]:
    """Return the number of each room's tint, for a picture of rooms."""
    beside = _next_to(labels)
    tints: dict[RoomId, int] = {}
    for room in sorted(beside):
        taken = {tints[other] for other in beside[room] if other in tints}
        free = [tint for tint in range(len(ROOM_TINTS)) if tint not in taken]
        tints[room] = free[room % len(free)] if free else room % len(ROOM_TINTS)
    return tints


def _next_to(labels: NDArray[np.int64]) -> dict[RoomId, set[RoomId]]:
    """Return the rooms adjacent to each room: a few cells away along a row or a column."""
    found: dict[RoomId, set[RoomId]] = {int(room): set() for room in np.unique(labels) if room}
    for gap in range(1, ADJACENT_CELLS + 1):
        for one, other in ((labels[gap:], labels[:-gap]), (labels[:, gap:], labels[:, :-gap])):
            differ = (one != other) & (one > 0) & (other > 0)
            pairs = np.unique(np.stack([one[differ], other[differ]]), axis=1)
            for a, b in pairs.T.tolist():
                found[a].add(b)
                found[b].add(a)
    return found


Grid = NDArray[np.uint8] | NDArray[np.int8]

HATCH_PX = 8
LEVELS = 24
"""Of the violet: as many as an eye can distinguish, few enough that the file stays small."""


def costs_of(grid: Grid) -> NDArray[np.uint8]:
    """Return the grid as costs; map values (int8) as the least cost that is published as such.

    An invalid map value (below -1, above 100) is lethal, as in the static layer.
    """
    if grid.dtype == np.uint8:
        return np.asarray(grid, np.uint8)
    published = to_occupancy(np.arange(256, dtype=np.uint8)).view(np.uint8)
    table = np.full(256, LETHAL, np.uint8)
    table[published[::-1]] = np.arange(255, -1, -1, dtype=np.uint8)
    costs: NDArray[np.uint8] = table[grid.view(np.uint8)]
    return costs


def shaded(costs: NDArray[np.uint8], scale: int) -> NDArray[np.uint8]:
    """Return the cells as a picture, its top row first.

    Args:
        costs: (height, width), row 0 at the lowest y.
        scale: Pixels per cell; or, if negative, cells per pixel: their greatest cost shows, so that
            no wall and no door is lost.

    Returns:
        uint8, (rows, columns, 3).
    """
    if scale < 0:
        costs = _dearest(costs, -scale)
    picture = _shades()[costs[::-1]]
    if scale > 1:
        picture = picture.repeat(scale, axis=0).repeat(scale, axis=1)
        costs = costs.repeat(scale, axis=0).repeat(scale, axis=1)
    rows, columns = picture.shape[:2]
    diagonal = np.add.outer(np.arange(rows), np.arange(columns)) % HATCH_PX < HATCH_PX // 4
    picture[(costs[::-1] == NO_INFORMATION) & diagonal] = COST_HATCH
    return picture


def _dearest(costs: NDArray[np.uint8], cells: int) -> NDArray[np.uint8]:
    """Return one cost for each block of cells; beyond the edge it is unknown."""
    height, width = costs.shape
    # Unknown is the least of all: a block that knows anything shows it.
    ranked = costs + np.uint8(1)
    rows = np.maximum.reduceat(ranked, np.arange(0, height, cells), axis=0)
    blocks = np.maximum.reduceat(rows, np.arange(0, width, cells), axis=1)
    least: NDArray[np.uint8] = np.subtract(blocks, 1, dtype=np.uint8)
    return least


def _shades() -> NDArray[np.uint8]:
    """Return the colour of each cost, (256, 3)."""
    costs = np.arange(256)
    share = (costs - 1) * LEVELS // 252 / (LEVELS - 1)
    least, most = np.array(COST_LEAST), np.array(COST_MOST)
    table: NDArray[np.float64] = np.rint(least + np.clip(share, 0, 1)[:, None] * (most - least))
    for cost, colour in (
        (FREE_SPACE, COST_FREE),
        (INSCRIBED, COST_INSCRIBED),
        (LETHAL, COST_LETHAL),
        (NO_INFORMATION, COST_UNKNOWN),
    ):
        table[cost] = colour
    return table.astype(np.uint8)


Rgb = tuple[int, int, int]

BLACK: Rgb = (0, 0, 0)
WHITE: Rgb = (255, 255, 255)


@dataclass(frozen=True, slots=True)
class Palette:
    """Colours that must read on a dark floor plan, in lanes, curves and text, in both themes."""

    open: Rgb
    closed: Rgb
    unknown: Rgb
    open_text: Rgb
    """As `open`, with enough contrast for small letters on white and on black."""
    closed_text: Rgb
    unknown_text: Rgb
    robot: Rgb
    background: Rgb = (18, 20, 26)
    """Around the plan, and where it is unknown; set, so that the light theme keeps it dark."""
    floor: Rgb = (41, 46, 57)
    wall: Rgb = (150, 160, 176)
    label: Rgb = (255, 255, 255)
    """Of names on the plan: in the viewer, on a chip that is dark or grey, as the theme has it."""
    plain_text: Rgb = (0x8A, 0x90, 0x9C)
    """Of a line without a state: a grey for white and black backgrounds."""

    def of_state(self, state: DoorState) -> Rgb:
        """Return the colour of a door in a state; MOVING and OFFLINE have that of unknown."""
        return self._by_state((self.unknown, self.open, self.closed), state)

    def text_of_state(self, state: DoorState | None) -> Rgb:
        """Return the colour of a line of text about a state, or without one."""
        if state is None:
            return self.plain_text
        return self._by_state((self.unknown_text, self.open_text, self.closed_text), state)

    @staticmethod
    def _by_state(colours: tuple[Rgb, Rgb, Rgb], state: DoorState) -> Rgb:
        return colours[reduced(state)]


DEFAULT = Palette(
    open=(0x35, 0xC9, 0x8B),
    closed=(0xF0, 0x52, 0x5A),
    unknown=(0xF5, 0xB8, 0x3D),
    open_text=(0x1F, 0xA9, 0x71),
    closed_text=(0xE5, 0x48, 0x4D),
    unknown_text=(0xBD, 0x82, 0x10),
    robot=(0x4C, 0xC2, 0xFF),
)

COLOUR_BLIND = Palette(
    open=(0x56, 0xB4, 0xE9),
    closed=(0xE6, 0x6B, 0x00),
    unknown=(0xF0, 0xE4, 0x42),
    open_text=(0x1C, 0x8A, 0xC9),
    closed_text=(0xDD, 0x77, 0x00),
    unknown_text=(0x77, 0x66, 0x33),
    robot=(0x99, 0x66, 0xFF),
)
"""After Okabe and Ito, with a robot that keeps away from the door's colours, too: what protan,
deutan and tritan eyes see of them is worked out in tests/views/test_palette.py."""

PALETTES: Mapping[str, Palette] = {"default": DEFAULT, "colour-blind": COLOUR_BLIND}


VIRIDIS: tuple[Rgb, ...] = (
    (68, 1, 84), (72, 24, 106), (71, 45, 123), (66, 64, 134), (59, 82, 139), (51, 99, 141),
    (44, 114, 142), (38, 130, 142), (33, 145, 140), (31, 160, 136), (40, 174, 128), (63, 188, 115),
    (94, 201, 98), (132, 212, 75), (173, 220, 48), (216, 226, 25), (253, 231, 37),
)  # fmt: skip
"""Of probabilities: matplotlib's colours, evenly spaced from 0 to 1."""

COST_FREE: Rgb = (255, 255, 255)
COST_LEAST: Rgb = (236, 230, 250)
COST_MOST: Rgb = (150, 110, 200)
COST_INSCRIBED: Rgb = (86, 48, 140)
COST_LETHAL: Rgb = (16, 16, 20)
COST_UNKNOWN: Rgb = (228, 230, 233)
COST_HATCH: Rgb = (200, 204, 209)

COST_INK: Rgb = (40, 40, 46)
COST_DOORS: dict[DoorState, Rgb] = {
    DoorState.CLOSED: (0xD5, 0x5E, 0x00),
    DoorState.OPEN: (0x00, 0x72, 0xB2),
    DoorState.UNKNOWN: (0x80, 0x60, 0x00),
}
"""After Okabe and Ito, who chose colours that colour-blind eyes can distinguish."""
WEEK_UNKNOWN: Rgb = (70, 74, 82)
WEEK_AXES: Rgb = (225, 228, 233)

PLOT_CURVE = "#31688e"
PLOT_GRID = "#cccccc"
PLOT_BARS = "#b8b8c4"
PLOT_MARKS = "#555560"
PLOT_HATCH = "#9a9a9a"
PLOT_NOTHING = "#f0f0f0"
PLOT_WORDS = "#444444"
PLOT_PROPOSED = "#c2185b"
PLOT_WALLS = "#222222"

ROOM_TINTS: tuple[Rgb, ...] = (
    (0x8D, 0xB7, 0xE0), (0xE3, 0xC7, 0x8A), (0x9F, 0xCF, 0xB0), (0xD0, 0xA9, 0xD6),
    (0xE0, 0xA6, 0x9E), (0xA9, 0xC9, 0xCF), (0xC9, 0xCC, 0x95), (0xB5, 0xB0, 0xE3),
)  # fmt: skip
"""Of rooms, pale, so that doors stand out; adjacent rooms get different ones."""
PLOT_ROOM_NAME = "#333333"
PLOT_LIFT = "#7a3fa0"

BEAM_SHORT: Rgb = (0xB0, 0x8A, 0xE0)
"""Of where beams ended before a door's line, on a dark plan: the colour of no state."""
PLOT_BEAM = "#9aa0ac"
PLOT_BEAM_ASIDE = "#b9bcc4"
PLOT_BEAM_SHORT = "#8a5fb0"
PLOT_BEAM_LOST = "#555560"
PLOT_LEAF = "#777777"
"""Of no state, in a key."""


def packed(colour: Rgb, alpha: int = 255) -> int:
    """Return the colour as 0xRRGGBBAA."""
    red, green, blue = colour
    return red << 24 | green << 16 | blue << 8 | alpha
