"""A building that was mapped anew, in a recording: each moment lies on the plan of its time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.analysis.costmaps import costmap_at
from semmap_log.views.rerun.recording import save_rrd
from tests.turned_maps import MOVED_AT, office_mapped_anew
from tests.views.rerun.some_logs import Drawn
from tests.views.rerun.test_costmap import layer_seen

pytestmark = pytest.mark.viewer

MOMENTS = (
    "2026-03-02T08:30", "2026-03-02T13:59:59", MOVED_AT, "2026-03-02T15:11", "2026-03-02T19:00",
)  # fmt: skip
FLOOR, ROOMS, NAMES = "/map/floor", "/map/rooms", "/map/room_names"
BUFFER, FORMAT, PLACE = "Image:buffer", "Image:format", "Transform3D:translation"


def drawn(log: sl.DoorLog, tmp_path: Path, **how: str) -> Drawn:
    save_rrd(log, tmp_path / "x.rrd", **how)
    return Drawn(tmp_path / "x.rrd")


@pytest.mark.parametrize("known", ["rebased", "retracted"])
def test_floor_and_costmap_are_those_of_the_moment(tmp_path: Path, known: str) -> None:
    """Along `happened` those of a replay; taken back, the old map is there at all times."""
    path = office_mapped_anew(tmp_path)
    first = next(h.number for h in sl.read(path).history() if h.reason == "mapped anew")
    if known == "retracted":
        with sl.append(path) as writer:
            writer.retract(first, first + 3)
    log = sl.read(path)
    drawing = drawn(log, tmp_path)

    asked = [("happened", log.instant(at), {"at": at}) for at in MOMENTS]
    ends = [first - 1, first, first + 3, log.last_event()]
    asked += [("event", number, {"event": number}) for number in ends]
    shapes = set()
    for timeline, at, scope in asked:
        there = costmap_at(log, **scope)
        shapes.add(there.geometry.shape)
        (form,) = drawing.latest(FLOOR, FORMAT, at, timeline)
        (place,) = drawing.latest(FLOOR, PLACE, at, timeline)
        assert (form["height"], form["width"]) == there.geometry.shape, scope
        np.testing.assert_allclose(place[:2], [there.geometry.origin_x, there.geometry.origin_y])
        layer = layer_seen(drawing, at, timeline=timeline, geometry=there.geometry)
        np.testing.assert_array_equal(there.layer.costs, layer, err_msg=str(scope))
    assert len(shapes) == 2


def test_robot_and_rooms_leave_with_their_plan(tmp_path: Path) -> None:
    """The arrow is gone until the robot tells its place on the new plan; the track stays behind."""
    log = sl.read(office_mapped_anew(tmp_path))
    drawing = drawn(log, tmp_path)
    before, after, later = (log.instant(at) for at in ("2026-03-02T13:00", MOVED_AT, MOMENTS[-1]))
    arrow = ("/map/robot/pose", "Arrows2D:origins")
    old, new = sorted(e for e in drawing.entities if e.startswith("/map/robot/track/"))

    assert drawing.latest(*arrow, before) is not None
    assert drawing.latest(*arrow, after) is None
    assert drawing.latest(*arrow, later) is not None
    old, new = sorted((old, new), key=lambda e: drawing.rows(e, "LineStrips2D:strips")[0][0])
    assert max(at for at, _ in drawing.rows(old, "LineStrips2D:strips")) < after
    assert min(at for at, _ in drawing.rows(new, "LineStrips2D:strips")) > after
    assert drawing.latest(old, PLACE, before) is None
    assert drawing.latest(old, PLACE, after)[0][0] > 1e6
    assert drawing.latest(ROOMS, BUFFER, before) != drawing.latest(ROOMS, BUFFER, after)
    points = [drawing.latest(NAMES, "Points2D:positions", at) for at in (before, after)]
    assert max(x for x, _ in points[0]) < 30 < min(x for x, _ in points[1])


def test_a_part_after_the_change_has_one_plan(tmp_path: Path) -> None:
    """Along `happened`; what was known was recorded later, all of it."""
    log = sl.read(office_mapped_anew(tmp_path))

    drawing = drawn(log, tmp_path, since="2026-03-02T15:00")

    assert 1 == len(drawing.rows(FLOOR, FORMAT))
    assert 2 == len(drawing.rows(FLOOR, FORMAT, "recorded"))
