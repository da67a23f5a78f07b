"""Floor plans as pictures of ink."""

from __future__ import annotations

import base64
import io
import math

import numpy as np
import pytest
from PIL import Image

from semmap_log.core.model.events import FloorMap
from semmap_log.views.report import plans
from semmap_log.views.report.plans import FLOOR_INK, WALL_INK, picture_of
from tests.views.rerun.some_logs import room


def ink(picture: dict) -> np.ndarray:
    """How much of each pixel is covered, row 0 on top."""
    png = base64.b64decode(picture["src"].removeprefix("data:image/png;base64,"))
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))[:, :, 3]


def floor(cells: np.ndarray, *, theta: float = 0.0) -> FloorMap:
    return FloorMap(resolution=0.5, origin_x=10.0, origin_y=20.0, origin_theta=theta,
                    cells=np.asarray(cells, np.int8))  # fmt: skip


def test_walls_are_dark_floors_light_and_the_unknown_is_nothing() -> None:
    """Upright: the lowest row of the cells is the picture's last."""
    picture = picture_of(floor([[0, 100], [0, -1]]))

    assert [[FLOOR_INK, 0], [FLOOR_INK, WALL_INK]] == ink(picture).tolist()


@pytest.mark.parametrize("theta", [0.0, 0.7, -2.0])
def test_the_matrix_takes_each_cell_to_its_place(theta: float) -> None:
    """Also where the map is turned, and after its unknown margins were cut off."""
    cells = np.full((6, 9), -1)
    cells[2:4, 3:8] = 0
    plan = floor(cells, theta=theta)

    picture = picture_of(plan)

    a, b, c, d, e, f = picture["matrix"]
    right, down = 1.5, 0.5  # the middle of the second pixel of the first row: cell (3, 4)
    x, y = a * right + c * down + e, -(b * right + d * down + f)
    u, v = 4.5 * 0.5, 3.5 * 0.5
    assert x == pytest.approx(10 + math.cos(theta) * u - math.sin(theta) * v)
    assert y == pytest.approx(20 + math.sin(theta) * u + math.cos(theta) * v)


def test_of_a_huge_map_no_wall_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several cells become one, the darkest of them; it covers the same ground."""
    monkeypatch.setattr(plans, "MOST_CELLS", 50)

    picture = picture_of(room())

    assert (50, 40) == (picture["width"], picture["height"])
    covered = ink(picture)
    assert (covered[0] == WALL_INK).all()
    assert (covered[:, -1] == WALL_INK).all()
    assert [0.2, 0.0, 0.0, 0.2, -5.0, -4.0] == pytest.approx(picture["matrix"], abs=1e-6)


def test_a_plan_of_nothing_is_no_picture() -> None:
    """All of it unknown."""
    assert picture_of(floor(np.full((3, 3), -1))) is None
