"""A gap's own wall: found in a direction in which many walls run, turned into its own."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

from semmap_log.analysis.scans.proposing.wall_directions import along_their_walls
from semmap_log.analysis.scans.proposing.wall_gaps import CELL_M, Gaps

WIDTH_M = 0.9


def _wall(angle_deg: float, length_m: float = 3.5) -> np.ndarray:
    """Return cells of a wall through (2, 1), but for a gap there: (n, 2) m."""
    along = np.arange(WIDTH_M / 2, WIDTH_M / 2 + length_m, CELL_M)
    along = np.concatenate([-along, along])
    ahead = np.array([np.cos(radians(angle_deg)), np.sin(radians(angle_deg))])
    return np.floor((np.array([2.0, 1.0]) + along[:, None] * ahead) / CELL_M) * CELL_M + CELL_M / 2


def _gap(angle_deg: float, along: float = 0.3) -> Gaps:
    """Return a gap about (2, 1), as if found in that direction."""
    turn = radians(angle_deg)
    start = 2 - WIDTH_M / 2 * np.cos(turn), 1 - WIDTH_M / 2 * np.sin(turn)
    return Gaps(np.array([[*start, turn, WIDTH_M]]), np.ones((1, 2)), np.array([along]))


@pytest.mark.parametrize("wall_deg", [0.0, 30.0, 90.0])
@pytest.mark.parametrize("off_deg", [-12.0, -7.0, 7.0, 12.0])
def test_a_gap_is_turned_into_its_wall(wall_deg: float, off_deg: float) -> None:
    """About its middle, and with all of its wall in line."""
    found = along_their_walls(_gap(wall_deg + off_deg), _wall(wall_deg))

    assert np.degrees(found.lines[0, 2]) == pytest.approx(wall_deg, abs=2.5)
    assert found.middles[0] == pytest.approx([2, 1])
    assert found.lines[0, 3] == WIDTH_M
    assert found.along[0] > 0.9


@pytest.mark.parametrize("off_deg", [0.0, 1.0])
def test_a_gap_in_line_with_its_wall_stays(off_deg: float) -> None:
    """To the bit: directions that many walls share are better known."""
    gap = _gap(30 + off_deg, along=0.97)

    found = along_their_walls(gap, _wall(30))

    assert np.array_equal(found.lines, gap.lines)
    assert np.array_equal(found.along, gap.along)


def test_a_wall_far_beside_is_not_its_own() -> None:
    """Four metres on, and a wall that is square to it."""
    gap = _gap(8)
    beyond = _wall(0, 9.0)
    beyond = beyond[np.abs(beyond[:, 0] - 2) > 4]
    square = np.column_stack([np.full(60, 4.5), np.linspace(-0.5, 2.5, 60)])

    found = along_their_walls(gap, np.concatenate([beyond, square]))

    assert np.array_equal(found.lines, gap.lines)
