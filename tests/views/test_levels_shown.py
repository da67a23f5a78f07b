"""What is said of level 0 in a log that has levels, and which level a view opens."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.cli.printer import PlainConsole
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, LevelAdded, RobotPose
from semmap_log.views.excerpt.shown_levels import home_of_0
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.report.content import report
from semmap_log.views.rerun.contents import RecordingContents, find_scene
from semmap_log.views.rerun.live_view import fits
from semmap_log.views.rerun.scene import Scene
from semmap_log.views.tables import door_table
from tests.browser import a_page, as_url
from tests.views.report.pages import data_of
from tests.views.rerun.some_logs import START
from tests.views.rerun.test_blueprint import plan_in_front

PLACE = {"x": 1.0, "y": 2.0, "theta": 0.0, "width": 0.9}


def old_log(path: Path, *names: str, doors_on: int, robot_on: int = 0) -> sl.DoorLog:
    """Return a log as it was written before: poses and a sensor on level 0 beside named levels."""
    with sl.create(path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        log.append([LevelAdded(level=n, name=name) for n, name in enumerate(names, start=1)])
        log.append([DoorAdded(door_id=DoorId(1), level=doors_on, **PLACE)])
        log.append([DoorAdded(door_id=DoorId(2), level=0),
                    DoorAnnotated(door_id=DoorId(2), key="name", value="reed")])  # fmt: skip
        log.append([RobotPose(level=robot_on, x=30.0 + x, y=0.0, theta=0.0) for x in range(3)])
    return sl.read(path / "log")


def scene_of(log: sl.DoorLog) -> Scene:
    return find_scene(Excerpt.of(log, None, None, None))


@pytest.mark.parametrize(
    ("levels", "home"), [([], 0), ([1], 1), ([1, 2], None), ([0, 1], 0), ([0], 0)]
)
def test_where_level_0_is_shown(levels: list[int], home: int | None) -> None:
    """On the only level; on none of several; on itself where it is one."""
    assert home == home_of_0(levels)


def test_one_level_has_all_of_an_old_log(tmp_path: Path) -> None:
    """The viewer's scene: one plan, with the robot's way on it and the sensor below."""
    scene = scene_of(old_log(tmp_path, "L1", doors_on=1))

    (level,) = scene.levels.values()
    assert (1, "L1", True, ("map",)) == (level.level, level.name, level.has_robot, level.path)
    assert level.bounds.high_x > 32
    assert (1, 1) == (scene.home_of_0, scene.robot_level)
    assert ("map", "doors", "reed") == scene.doors[DoorId(2)].path


def test_of_several_none_has_it(tmp_path: Path) -> None:
    """The robot is on no plan, since nobody knows on which; the sensor keeps its lane."""
    scene = scene_of(old_log(tmp_path, "L1", "L2", doors_on=2))

    plans = [level for level in scene.levels.values() if not level.is_empty]
    assert [(2, False)] == [(level.level, level.has_robot) for level in plans]
    assert (None, None) == (scene.home_of_0, scene.robot_level)
    assert ("map", "No_level", "doors", "reed") == scene.doors[DoorId(2)].path


def test_a_level_0_that_has_doors_stays(tmp_path: Path) -> None:
    """A log that was begun without levels, and got a building later."""
    scene = scene_of(old_log(tmp_path, "L1", doors_on=0))

    assert [(0, "Level 0", True)] == [(e.level, e.name, e.has_robot) for e in scene.levels.values()]


@pytest.mark.parametrize(("names", "on"), [(("L1",), 1), (("L1", "L2"), 2)])
def test_more_such_poses_fit_the_picture(tmp_path: Path, names: tuple[str, ...], on: int) -> None:
    """A view that follows a log is not made anew for each."""
    log = old_log(tmp_path, *names, doors_on=on)
    excerpt = Excerpt.of(log, None, None, None)
    taken = RecordingContents(excerpt)
    for batch in excerpt.read():
        taken.take(batch)
    scene = taken.scene()
    with sl.append(log.path) as writer:
        first = writer.append([RobotPose(level=0, x=31.0, y=0.0, theta=0.0)]).first_event
    *_, more = sl.read(log.path).batches(kinds=[RobotPose])

    assert [first] == more.number.tolist()
    assert fits(more, taken, scene)


def test_the_level_with_doors_is_in_front(tmp_path: Path) -> None:
    """Not that of a robot that stands where there is none."""
    log = old_log(tmp_path, "A", "B", doors_on=2, robot_on=1)

    assert "B" == plan_in_front(log, tmp_path)


def test_the_page_has_no_level_0(tmp_path: Path) -> None:
    """One level: the robot's way and the sensor are on it; several: on none."""
    one = data_of(report(old_log(tmp_path / "one", "L1", doors_on=1)).html)
    two = data_of(report(old_log(tmp_path / "two", "L1", "L2", doors_on=2)).html)

    assert ["L1"] == [level["name"] for level in one["levels"]]
    assert [1] == [run[0] for run in one["track"]]
    assert [1, 1] == [door["places"][0][1] for door in one["doors"]]
    assert ["L2"] == [level["name"] for level in two["levels"]]
    assert [0] == [run[0] for run in two["track"]]


@pytest.mark.slow
def test_the_page_opens_on_the_level_with_doors(tmp_path: Path) -> None:
    """In a browser; the robot stands elsewhere, and then on a level that nobody told."""
    elsewhere = old_log(tmp_path / "a", "A", "B", doors_on=2, robot_on=1)
    nowhere = old_log(tmp_path / "b", "A", "B", doors_on=2)
    with a_page() as page:
        for log, said in (
            (elsewhere, "Robot: A, 32.0,\xa00.0\xa0m."),
            (nowhere, "Robot: 32.0,\xa00.0\xa0m."),
        ):
            file = tmp_path / "x.html"
            file.write_text(report(log).html)
            page.open(as_url(file))
            front = page.evaluate("document.querySelector('.level:not(.behind)').ariaLabel")

            assert "B" == front
            assert said in page.evaluate("document.body.innerText")
            assert "Without a place:" in page.evaluate("document.body.innerText")
            assert [] == page.complaints


def test_the_table_says_no_level_that_is_none(tmp_path: Path) -> None:
    """A sensor on level 0, beside the building's."""
    log = old_log(tmp_path, "L1", doors_on=1)
    out = io.StringIO()
    PlainConsole(out, width=80).print(door_table(log.replay(), tz="UTC"))

    (row,) = [line.split() for line in out.getvalue().splitlines() if "reed" in line]
    assert ["2", "reed", "-"] == row[:3]
