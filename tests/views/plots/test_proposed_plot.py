"""Pictures of proposed doors: how much of the building they show."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.views.plots.proposed_doors import AROUND_EDGE_M, Floats, extent_of

ROOM = np.stack(np.meshgrid(np.linspace(0, 10, 50), np.linspace(0, 6, 40)), axis=-1).reshape(-1, 2)


def test_a_building_fills_its_picture_though_some_beams_went_far() -> None:
    """Through a window, or a mirror."""
    far = np.array([[80.0, 90.0], [-70.0, 3.0], [5.0, -60.0]])

    shown = extent_of(np.concatenate([ROOM, far]), None, [])

    np.testing.assert_allclose(
        shown, [[-AROUND_EDGE_M] * 2, [10 + AROUND_EDGE_M, 6 + AROUND_EDGE_M]], atol=0.2
    )


@pytest.mark.parametrize("walls", [None, np.array([[-5.0, 2.0], [3.0, 9.0]])])
def test_walls_and_proposed_doors_are_shown_whole(walls: Floats | None) -> None:
    """Wherever few beams ended."""
    lower, upper = extent_of(ROOM, walls, [(14.5, 3.0)])

    assert upper[0] >= 14.5
    assert walls is None or (lower[0] < -5 and upper[1] > 9)
