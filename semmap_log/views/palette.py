"""Every colour of the views, in one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from semmap_log.domain.doors import DoorState, reduced

Rgb = tuple[int, int, int]


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


def packed(colour: Rgb, alpha: int = 255) -> int:
    """Return the colour as 0xRRGGBBAA."""
    red, green, blue = colour
    return red << 24 | green << 16 | blue << 8 | alpha
