"""Colours: every state has one, and no two that matter are alike."""

from __future__ import annotations

from itertools import combinations

import pytest

from semmap_log.doors import DoorState
from semmap_log.views.palette import COLOUR_BLIND, DEFAULT, PALETTES, Palette, Rgb, packed

BLACK, WHITE = (13, 13, 13), (255, 255, 255)
"""The viewer's text on its two themes lies on these."""


def contrast(one: Rgb, other: Rgb) -> float:
    """Contrast ratio of WCAG 2: 1 (none) to 21."""
    light, dark = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def _luminance(colour: Rgb) -> float:
    parts = [c / 255 / 12.92 if c <= 10 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in colour]
    return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]


@pytest.mark.parametrize("palette", PALETTES.values(), ids=PALETTES)
def test_what_is_no_open_or_closed_draws_as_unknown(palette: Palette) -> None:
    """
    MOVING and OFFLINE have no colour of their own.
    """
    for state in (DoorState.UNKNOWN, DoorState.MOVING, DoorState.OFFLINE):
        assert palette.unknown == palette.of_state(state)
    assert (palette.open, palette.closed) == (
        palette.of_state(DoorState.OPEN), palette.of_state(DoorState.CLOSED)
    )  # fmt: skip


@pytest.mark.parametrize("palette", PALETTES.values(), ids=PALETTES)
def test_everything_can_be_seen(palette: Palette) -> None:
    """
    On the plan all stands out (3:1, as WCAG asks of graphics), and text does on both themes.
    """
    for drawn in (palette.open, palette.closed, palette.unknown, palette.robot, palette.wall):
        assert contrast(drawn, palette.floor) >= 3
    for state in (None, *DoorState):
        assert contrast(palette.text_of_state(state), WHITE) >= 3
        assert contrast(palette.text_of_state(state), BLACK) >= 3


def test_the_colour_blind_palette_is_told_apart_without_red_and_green() -> None:
    """
    To who sees no difference of red and green (the mean of both stands for them), the states
    still differ in blue or in brightness.
    """
    states = (COLOUR_BLIND.open, COLOUR_BLIND.closed, COLOUR_BLIND.unknown)

    for one, other in combinations(states, 2):
        (a, b), (c, d) = (((r + g) / 2, blue) for r, g, blue in (one, other))
        assert max(abs(a - c), abs(b - d)) > 60


def test_packed_is_what_rerun_takes() -> None:
    """
    0xRRGGBBAA.
    """
    assert 0x35C98BFF == packed(DEFAULT.open)
    assert 0x35C98B10 == packed(DEFAULT.open, 0x10)
