"""The first pass: names, paths, bounds, lifetimes."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorUpdated,
    Event,
    LevelAdded,
)
from semmap_log.views.bounds import bounds_of_floor
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.rerun.contents import find_scene
from semmap_log.views.rerun.scene import Scene
from tests.conftest import SteadyClock
from tests.views.rerun.some_logs import SECOND, START, room, small_log


def scene_of(tmp_path: Path, *events: Event) -> Scene:
    with sl.create(tmp_path / "log", tz="UTC", clock=SteadyClock(START)) as log:
        for event in events:
            log.append([event])
    return find_scene(Excerpt(sl.read(tmp_path / "log")))


def placed(door_id: int, level: int, x: float = 0.0) -> DoorAdded:
    return DoorAdded(door_id=DoorId(door_id), level=level, x=x, y=0.0, theta=0.0, width=1.0)


def named(door_id: int, name: str) -> DoorAnnotated:
    return DoorAnnotated(door_id=DoorId(door_id), key="name", value=name)


def test_one_level_needs_no_name_in_the_paths(tmp_path: Path) -> None:
    """`/map/doors/front`, as short as a lane's head should be."""
    scene = find_scene(Excerpt(small_log(tmp_path / "log")))

    assert {1: ("map", "doors", "front"), 2: ("map", "doors", "door_2")} == {
        door_id: door.path for door_id, door in scene.doors.items()
    }
    assert [("map",)] == [level.path for level in scene.levels.values()]


def test_a_door_that_comes_to_another_level_is_no_other_doors_namesake(tmp_path: Path) -> None:
    """Two doors of one name that are ever on the same level do not share its entity."""
    scene = scene_of(
        tmp_path,
        LevelAdded(level=1, name="L1"), LevelAdded(level=2, name="L2"),
        placed(1, 1), named(1, "front"), placed(2, 1), named(2, "front"),
        DoorUpdated(door_id=DoorId(2), changed=Changed.POSE, level=2, x=0.0, y=0.0, theta=0.0),
    )  # fmt: skip

    lines = [path for door in scene.doors.values() for path in door.lines.values()]
    assert len(lines) == len(set(lines)) == 3


def test_with_several_levels_each_has_its_branch(tmp_path: Path) -> None:
    """The level's name stands in the path once."""
    scene = scene_of(
        tmp_path,
        LevelAdded(level=1, name="L1"), LevelAdded(level=2, name="L2"),
        placed(1, 1), named(1, "L1_lab"), placed(2, 2), named(2, "L2_lab"), placed(3, 2),
        named(3, "L2"),
    )  # fmt: skip

    assert ["/map/L1/doors/lab", "/map/L2/doors/lab", "/map/L2/doors/L2"] == [
        "/" + "/".join(door.path) for door in scene.doors.values()
    ]
    assert [("L1_lab", "lab"), ("L2_lab", "lab"), ("L2", "L2")] == [
        (door.label, door.short_label) for door in scene.doors.values()
    ]


def test_a_door_that_moved_upstairs_has_a_line_on_both_levels(tmp_path: Path) -> None:
    """Its lane is where it was put last."""
    scene = scene_of(
        tmp_path,
        LevelAdded(level=1, name="ground"),
        LevelAdded(level=2, name="first"),
        placed(1, 1),
        DoorUpdated(door_id=DoorId(1), changed=Changed.POSE, level=2, x=0, y=0, theta=0),
    )

    ground, first = (("map", name, "doors", "door_1") for name in ("ground", "first"))
    assert {1: ground, 2: first} == dict(scene.doors[DoorId(1)].lines)
    assert first == scene.doors[DoorId(1)].path


def test_bounds_hold_plan_doors_and_robot(tmp_path: Path) -> None:
    """The plan's known cells and a door outside them, with a metre around."""
    scene = scene_of(tmp_path, room(), placed(1, 0, x=9.0))

    bounds = scene.levels[0].bounds
    assert pytest.approx((-6.0, -5.0, 11.0, 5.0)) == (
        bounds.low_x, bounds.low_y, bounds.high_x, bounds.high_y
    )  # fmt: skip


def test_unknown_margins_of_a_scanned_map_do_not_count() -> None:
    """Nor does it matter how the map lies."""
    plan = room(theta=math.pi / 2)
    plan.cells[:, 100:] = -1

    bounds = bounds_of_floor(plan)

    assert pytest.approx((-13.0, -4.0, -5.0, 1.0)) == (
        bounds.low_x, bounds.low_y, bounds.high_x, bounds.high_y
    )  # fmt: skip


def test_a_lone_door_is_not_blown_up(tmp_path: Path) -> None:
    """The view is at least four metres wide and high."""
    bounds = scene_of(tmp_path, placed(1, 0)).levels[0].bounds

    assert (4.0, 4.0) == (bounds.high_x - bounds.low_x, bounds.high_y - bounds.low_y)


def test_the_pass_counts_what_the_layout_needs(tmp_path: Path) -> None:
    """Changes of state, whether there are probabilities, lifetimes, and where the robot is."""
    scene = find_scene(Excerpt(small_log(tmp_path / "log")))

    front, other = scene.doors[DoorId(1)], scene.doors[DoorId(2)]
    assert (2, True, 0, False) == (
        front.state_changes, front.has_probabilities, scene.robot_level, not front.is_plain
    )  # fmt: skip
    assert (0, False) == (other.state_changes, other.has_probabilities)
    assert START + 1800 * SECOND <= other.life.removed[0] <= START + 1801 * SECOND


def test_an_excerpt_knows_the_doors_before_it(tmp_path: Path) -> None:
    """A moment may also be an event; its happened time counts."""
    log = small_log(tmp_path / "log")

    scene = find_scene(Excerpt.of(log, "event:4", None, None))

    assert log.event(4).happened_ns == scene.begin.folds_ns
    before = scene.doors[DoorId(1)].before
    assert before is not None
    assert "front" == before.name
