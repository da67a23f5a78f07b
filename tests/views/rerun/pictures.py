"""Pictures of the viewer, and what is in them; where there is none, the test is skipped, loudly."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semmap_log.errors import ViewerError
from semmap_log.views.palette import Rgb
from semmap_log.views.rerun.process import Viewer, headless


@contextmanager
def a_viewer(source: Path | str | None, **how: Any) -> Iterator[Viewer]:
    """A viewer without a window; without a graphics driver the pictures are skipped, loudly."""
    try:
        with headless(source, **how) as viewer:
            viewer.state()
            yield viewer
    except ViewerError as error:
        if "mesa-vulkan-drivers" not in str(error):
            raise
        warnings.warn(f"NO PICTURE WAS CHECKED: {error}", stacklevel=1)
        pytest.skip(str(error))


def colours_of(png: bytes) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def is_colour(png: bytes, colour: Rgb) -> np.ndarray:
    distance: np.ndarray = np.abs(colours_of(png).astype(int) - colour).max(-1)
    return distance <= 6


def has_colour(png: bytes, colour: Rgb) -> bool:
    """Tell whether something is drawn in that colour, rather than a few pixels by chance."""
    return int(is_colour(png, colour).sum()) > 50


def middle_of(png: bytes, colour: Rgb) -> tuple[float, float]:
    rows, columns = np.nonzero(is_colour(png, colour))
    return float(columns.mean()), float(rows.mean())
