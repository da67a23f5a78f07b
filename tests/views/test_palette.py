"""Colours: every state has one, and no two that matter are alike."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from semmap_log.core.model.doors import DoorState
from semmap_log.views.palette import COLOUR_BLIND, DEFAULT, PALETTES, Palette, Rgb, packed

BLACK, WHITE = (13, 13, 13), (255, 255, 255)
"""The viewer's text on its two themes lies on these."""

LIGHT_CHIP = (132, 135, 140)
"""Behind a name on the plan in the light theme, as measured in a picture; the dark theme's is
darker than the floor."""

EYES = {
    "every": np.eye(3),
    "protan": np.array([
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ]),
    "deutan": np.array([
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ]),
    "tritan": np.array([
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ]),
}  # fmt: skip
"""What eyes without one kind of cone see of linear RGB: Machado, Oliveira and Fernandes, A
Physiologically-based Model for Simulation of Color Vision Deficiency (2009), severity 1."""

XYZ_OF_RGB = np.array([
    [0.4124564, 0.3575761, 0.1804375],
    [0.2126729, 0.7151522, 0.0721750],
    [0.0193339, 0.1191920, 0.9503041],
])  # fmt: skip
"""Of sRGB, whose white is D65."""


def contrast(one: Rgb, other: Rgb) -> float:
    """Contrast ratio of WCAG 2: 1 (none) to 21."""
    light, dark = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def _luminance(colour: Rgb) -> float:
    parts = [c / 255 / 12.92 if c <= 10 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in colour]
    return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]


@pytest.mark.parametrize("palette", PALETTES.values(), ids=PALETTES)
def test_what_is_no_open_or_closed_draws_as_unknown(palette: Palette) -> None:
    """MOVING and OFFLINE have no colour of their own."""
    for state in (DoorState.UNKNOWN, DoorState.MOVING, DoorState.OFFLINE):
        assert palette.unknown == palette.of_state(state)
    assert (palette.open, palette.closed) == (
        palette.of_state(DoorState.OPEN), palette.of_state(DoorState.CLOSED)
    )  # fmt: skip


@pytest.mark.parametrize("palette", PALETTES.values(), ids=PALETTES)
def test_everything_can_be_seen(palette: Palette) -> None:
    """On the plan all stands out (3:1, as WCAG asks of graphics), and text does on both themes."""
    for chip in (LIGHT_CHIP, palette.floor):
        assert contrast(palette.label, chip) >= 3
    for drawn in (palette.open, palette.closed, palette.unknown, palette.robot, palette.wall):
        assert contrast(drawn, palette.floor) >= 3
    for state in (None, *DoorState):
        assert contrast(palette.text_of_state(state), WHITE) >= 3
        assert contrast(palette.text_of_state(state), BLACK) >= 3


@pytest.mark.parametrize("eye", EYES)
def test_the_colour_blind_palette_stays_apart_for_every_eye(eye: str) -> None:
    """Open, closed, unknown and the robot; of small letters, the three states."""
    drawn = (COLOUR_BLIND.open, COLOUR_BLIND.closed, COLOUR_BLIND.unknown, COLOUR_BLIND.robot)
    written = (COLOUR_BLIND.open_text, COLOUR_BLIND.closed_text, COLOUR_BLIND.unknown_text)

    assert min(_apart(one, other, eye) for one, other in combinations(drawn, 2)) > 25
    assert min(_apart(one, other, eye) for one, other in combinations(written, 2)) > 25


def test_the_default_palette_is_not_for_every_eye() -> None:
    """Its green and red are nearer to each other for a deutan eye."""
    assert _apart(DEFAULT.open, DEFAULT.closed, "deutan") < 25
    assert _apart(DEFAULT.open, DEFAULT.closed, "every") > 100


def _apart(one: Rgb, other: Rgb, eye: str) -> float:
    """How different an eye sees two colours: CIE 1976; 2 can just be told apart, side by side."""
    return float(np.linalg.norm(_lab(EYES[eye] @ _linear(one)) - _lab(EYES[eye] @ _linear(other))))


def _linear(colour: Rgb) -> np.ndarray:
    parts = np.array(colour) / 255
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def _lab(linear: np.ndarray) -> np.ndarray:
    white = XYZ_OF_RGB.sum(axis=1)
    parts = XYZ_OF_RGB @ np.clip(linear, 0, 1) / white
    x, y, z = np.where(parts > 0.008856, np.cbrt(parts), 7.787 * parts + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_packed_is_what_rerun_takes() -> None:
    assert 0x35C98BFF == packed(DEFAULT.open)
    assert 0x35C98B10 == packed(DEFAULT.open, 0x10)
