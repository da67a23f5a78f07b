"""Probabilities as colours: dark is surely closed, bright surely open, for all eyes and in grey.

The colours are those of matplotlib's viridis, so that terminal, plot and viewer agree.
"""

from __future__ import annotations

import numpy as np

from semmap_log.views.palette import Rgb

COLOUR_MAP = "viridis"
"""What matplotlib calls it."""

ANCHORS = np.array([
    (68, 1, 84), (72, 24, 106), (71, 45, 123), (66, 64, 134), (59, 82, 139), (51, 99, 141),
    (44, 114, 142), (38, 130, 142), (33, 145, 140), (31, 160, 136), (40, 174, 128), (63, 188, 115),
    (94, 201, 98), (132, 212, 75), (173, 220, 48), (216, 226, 25), (253, 231, 37),
], np.float64)  # fmt: skip
"""Evenly spaced from 0 to 1."""

BLACK: Rgb = (0, 0, 0)
WHITE: Rgb = (255, 255, 255)


def shade(probability: float) -> Rgb:
    """Return the colour of a probability in [0, 1]."""
    places = np.linspace(0.0, 1.0, len(ANCHORS))
    red, green, blue = (
        int(np.rint(np.interp(probability, places, ANCHORS[:, channel]))) for channel in range(3)
    )
    return red, green, blue


def ink_on(colour: Rgb) -> Rgb:
    """Return black or white, whichever is easier to read on a colour."""
    red, green, blue = colour
    return BLACK if 0.299 * red + 0.587 * green + 0.114 * blue > 128 else WHITE
