"""Rooms on the page: where their picture lies, and which names it has."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import semmap_log as sl
from semmap_log.analysis.rooms import room_plan
from semmap_log.core.model.events import FloorMap
from semmap_log.views.bounds import rooms_shown
from semmap_log.views.report import page_rooms
from semmap_log.views.report.page_rooms import rooms_of_page
from tests.analysis.rooms.buildings import drawn

FLOOR = drawn(
    """
............
.##########.
.#...#....#.
.#........#.
.#...#....#.
.##########.
............
""",
    scale=10,
)


@pytest.fixture
def log(tmp_path: Path) -> sl.DoorLog:
    with sl.create(tmp_path / "log", tz="UTC") as log:
        floor = FloorMap(resolution=0.1, origin_x=-2.0, origin_y=5.0, cells=FLOOR.cells)
        log.append([floor])
        door = log.add_door(x=3.5, y=8.0, theta=np.pi / 2, width=1.0)
        log.annotate(door, "rooms", "lab,")
    return sl.read(tmp_path / "log")


@pytest.mark.parametrize("most_cells", [10**6, 2000])
def test_the_matrix_takes_the_picture_over_the_rooms(
    log: sl.DoorLog, most_cells: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pixel in each room is tinted, one in the yard is not, however coarse the picture is."""
    monkeypatch.setattr(page_rooms, "MOST_CELLS", most_cells)
    plan = room_plan(log)
    shown = rooms_of_page(plan, 0)

    assert shown is not None
    png = base64.b64decode(shown["src"].removeprefix("data:image/png;base64,"))
    alpha = np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))[:, :, 3]
    assert (shown["height"], shown["width"]) == alpha.shape
    a, _, _, d, e, f = shown["matrix"]
    for room in plan.graph.rooms.values():
        assert 255 == alpha[int((-room.y - f) / d), int((room.x - e) / a)]
    assert 0 == alpha[int((-5.3 - f) / d), int((-1.7 - e) / a)]


def test_only_rooms_with_a_name_are_named(log: sl.DoorLog) -> None:
    """With how long the name may be."""
    shown = rooms_of_page(room_plan(log), 0)

    assert shown is not None
    ((x, y, name, side),) = shown["names"]
    assert "lab" == name
    assert 0 < x < 3
    assert 7 < y < 10
    assert 3.0 == pytest.approx(side, abs=0.2)


def test_a_level_without_rooms_shows_none(log: sl.DoorLog) -> None:
    """Nor one without a plan."""
    with sl.append(log.path) as writer:
        cells = np.zeros((9, 9), np.int8)
        writer.append([FloorMap(resolution=0.1, origin_x=0.0, origin_y=0.0, cells=cells)])

    plan = room_plan(sl.read(log.path))

    assert (None, None) == (rooms_of_page(plan, 0), rooms_of_page(plan, 5))


def test_a_turned_plan_shows_no_rooms(log: sl.DoorLog) -> None:
    """The page is made all the same."""
    with sl.append(log.path) as writer:
        turned = FloorMap(
            resolution=0.1, origin_x=0.0, origin_y=0.0, origin_theta=0.4, cells=FLOOR.cells
        )
        writer.append([turned])
    read = sl.read(log.path)

    assert {} == rooms_shown(read, read.replay()).levels
