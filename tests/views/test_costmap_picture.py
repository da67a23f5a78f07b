"""The costmap's picture: what is where, in pixels; odd maps and doors make a picture, too."""

import io
import math

import numpy as np
import pytest
from PIL import Image, ImageDraw

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.core.model.doors import DoorState
from semmap_log.errors import CostmapError
from semmap_log.views.costmap_picture import MARGIN_PX, DoorMark, costmap_png, fitted, font
from semmap_log.views.palette import COST_DOORS

ROOM = np.zeros((40, 60), np.uint8)
ROOM[[0, -1]] = 254
ROOM[:, [0, -1]] = 254
GEOMETRY = GridGeometry(60, 40, 0.05, -1.0, -1.0)
PX_A_CELL = 1400 // 60


def door(number=1, *, start=(0.0, 0.0), end=(0.9, 0.0), state=DoorState.CLOSED, name=None):
    return DoorMark(number, name, *start, *end, state)


def opened(png):
    return Image.open(io.BytesIO(png))


def pixel_at(x, y):
    """Where a place of ROOM is on the canvas."""
    column, row = (x + 1.0) / 0.05, (y + 1.0) / 0.05
    return MARGIN_PX + int(column * PX_A_CELL), MARGIN_PX + int((40 - row) * PX_A_CELL)


def test_doors_are_where_the_map_has_them():
    """In the colour of their state, in the middle of their line."""
    doors = [
        door(1, start=(0.0, 0.0), end=(0.9, 0.0), state=DoorState.CLOSED),
        door(2, start=(0.0, 0.5), end=(0.9, 0.5), state=DoorState.OPEN),
        door(3, start=(1.5, -0.5), end=(1.5, 0.4), state=DoorState.OFFLINE),
    ]

    picture = opened(costmap_png(ROOM, GEOMETRY, doors)).convert("RGB")

    assert COST_DOORS[DoorState.CLOSED] == picture.getpixel(pixel_at(0.45, 0.0))
    x, y = pixel_at(0.45, 0.5)
    column = {picture.getpixel((x, y + off)) for off in range(-2, 3)}
    assert {COST_DOORS[DoorState.OPEN], (255, 255, 255)} == column
    assert COST_DOORS[DoorState.UNKNOWN] == picture.getpixel(pixel_at(1.5, -0.5))


def test_a_label_stands_beside_its_door():
    """A door with a name changes pixels near it, and only there."""
    bare = opened(costmap_png(ROOM, GEOMETRY, [door(1)])).convert("RGB")
    named = opened(costmap_png(ROOM, GEOMETRY, [door(1, name="Labor")])).convert("RGB")

    differ = np.argwhere(np.any(np.asarray(bare) != np.asarray(named), axis=2))

    x, y = pixel_at(0.45, 0.0)
    assert len(differ)
    assert np.all(np.abs(differ - [y, x]) <= [40, 60])


def test_the_same_picture_has_the_same_bytes():
    marks = [door(n, start=(0.1 * n, 0.0), end=(0.1 * n, 0.5), name=f"d{n}") for n in range(9)]

    first, second = (costmap_png(ROOM, GEOMETRY, marks, title="noon") for _ in range(2))

    assert first == second


@pytest.mark.parametrize(
    ("width", "height"), [(1, 1), (1, 4000), (4000, 1), (2001, 3), (4000, 4000)]
)
def test_any_size_makes_a_picture_of_some_size(width, height):
    """From one cell to sixteen million; a picture for people stays one."""
    grid = np.zeros((height, width), np.uint8)

    png = costmap_png(grid, GridGeometry(width, height, 0.05), [door()], title="t" * 500)

    found = opened(png)
    assert 300 <= found.width <= 3200
    assert 500 <= found.height <= 2200
    assert len(png) < 200_000


def test_a_name_that_the_font_cannot_write_gives_way_to_the_number():
    """No question marks; beside the map it is said whose name is missing."""
    bare, lacking, named = (
        opened(costmap_png(ROOM, GEOMETRY, [door(name=name)])).convert("RGB")
        for name in (None, "会議室 3", "Küche")
    )

    on_the_map = (0, 0, MARGIN_PX + 60 * PX_A_CELL, bare.height)
    assert bare.crop(on_the_map).tobytes() == lacking.crop(on_the_map).tobytes()
    assert bare.crop(on_the_map).tobytes() != named.crop(on_the_map).tobytes()
    assert bare.tobytes() != lacking.tobytes()


def test_more_doors_than_can_be_labelled():
    """They are all drawn; names stand beside, and how many had no room."""
    crowd = [door(n, start=(0.0, 0.0), end=(0.9, 0.0), name=f"door {n}") for n in range(1000)]

    found = opened(costmap_png(ROOM, GEOMETRY, crowd))

    plain = opened(costmap_png(ROOM, GEOMETRY, []))
    assert plain.height == found.height
    assert plain.width + 3 * 250 == found.width


@pytest.mark.parametrize(
    "ends",
    [
        ((math.nan, 0.0), (1.0, 0.0)),
        ((0.0, 0.0), (math.inf, 0.0)),
        ((50.0, 50.0), (51.0, 50.0)),
        ((-1e300, 1e300), (1e300, 2e300)),
    ],
)
def test_doors_that_are_not_on_the_map_leave_it_as_it_is(ends):
    """Off it, or nowhere."""
    start, end = ends

    assert costmap_png(ROOM, GEOMETRY) == costmap_png(ROOM, GEOMETRY, [door(start=start, end=end)])


@pytest.mark.parametrize("state", [DoorState.CLOSED, DoorState.OPEN, DoorState.UNKNOWN])
@pytest.mark.parametrize("far", [1e3, 1e9, 1e17])
def test_a_door_that_leaves_the_map_is_cut_off_at_its_edge(state, far):
    """However long it is."""
    near = opened(costmap_png(ROOM, GEOMETRY, [door(end=(100.0, 0.0), state=state)]))
    long = opened(costmap_png(ROOM, GEOMETRY, [door(end=(far, 0.0), state=state)]))

    assert np.array_equal(np.asarray(near), np.asarray(long))


@pytest.mark.parametrize("origin", [1e6, 1e15, 1e300, -1e17])
def test_a_map_far_from_its_origin(origin):
    """Ticks are left out where no float tells its metres apart."""
    found = opened(costmap_png(ROOM, GridGeometry(60, 40, 0.05, origin, origin)))

    assert 300 <= found.width


def test_another_shape_is_refused():
    """It would be a picture of something else."""
    with pytest.raises(CostmapError, match=r"expected cells \(40, 60\), got \(60, 40\)"):
        costmap_png(ROOM.T, GEOMETRY)


def test_a_name_of_any_length_is_cut_before_it_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else each letter that goes would have the rest measured again."""
    measured: list[int] = []
    draw = ImageDraw.Draw(Image.new("L", (1, 1)))
    length = draw.textlength
    monkeypatch.setattr(
        draw, "textlength", lambda text, f: (measured.append(len(text)), length(text, f))[1]
    )

    said = fitted(draw, "x" * 60_000, 100, 11)

    assert said.endswith("...")
    assert length(said, font(11)) <= 100
    assert sum(measured) < 10_000
