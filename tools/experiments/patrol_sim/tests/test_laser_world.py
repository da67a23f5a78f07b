"""A simulated patrol: the same seed gives the same, the robot goes where it can, truth is told."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from patrol_sim.laser_casting import cast_all
from patrol_sim.laser_house import FreeFloor
from patrol_sim.laser_judging import Pose, group_of, judged, placed_scans
from patrol_sim.laser_people import APART_M, legs_at
from patrol_sim.laser_pose import PoseError, localised
from patrol_sim.laser_sensor import Laser
from patrol_sim.laser_world import World, simulated
from patrol_sim.tests.corridor import PLAIN, patrol, plan


def test_plan_is_read() -> None:
    """Doors with their names and kinds, walls as lines."""
    assert [(d.name, d.kind) for d in plan().doors] == [
        ("left", "hinged"), ("middle", "sliding"), ("right", "double_hinged"),
    ]  # fmt: skip
    assert plan().walls.shape == (7, 4)


def test_same_seed_same_scans() -> None:
    """The way, the doors and every range; and each time that it is measured anew."""
    first = patrol()
    again = simulated(plan(), PLAIN, first.laser, seed=first.seed, minutes=1.5)

    assert (again.track.poses == first.track.poses).all()
    for one, other, third in zip(first.scanned(), again.scanned(), first.scanned(), strict=True):
        assert one.ranges.tolist() == other.ranges.tolist() == third.ranges.tolist()


def test_another_seed_is_another_patrol() -> None:
    assert patrol(seed=4).track.poses.shape == patrol().track.poses.shape
    assert (patrol(seed=4).track.poses != patrol().track.poses).any()


def test_ranges_are_those_of_the_world() -> None:
    """
    Nine of ten beams end where a ray through all lines of that moment does: the rest are mixed,
    lost, or met somebody.
    """
    one = patrol()
    ends = []
    for scan in one.scans[::60]:
        base = one.track.at(one.beam_times_s(scan.at_s))
        beams = one.laser.placed(base, as_told=False)
        lines = one.lines_at(scan.at_s)
        true = cast_all(
            beams.origins, beams.bearings, lines.ends, most_m=one.laser.range_max
        ).ranges
        back = np.isfinite(scan.ranges)
        ends.append(np.abs(scan.ranges - true)[back] < 0.06)

    assert np.concatenate(ends).mean() > 0.9


def test_robot_stays_clear_of_walls_and_furniture() -> None:
    """The laser never is inside anything that stands still, nor nearer to it than a hand."""
    one = patrol()
    still = one.still.ends
    for pose in one.track.poses[::25]:
        start, along = still[:, :2] - pose[:2], still[:, 2:] - still[:, :2]
        share = np.clip(-(start * along).sum(1) / (along**2).sum(1), 0, 1)
        assert np.hypot(*(start + share[:, None] * along).T).min() > 0.1


def test_robot_goes_through_open_doors_only() -> None:
    """Whenever its middle crosses a door's line, most of the doorway is clear."""
    through = 0
    for seed in range(3, 7):
        one = patrol(seed=seed)
        for door_id, times_s in one.passages.items():
            for at_s in times_s:
                life = one.lives[door_id]
                assert life.body.opening(life.amounts(at_s)) > 0.6
                through += 1
    assert through >= 5


def test_passages_are_where_the_track_crosses_the_line() -> None:
    """Just before and just after, the robot is on different sides of the door, near its middle."""
    one = patrol(seed=4)
    assert one.passages
    for door_id, times_s in one.passages.items():
        drawn = one.lives[door_id].body.drawn
        for at_s in times_s:
            before, after = (
                (one.track.pose(at_s + late)[:2] - drawn.ends[0]) @ drawn.left
                for late in (-0.5, 0.5)
            )
            assert before * after < 0
            along = (one.track.pose(at_s)[:2] - drawn.ends[0]) @ drawn.along
            assert 0.1 < along / drawn.width < 0.9


def test_walls_leave_the_doorways_free() -> None:
    """A ray through the middle of each doorway meets no wall within half a metre."""
    bare = simulated(plan(), replace(PLAIN, furniture_per_100_m2=0), Laser(), seed=1, minutes=0.2)
    for life in bare.lives.values():
        start, end = life.body.ends
        for share in (0.1, 0.5, 0.9):
            at = start + share * (end - start) - 0.5 * life.body.drawn.left
            hits = cast_all(at[None], np.array([math.pi / 2]), bare.still.ends, most_m=9)
            assert hits.ranges[0] > 1.0


def test_world_without_chance_is_plain() -> None:
    """No glass, nobody, no furniture: nothing but walls, frames and leaves."""
    world = replace(PLAIN, furniture_per_100_m2=0, walkers_per_min=0, in_doorway=0)
    one = simulated(plan(), world, Laser(), seed=1, minutes=0.3)

    assert one.people == []
    assert not any(wall.glass for wall in one.walls)
    assert not any(life.body.glass for life in one.lives.values())


def test_glass_and_people_come_where_they_are_asked_for() -> None:
    world = replace(PLAIN, glass_doors=1.0, glass_walls=1.0, walkers_per_min=20, in_doorway=0.5)
    one = simulated(plan(), world, Laser(), seed=1, minutes=1)

    assert all(life.body.glass for life in one.lives.values())
    assert sum(wall.glass for wall in one.walls) >= 5
    assert len(one.people) > 8
    for at_s in np.arange(0, 60, 0.5):
        robot = one.track.pose(at_s)[:2]
        legs = legs_at(one.people, at_s, robot)
        assert all(math.dist(leg, robot) > APART_M for leg in legs)


def test_kinds_by_chance_are_told_to_the_log() -> None:
    """The events of the plan say what the world's doors are."""
    one = simulated(plan(), World(cell_m=0.1), Laser(), seed=2, minutes=0.2)
    told = {e.door_id: e.value for e in one.plan.events if getattr(e, "key", "") == "kind"}

    assert told == {door.door_id: door.kind for door in one.plan.doors}
    assert {life.body.kind for life in one.lives.values()} <= set(told.values())


def test_free_floor_knows_walls() -> None:
    floor = FreeFloor(plan().floor)

    assert floor.holds(np.array([[7.0, 1.2], [2.0, 5.0]]))
    assert not floor.holds(np.array([[7.0, 1.2], [5.0, 5.0]]))
    assert not floor.holds(np.array([[-40.0, 1.2]]))


def test_placed_scans_are_where_the_robot_believes() -> None:
    """Beam by beam, at its own time; the told spread is the true one, or none."""
    one = patrol()
    where = localised(one.track, PoseError(0.1, 2.0), seed=1)
    scans = one.scans[100:103]
    told, untold = (
        list(placed_scans(one, scans, where, Pose("", PoseError(0.1, 2.0), told)))
        for told in (True, False)
    )

    for placed, scan in zip(told, scans, strict=True):
        base = where.believed_at(one.beam_times_s(scan.at_s))
        beam = 77
        x, y, theta = base[beam]
        out = np.array([one.laser.x, one.laser.y])
        turned = np.array([
            [math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)],
        ]) @ out  # fmt: skip
        assert placed.origins[beam].tolist() == pytest.approx([x + turned[0], y + turned[1]])
        assert placed.bearings[beam] == pytest.approx(
            theta + one.laser.yaw + one.laser.angles[beam]
        )
        assert placed.sd_xy == 0.1
    assert math.isnan(untold[0].sd_xy)


def test_truth_of_a_visit_is_that_of_its_time() -> None:
    """Each judged visit's door stood so in the middle of it, or is marked as one that moved."""
    one = patrol()
    pose = Pose("told", PoseError(0.02, 0.3), told=True)
    visits = judged(one, one.scans, localised(one.track, pose.error, seed=1), pose)

    assert len(visits) >= 3
    for visit in visits:
        life = one.lives[visit.door_id]
        if not visit.moved:
            assert visit.group == group_of(life, (visit.first_s + visit.last_s) / 2)
    assert any(visit.moved for visit in visits)
