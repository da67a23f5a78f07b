"""Recordings of all kinds in the viewer: nothing to complain about, each door in its own colour."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.core.model.doors import Door
from semmap_log.views.bounds import Bounds
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import DEFAULT
from semmap_log.views.rerun.contents import find_scene
from semmap_log.views.rerun.process import Viewer
from semmap_log.views.rerun.recording import save_rrd
from semmap_log.views.rerun.scene import SceneLevel
from tests.views.rerun.pictures import a_viewer, is_colour
from tests.views.rerun.some_logs import restless_log

pytestmark = pytest.mark.viewer

RECORDINGS = Path(__file__).parents[3] / "recordings"
SIZE = (1920, 1080)
NEAR_PIXELS = 4
"""Around a point of a door's line, which is five pixels wide."""
DAY_NS = 86_400 * 10**9


@pytest.fixture(scope="module", params=["random", "clinic_week"])
def log(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    if request.param == "random":
        return restless_log(tmp_path_factory.mktemp("random") / "log", seed=7)
    return sl.read(RECORDINGS / request.param)


@pytest.fixture(scope="module")
def viewer(log: sl.DoorLog, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Viewer]:
    path = tmp_path_factory.mktemp("recording") / "x.rrd"
    save_rrd(log, path, beliefs=log.path.name != "clinic_week")  # its beliefs take long
    with a_viewer(path, size=SIZE, quiet=False) as viewer:
        yield viewer


@pytest.mark.slow
def test_no_view_has_anything_to_report(viewer: Viewer) -> None:
    """Each, once it was shown; nor does the viewer itself warn of anything."""
    names = [view.name for view in viewer.state().views]
    for name in names:
        viewer.show(name)
        viewer.picture()

    state = viewer.state()

    assert len(names) > 3
    assert [] == [(view.name, view.reports) for view in state.views if view.reports]
    assert [] == [
        entry.message for entry in viewer.ask(lambda client: client.get_logs())
        if entry.level in {"WARN", "ERROR"} and "oftware rasterizer" not in entry.message
    ]  # fmt: skip


@pytest.mark.slow
def test_every_door_is_where_it_is_in_the_colour_of_its_state(
    viewer: Viewer, log: sl.DoorLog
) -> None:
    """As replay has it half way."""
    scene = find_scene(Excerpt(log))
    at_ns = scene.begin.folds_ns + scene.span_ns // 2
    doors = log.replay(at=at_ns).doors.values()
    viewer.go_to("happened", at_ns)

    shown, wrong = 0, []
    for level in (level for level in scene.levels.values() if not level.is_empty):
        here = [d for d in doors if d.level == level.level and np.isfinite(d.x + d.width)]
        picture = viewer.picture("Floor plan" if len(scene.levels) == 1 else level.name)
        for door in here:
            if _has_its_colour(door, level, picture):
                shown += 1
            else:
                wrong.append((door.door_id, door.state))

    assert shown > 0
    assert len(wrong) <= 0.1 * shown, wrong


def _has_its_colour(door: Door, level: SceneLevel, picture: bytes) -> bool:
    """Tell whether the door's colour is at a point of its line."""
    drawn = is_colour(picture, DEFAULT.of_state(door.state))
    for share in (0.1, 0.3, 0.7, 0.9):
        along = share * door.width
        x, y = door.x + along * np.cos(door.theta), door.y + along * np.sin(door.theta)
        row, column = _pixel(float(x), float(y), level.bounds, drawn.shape)
        near = drawn[max(row - NEAR_PIXELS, 0) : row + NEAR_PIXELS + 1,
                     max(column - NEAR_PIXELS, 0) : column + NEAR_PIXELS + 1]  # fmt: skip
        if near.any():
            return True
    return False


def _pixel(x: float, y: float, bounds: Bounds, shape: tuple[int, ...]) -> tuple[int, int]:
    """Where a point of the map is in the picture of its plan: as large as fits, in the middle."""
    height, width = shape
    scale = min(width / (bounds.high_x - bounds.low_x), height / (bounds.high_y - bounds.low_y))
    middle_x, middle_y = (bounds.low_x + bounds.high_x) / 2, (bounds.low_y + bounds.high_y) / 2
    return (round(height / 2 - scale * (y - middle_y)), round(width / 2 + scale * (x - middle_x)))
