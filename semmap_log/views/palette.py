"""Every colour that is drawn, in one place; the report's page has its own paper in `page.css`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from semmap_log.core.model.doors import DoorState, reduced

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
    """Of a line about no state: grey enough for white and for black."""

    def of_state(self, state: DoorState) -> Rgb:
        """Return what a door in that state is drawn with; MOVING and OFFLINE draw as unknown."""
        return self._by_state((self.unknown, self.open, self.closed), state)

    def text_of_state(self, state: DoorState | None) -> Rgb:
        """Return the colour of a line of text about that state, or about none."""
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
"""After Okabe and Ito, who chose colours that colour-blind eyes tell apart."""
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
"""Of rooms, pale, so that doors stand out; rooms beside each other get different ones."""
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
