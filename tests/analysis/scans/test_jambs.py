"""Jambs: where a wall begins, however blurred what beams ended on is."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.scans.proposing.jambs import LEAST_ENDS, jamb

CELL_M = 0.05


def _ends(wall_m: float, blur_m: float, face: float, count: int = 4000) -> tuple[np.ndarray, ...]:
    """Return cells' places and how many ended there: a wall of 1 m, and the face of its jamb."""
    rng = np.random.default_rng(7)
    on_wall = wall_m + rng.random(count)
    on_face = np.full(round(face * count), wall_m)
    every = np.concatenate([on_wall, on_face])
    every = every + rng.normal(0, blur_m, len(every))
    edges = np.arange(-0.4, 0.8, CELL_M)
    return edges[:-1] + CELL_M / 2, np.histogram(every, edges)[0].astype(float)


@pytest.mark.parametrize("wall_m", [-0.04, 0.0, 0.07, 0.15])
@pytest.mark.parametrize(
    ("blur_m", "face"),
    [(0.02, 0.0), (0.05, 0.0), (0.02, 0.1), (0.05, 0.1), (0.07, 0.3), (0.1, 0.5)],
)
def test_a_jamb_is_where_the_wall_begins_however_blurred(
    wall_m: float, blur_m: float, face: float
) -> None:
    """With and without a face towards the opening that many beams end on."""
    assert jamb(*_ends(wall_m, blur_m, face)) == pytest.approx(wall_m, abs=0.025)


def test_too_few_ends_say_nothing() -> None:
    """The gap's end stays where it is."""
    places = np.full(LEAST_ENDS - 1, 0.1)

    assert jamb(places, np.ones_like(places)) == 0.0
    assert jamb(places, 9 * np.ones_like(places)) != 0.0


def test_what_ends_far_away_is_not_of_this_jamb() -> None:
    """Furniture before the wall half a metre on, the other jamb."""
    places, ends = _ends(0.05, 0.05, 0.2)
    far = np.concatenate([places, [0.46, 0.6, -0.3]]), np.concatenate([ends, [1e6, 1e6, 1e6]])

    assert jamb(*far) == jamb(places, ends)
