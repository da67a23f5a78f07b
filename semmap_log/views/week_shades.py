"""Probabilities as colours: dark is surely closed, bright surely open, for all eyes and in grey.

The colours are those of matplotlib's viridis, so that terminal, plot and viewer agree.
"""

from __future__ import annotations

import numpy as np

from semmap_log.views.palette import BLACK, VIRIDIS, WHITE, Rgb

COLOUR_MAP = "viridis"
"""What matplotlib calls it."""


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
