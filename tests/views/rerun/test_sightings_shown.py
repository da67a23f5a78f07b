"""Kept scans in a recording: the latest visit to each door, as it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'semmap-log[viewer]'")

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, DoorObserved
from semmap_log.interop.formats.kept_scans.reading import kept_visits
from semmap_log.interop.formats.kept_scans.writing import keeping_scans
from semmap_log.views.palette import COLOUR_BLIND, DEFAULT, Palette, packed
from semmap_log.views.rerun.recording import RrdSummary, save_rrd
from semmap_log.views.rerun.scene import MOST_ROWS
from semmap_log.views.rerun.sighting_views import MOST_DOORS, MOST_POINTS
from tests.analysis.scans.some_scans import LINE, SHUT, seen_visit
from tests.analysis.scans.some_visits import START_NS, S
from tests.conftest import SteadyClock
from tests.interop.formats.kept_scans.torn import chunks_at
from tests.views.rerun.pictures import a_viewer, has_colour
from tests.views.rerun.some_logs import Drawn, room

ROOT = "/map/sightings/front"
STRIPS, COLOURS = "LineStrips2D:strips", "LineStrips2D:colors"
POINTS, LABELS = "Points2D:positions", "Points2D:labels"
AJAR = (2.0, 1.0, 2.8, 1.6)


def sighted_log(path: Path, *, doors: int = 1, visits: int = 3, name: str = "front") -> sl.DoorLog:
    """A door by whose side a robot goes again and again: shut, open, ajar, and so on."""
    clock = SteadyClock(START_NS - 10 * S)
    leaves = [SHUT, None, AJAR]
    states = [DoorState.CLOSED, DoorState.OPEN, DoorState.UNKNOWN]
    with (
        sl.create(path, tz="UTC", clock=clock) as log,
        keeping_scans(path, log.info.log_id) as kept,
    ):
        log.append([room()])
        for door in range(1, doors + 1):
            x, y, theta, width = LINE
            log.append([DoorAdded(door_id=DoorId(door), x=x, y=y, theta=theta, width=width)])
        log.append([DoorAnnotated(door_id=DoorId(1), key="name", value=name)])
        for n in range(visits):
            for door in range(1, doors + 1):
                visit, scans = seen_visit(
                    60 * n + door / 100, door_id=door, leaf=leaves[n % 3], state=states[n % 3],
                    why="ajar" if n % 3 == 2 else "",
                )  # fmt: skip
                clock.now_ns = visit.last_ns
                log.append([DoorObserved(door_id=DoorId(door), state=visit.state)])
                kept.keep(visit, line=LINE, level=0, scans=scans)
    return sl.read(path)


def _end_ns(visit: int, door: int = 1) -> int:
    return seen_visit(60 * visit + door / 100)[0].last_ns


def _saved(tmp_path: Path, log: sl.DoorLog, **how: object) -> tuple[Drawn, RrdSummary]:
    how = {"scans": kept_visits, **how}
    summary = save_rrd(log, tmp_path / "x.rrd", **how)  # type: ignore[arg-type]
    return Drawn(tmp_path / "x.rrd"), summary


@pytest.mark.parametrize("palette", [DEFAULT, COLOUR_BLIND], ids=["default", "colour-blind"])
def test_at_each_moment_the_latest_visit_is_shown(tmp_path: Path, palette: Palette) -> None:
    """Its leaf in the colour of what was said, until the next one has ended."""
    drawn, _ = _saved(tmp_path, sighted_log(tmp_path / "office"), palette=palette)

    shown = {}
    for n in range(3):
        for at in (_end_ns(n), _end_ns(n) + 50 * S):
            leaf = drawn.latest(f"{ROOT}/leaf", STRIPS, at)
            colour = drawn.latest(f"{ROOT}/leaf", COLOURS, at)
            (label,) = drawn.latest(f"{ROOT}/verdict", LABELS, at)
            shown.setdefault(n, []).append((leaf, colour, label.splitlines()[0]))
    (shut, again), (wide, _), (ajar, _) = shown.values()
    assert shut == again
    np.testing.assert_allclose(shut[0], [[[2, 1], [3, 1]]], atol=1e-5)
    np.testing.assert_allclose(ajar[0], [[[2, 1], [2.8, 1.6]]], atol=1e-5)
    assert wide[0] == []
    assert (shut[1], ajar[1]) == ([packed(palette.closed)], [packed(palette.unknown)])
    assert (shut[2], wide[2], ajar[2]) == ("CLOSED .98", "OPEN .98", "UNKNOWN: ajar")
    assert drawn.latest(f"{ROOT}/leaf", STRIPS, _end_ns(0) - 1) is None


def test_beams_lie_where_the_laser_saw_them(tmp_path: Path) -> None:
    """On the map's own metres, by what became of them."""
    drawn, _ = _saved(tmp_path, sighted_log(tmp_path / "office"))

    points = np.array(drawn.latest(f"{ROOT}/points", POINTS, _end_ns(0)))
    colours = np.array(drawn.latest(f"{ROOT}/points", "Points2D:colors", _end_ns(0)))
    stopped = points[colours == packed(DEFAULT.closed)]
    np.testing.assert_allclose(stopped[:, 1], 1.0, atol=1e-5)
    assert len(stopped) > 20
    assert stopped[:, 0].min() >= 2.0
    assert stopped[:, 0].max() <= 3.0
    assert 100 < len(points) <= MOST_POINTS
    (line,) = drawn.latest(f"{ROOT}/line", STRIPS, _end_ns(0))
    np.testing.assert_allclose(line, [[2, 1], [3, 1]], atol=1e-5)
    (track,) = drawn.latest(f"{ROOT}/track", STRIPS, _end_ns(0))
    np.testing.assert_allclose(track, [[1 + n / 2, 0] for n in range(5)], atol=1e-5)


def test_without_a_leaf_in_any_visit_none_is_drawn(tmp_path: Path) -> None:
    """Not even a point at the origin of the map."""
    path = tmp_path / "office"
    log = sighted_log(path, visits=0)
    with keeping_scans(path, log.info.log_id) as kept:
        visit, scans = seen_visit(leaf=None)
        kept.keep(visit, line=LINE, level=0, scans=scans)

    drawn, _ = _saved(tmp_path, log)

    assert drawn.latest(f"{ROOT}/leaf", STRIPS, visit.last_ns) in ([], None)


def test_scans_may_be_left_out(tmp_path: Path) -> None:
    """And where none are kept, nothing is."""
    log = sighted_log(tmp_path / "office")

    assert not any("sightings" in one for one in _saved(tmp_path, log, scans=None)[0].entities)
    drawn, _ = _saved(tmp_path, log, since=_end_ns(2) + S)
    assert not any("sightings" in one for one in drawn.entities)


def test_a_part_of_a_log_shows_the_visits_of_that_part(tmp_path: Path) -> None:
    """Between its two moments, and of the doors that were asked for."""
    log = sighted_log(tmp_path / "office", doors=2)

    drawn, _ = _saved(tmp_path, log, since=_end_ns(1), until=_end_ns(2), doors=[DoorId(1)])

    assert [at for at, _ in drawn.rows(f"{ROOT}/verdict", LABELS)] == [_end_ns(1)]
    assert {one.split("/")[3] for one in drawn.entities if "sightings" in one} == {"front"}


def test_of_many_doors_those_with_most_visits_are_shown(tmp_path: Path) -> None:
    """How many are not is told; no call has more rows than the viewer likes."""
    log = sighted_log(tmp_path / "office", doors=MOST_DOORS + 2, visits=1)

    drawn, summary = _saved(tmp_path, log)

    shown = {one.split("/")[3] for one in drawn.entities if "sightings" in one}
    assert len(shown) == MOST_DOORS
    assert summary.sightings_left_out == 2
    assert drawn.most_rows <= MOST_ROWS


def test_a_torn_file_is_shown_as_far_as_it_goes(tmp_path: Path) -> None:
    """And it is said."""
    log = sighted_log(tmp_path / "office")
    (file,) = (tmp_path / "office.scans").iterdir()
    file.write_bytes(file.read_bytes()[: chunks_at(file)[2] + 50])

    drawn, summary = _saved(tmp_path, log)

    assert len(drawn.rows(f"{ROOT}/verdict", LABELS)) == 2
    assert "its end was never written" in summary.problems[0]


def test_the_same_scans_are_the_same_rows(tmp_path: Path) -> None:
    log = sighted_log(tmp_path / "office")

    first, second = (_saved(tmp_path, log)[0].shows() for _ in range(2))

    assert first == second


@pytest.mark.viewer
@pytest.mark.slow
def test_the_viewer_shows_a_door_as_the_laser_saw_it(tmp_path: Path) -> None:
    """Without a complaint; a name that it has no letters for gives way to the number."""
    log = sighted_log(tmp_path / "office", name="会議室\x1b[31m")
    save_rrd(log, tmp_path / "x.rrd", scans=kept_visits)

    with a_viewer(tmp_path / "x.rrd", size=(900, 700), quiet=False) as viewer:
        viewer.go_to("happened", _end_ns(0))
        shut = viewer.picture("door 1 by laser")
        viewer.go_to("happened", _end_ns(1))
        wide = viewer.picture("door 1 by laser")
        plan = viewer.picture("Floor plan")
        state = viewer.state()

    assert [] == [(view.name, view.reports) for view in state.views if view.reports]
    assert (has_colour(shut, DEFAULT.closed), has_colour(shut, DEFAULT.robot)) == (True, True)
    assert (has_colour(wide, DEFAULT.closed), has_colour(wide, DEFAULT.open)) == (False, True)
    assert not has_colour(plan, DEFAULT.robot)


def test_the_plan_leaves_sightings_out(tmp_path: Path) -> None:
    """They have views of their own, on pages behind the plan: of each door one, around it."""
    from semmap_log.views.excerpt.span import Excerpt
    from semmap_log.views.rerun.contents import find_scene
    from semmap_log.views.rerun.recording import layout
    from semmap_log.views.rerun.sighting_views import sightings_to_show

    excerpt = Excerpt(sighted_log(tmp_path / "office", doors=8))
    scene = find_scene(excerpt)
    shown = sightings_to_show(kept_visits, excerpt, scene, None)

    plans = layout(
        scene, DEFAULT, chosen=None, level=None, costmap=True, beliefs=None, rounds=(), tz="UTC",
        sightings=shown,
    ).root_container.contents[0]  # fmt: skip

    plan, _, *pages = plans.contents
    assert "- /map/sightings/**" in plan.contents
    assert [page.name for page in pages] == ["Sightings 1/2", "Sightings 2/2"]
    views = [view for page in pages for view in page.contents]
    assert [view.name for view in views][:2] == ["front by laser", "door 2 by laser"]
    assert views[0].contents == ["+ /map/floor/**", "+ /map/sightings/front/**"]
    (bounds,) = views[0].properties["VisualBounds2D"].range.pa_array.to_pylist()
    assert bounds == {"x_range": [0.0, 5.0], "y_range": [-3.5, 1.5]}
