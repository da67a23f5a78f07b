"""Figures as files."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("matplotlib", reason="not installed: pip install 'semmap-log[plots]'")

from PIL import Image

from semmap_log.views.plots.figures import DPI, MOST_PIXELS, new_figure, save_figure


def test_a_figure_beyond_what_matplotlib_draws_is_drawn_smaller(tmp_path: Path) -> None:
    """Four thousand lanes are higher than a picture may be: with fewer pixels an inch they fit."""
    inches = 1.5 * MOST_PIXELS / DPI

    save_figure(new_figure(1, inches), tmp_path / "x.png")

    with Image.open(tmp_path / "x.png") as picture:
        assert 0.9 * MOST_PIXELS < picture.height <= MOST_PIXELS
