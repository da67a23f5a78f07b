"""Scans on the map, beam for beam, against a room of matrices; and scans that have no place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semmap_log.interop.formats.ros.ros_types import (
    LASER_SCAN,
    ODOMETRY,
    POSE_WITH_COVARIANCE,
    MessageType,
)
from semmap_log.interop.topics.lasers.lasers import RobotScan
from semmap_log.interop.topics.topic_reader import Known, TopicProblems
from semmap_log.interop.topics.topic_rules import ReadScan, RosMapping, TopicRule
from semmap_log.interop.topics.translator import Translator
from tests.analysis.scans.beams import ranges_of
from tests.interop.formats.bags.bags_of_others import Said
from tests.interop.topics.laser_room import WALLS, LaserRoom, moved, turned

PLAIN = RosMapping(scans=ReadScan())


class Hearing:
    """A translator that hears all that is said, as a recorder does."""

    def __init__(self, mapping: RosMapping = PLAIN, version: Any = 2) -> None:
        self.mapping, self.version = mapping, version
        self.told: list[str] = []
        self.complaints = TopicProblems(self.told.append)
        self.translator = Translator(mapping, Known(), self.complaints)
        self._read: set[str] = set()

    def hear(self, said: Iterable[Said]) -> list[RobotScan]:
        return [scan for each in said for scan in self._one(each)]

    def _one(self, said: Said) -> Iterable[RobotScan]:
        rule = self.mapping.rule(said.topic, said.ros_type)
        if rule is None:
            return ()
        if said.topic not in self._read:
            self.translator.read_topic(said.topic, rule)
            self._read.add(said.topic)
        kind = MessageType(said.ros_type, self.version)
        return self.translator.take(said.topic, kind, said.data, said.at_ns).scans

    @property
    def counts(self) -> Any:
        (counts,) = self.translator.lasers.counts.values()
        return counts


def _in_order(said: Iterable[Said]) -> list[Said]:
    return sorted(said, key=lambda each: each.at_ns)


def _check(room: LaserRoom, scans: list[RobotScan], atol: float = 1e-3) -> None:
    """Every beam of every scan begins, points and ends where the room says."""
    for each in scans:
        scan = each.scan
        t = (scan.stamp_ns - room.ns(0)) / 1e9
        ends = scan.origins + scan.ranges[:, None] * np.stack(
            [np.cos(scan.bearings), np.sin(scan.bearings)], axis=1
        )
        angles = room.first_angle + np.arange(room.beams) * math.tau / room.beams
        times = t + np.arange(room.beams) * room.turn_s / room.beams
        poses = room.lasers(times)
        np.testing.assert_allclose(poses[:, :2, 3], scan.origins, atol=atol)
        local = np.stack([np.cos(angles), np.sin(angles), 0 * angles, 0 * angles], axis=1)
        directions = np.einsum("nij,nj->ni", poses, local)[:, :2]
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        away = ranges_of(poses[:, :2, 3], directions, [*WALLS, *room.state(t)])
        np.testing.assert_allclose(poses[:, :2, 3] + away[:, None] * directions, ends, atol=0.02)
        steps = np.diff(scan.bearings)
        assert (steps > 0).all() or (steps < 0).all()
        assert (abs(steps) < math.pi).all()


@pytest.mark.parametrize("version", [1, 2])
def test_each_beam_is_where_the_laser_was_at_its_moment(version: Any) -> None:
    """Through map -> odom -> base -> laser, while the robot drives and turns."""
    room = LaserRoom(version=version, seconds=4.0)

    scans = Hearing(version=version).hear(room.said())

    assert 31 <= len(scans)
    _check(room, scans)
    first = scans[0]
    assert (first.scan.laser, first.scan.robot, first.scan.max_range) == ("laser", "", 12.0)
    x, y, theta = first.pose.x, first.pose.y, first.pose.theta
    t = (first.scan.stamp_ns - room.ns(0)) / 1e9
    np.testing.assert_allclose(room.base(t)[:2, 3], [x, y], atol=1e-3)
    np.testing.assert_allclose(room.base(t)[:2, 0], [math.cos(theta), math.sin(theta)], atol=1e-3)


@pytest.mark.parametrize(
    "mount",
    [
        moved(0.1, 0.0, 0.4) @ turned("x", math.pi),
        moved(0.1, 0.1, 0.4) @ turned("z", 2.0) @ turned("x", math.pi),
        moved(-0.2, 0.0, 0.4) @ turned("y", math.radians(1)),
    ],
    ids=["upside down", "upside down and turned", "nearly level"],
)
def test_a_laser_may_hang_upside_down(mount: Any) -> None:
    """Its angles run the other way round on the map."""
    room = LaserRoom(seconds=2.0, mount=mount)

    scans = Hearing().hear(room.said())

    assert 14 <= len(scans)
    _check(room, scans)


def test_a_tilted_laser_measures_along_the_floor_and_not_the_floor() -> None:
    """Ten degrees down at 0.4 m over the floor: it meets the floor after 2 m, which is no wall."""
    room = LaserRoom(seconds=1.0, mount=moved(0.0, 0.0, 0.4) @ turned("y", math.radians(10)),
                     drive=lambda t: moved(6.0, 0.0))  # fmt: skip
    flat = [room.sent(room.scan(t, ranges=np.full(360, 2.2, np.float32)), t + 0.1) for t in (0.5,)]

    (each,) = Hearing().hear(_in_order([*room.statics(), *room.tf(), *flat]))

    ahead, aside, slanted = (
        np.argmin(abs(np.remainder(each.scan.bearings - math.radians(at) + 3, math.tau) - 3))
        for at in (0, 90, 150)
    )
    assert math.isnan(each.scan.ranges[ahead])
    assert pytest.approx(2.2, abs=1e-3) == each.scan.ranges[aside]
    rise = math.sin(math.radians(10)) * math.cos(math.radians(150))
    assert pytest.approx(2.2 * math.sqrt(1 - rise**2), rel=1e-3) == each.scan.ranges[slanted]


def test_a_laser_that_looks_down_is_refused() -> None:
    """It sees stairs, not doors."""
    room = LaserRoom(seconds=1.0, mount=turned("y", math.radians(60)))
    hearing = Hearing()

    assert [] == hearing.hear(room.said())
    assert any("down: by 60 degrees" in each for each in hearing.told)


def test_a_scan_waits_for_the_transforms_of_its_last_beam() -> None:
    """It came before them: localisation takes its time."""
    room = LaserRoom(seconds=3.0)
    late = [replace(each, at_ns=each.at_ns + 10**9) for each in room.tf()]
    hearing = Hearing()

    scans = hearing.hear(_in_order([*room.statics(), *room.scans(), *late]))

    assert 22 <= len(scans)
    _check(room, scans)


def test_scans_without_localisation_are_dropped_and_told_why() -> None:
    """By the frames that there are."""
    room = LaserRoom(seconds=4.0)
    hearing = Hearing()

    said = _in_order([*room.statics(), *room.tf(localised=False), *room.scans()])

    assert [] == hearing.hear(said)
    assert [] == hearing.translator.rest()
    assert 32 == hearing.counts.received == hearing.counts.dropped
    assert "laser on base_link" in hearing.complaints.lines()[0]
    assert "(32 times)" in hearing.complaints.lines()[0]


def test_scans_while_transforms_stay_away_are_dropped() -> None:
    """Two seconds without odometry, in which the robot drove on: nobody knows where it was."""
    room = LaserRoom(seconds=8.0)
    holes = [each for each in room.tf() if not 2.0 < (each.at_ns - room.ns(0)) / 1e9 < 5.0]
    hearing = Hearing()

    scans = hearing.hear(_in_order([*room.statics(), *holes, *room.scans()]))

    _check(room, scans)
    times = [(each.scan.stamp_ns - room.ns(0)) / 1e9 for each in scans]
    assert not [t for t in times if 2.0 < t < 4.9]
    assert [t for t in times if t < 2.0]
    assert [t for t in times if t > 5.0]
    lines = hearing.complaints.lines()
    assert any("without a TF position" in line and "odom -> base_link" in line for line in lines)


def test_a_robot_that_stood_is_where_it_stood() -> None:
    """A hole says nothing of a robot that has not moved meanwhile."""
    room = LaserRoom(seconds=8.0, drive=lambda _: moved(3.0, 0.0))
    holes = [each for each in room.tf() if not 2.0 < (each.at_ns - room.ns(0)) / 1e9 < 4.5]
    hearing = Hearing()

    scans = hearing.hear(_in_order([*room.statics(), *holes, *room.scans()]))

    times = [(each.scan.stamp_ns - room.ns(0)) / 1e9 for each in scans]
    assert 10 <= len([t for t in times if 2.7 < t < 4.4])
    _check(room, scans)


def _jumping(room: LaserRoom, metres: float) -> Iterator[Said]:
    """Transforms whose localisation puts the robot elsewhere at 2 s, once in half a second."""
    yield from room.tf(localised=False)
    for i in range(9):
        t = i / 2
        shift = moved(0.0, metres if t >= 2 else 0.0)
        link = room.link("map", "odom", shift @ room.map_to_odom, t)
        yield room.transforms("tf", t, [link])


def test_no_scan_lies_between_two_places_of_a_jump() -> None:
    """Half way between them the robot never was; as if it had driven through the wall."""
    room = LaserRoom(seconds=4.0)
    hearing = Hearing()

    scans = hearing.hear(_in_order([*room.statics(), *_jumping(room, 3.0), *room.scans()]))

    offs = {
        round(each.pose.y - room.base((each.scan.stamp_ns - room.ns(0)) / 1e9)[1, 3], 2)
        for each in scans
    }
    assert {0.0, 3.0} == offs
    jump = hearing.counts.worst_jump
    assert 1 <= hearing.counts.jumps
    assert pytest.approx(3.0, abs=0.01) == jump.metres
    assert room.ns(2.0) == jump.stamp_ns
    assert any("the pose jumped: 3.00 m" in line for line in hearing.complaints.lines())


def test_a_small_correction_is_no_jump() -> None:
    """Localisation makes them all the time."""
    room = LaserRoom(seconds=4.0)
    hearing = Hearing()

    scans = hearing.hear(_in_order([*room.statics(), *_jumping(room, 0.1), *room.scans()]))

    assert 27 <= len(scans)
    assert 0 == hearing.counts.jumps


@pytest.mark.parametrize("kind", [POSE_WITH_COVARIANCE, ODOMETRY])
def test_a_topic_of_poses_puts_odometry_on_the_map(kind: str) -> None:
    """Three a second are enough: in between the odometry counts."""
    room = LaserRoom(seconds=5.0)
    mapping = RosMapping(scans=ReadScan(pose_topic="/amcl_pose"))
    elsewhere = LaserRoom(seconds=5.0, map_to_odom=moved(50.0, 50.0))
    tf = [
        room.transforms("tf", i / 5, [room.link("map", "odom", elsewhere.map_to_odom, i / 5)])
        for i in range(25)
    ]
    said = [*room.statics(), *room.tf(localised=False), *tf, *room.poses(kind=kind), *room.scans()]

    scans = Hearing(mapping).hear(_in_order(said))

    assert 35 <= len(scans)
    _check(room, scans)
    assert {(0.2, 0.1)} == {(s.scan.sd_xy, s.scan.sd_theta) for s in scans}


def test_a_topic_of_poses_does_without_odometry() -> None:
    """Then the robot was between two of them where the line between them leads."""
    room = LaserRoom(seconds=5.0)
    mapping = RosMapping(scans=ReadScan(pose_topic="/amcl_pose"))

    scans = Hearing(mapping).hear(_in_order([*room.statics(), *room.poses(hz=20.0), *room.scans()]))

    assert 35 <= len(scans)
    _check(room, scans, atol=5e-3)


@pytest.mark.parametrize(("begins_s", "is_known"), [(0.0, True), (120.0, False)])
def test_how_sure_the_robot_is_comes_from_its_last_pose(begins_s: float, is_known: bool) -> None:
    """Beside TF: of /amcl_pose the covariance counts, for scans within a minute."""
    (told, *_) = LaserRoom().poses()
    scans = Hearing().hear(_in_order([*LaserRoom(seconds=2.0, begins_s=begins_s).said(), told]))

    expected = (0.2, 0.1) if is_known else (math.nan, math.nan)
    for each in scans[1:]:
        for found in (each.scan, each.pose):
            assert expected == pytest.approx((found.sd_xy, found.sd_theta), nan_ok=True)
    assert len(scans) > 10


def test_a_robot_that_turns_faster_than_its_laser_sees_in_no_order() -> None:
    """Its beams go back and forth: such a scan is none."""
    room = LaserRoom(
        seconds=2.0, turn_s=0.9, scan_hz=1.0, tf_hz=100.0,
        drive=lambda t: moved(3.0, 0.0) @ turned("z", -2 * math.sin(4 * t)),
    )  # fmt: skip
    hearing = Hearing()

    assert [] == hearing.hear(room.said())
    assert any("turned faster than the laser" in each for each in hearing.told)


def test_a_quaternion_that_is_a_little_too_long_is_the_same_turn() -> None:
    """As it is rounded by some: it does not stretch what hangs on it."""
    room = LaserRoom(seconds=1.0)
    link = room.link("base_link", "laser", room.mount, 0.0)
    for part in "xyzw":
        turn = link.transform.rotation
        setattr(turn, part, 1.009 * getattr(turn, part))
    fixed = room.transforms("tf_static", 0.0, [link])

    scans = Hearing().hear(_in_order([fixed, *room.tf(), *room.scans()]))

    assert 6 <= len(scans)
    _check(room, scans)


def test_a_topic_below_a_name_that_has_no_frames_is_of_the_only_robot() -> None:
    """/front/scan is the laser in front, not a robot called so."""
    room = LaserRoom(seconds=1.0)
    said = [
        replace(each, topic="/front/scan") if each.topic == "/scan" else each
        for each in room.said()
    ]

    scans = Hearing().hear(said)

    assert {""} == {each.scan.robot for each in scans}


def test_two_robots_with_frames_of_the_same_names() -> None:
    """Each has its own topics of TF: /a/tf places /a/scan."""
    one = LaserRoom(seconds=2.0, namespace="/a")
    other = LaserRoom(seconds=2.0, namespace="/b", drive=lambda t: moved(8.0 - t, 0.2))
    hearing = Hearing()

    scans = hearing.hear(_in_order([*one.said(), *other.said()]))

    for name, room in (("a", one), ("b", other)):
        its = [each for each in scans if each.scan.robot == name]
        assert 14 <= len(its)
        _check(room, its)


def test_two_robots_whose_frames_have_their_names() -> None:
    """In one /tf; the mapping says whose the scans are."""
    one = LaserRoom(seconds=2.0, prefix="a/")
    other = LaserRoom(seconds=2.0, prefix="b/", drive=lambda t: moved(8.0 - t, 0.2))
    topics = {f"/scan_{name}": TopicRule(ReadScan(robot=name)) for name in "ab"}
    said = [
        replace(each, topic=f"/scan_{name}") if each.ros_type == LASER_SCAN else each
        for name, room in (("a", one), ("b", other))
        for each in room.said()
    ]

    scans = Hearing(RosMapping(topics)).hear(_in_order(said))

    for name, room in (("a", one), ("b", other)):
        its = [each for each in scans if each.scan.robot == name]
        assert 14 <= len(its)
        _check(room, its)
        np.testing.assert_allclose(
            room.base((its[0].scan.stamp_ns - room.ns(0)) / 1e9)[:2, 3],
            [its[0].pose.x, its[0].pose.y], atol=1e-3,
        )  # fmt: skip


def test_stamps_that_repeat_or_go_back_are_dropped_and_counted() -> None:
    """The same look is not two; and a scan without a stamp has no moment."""
    room = LaserRoom(seconds=4.0)
    times = [0.5, 0.6, 0.6, 0.4, 0.7]
    sent = [room.sent(room.scan(t), 1.0 + i / 50) for i, t in enumerate(times)]
    unset = room.sent(room.scan(0.8, header=room.robot.header(0, "laser")), 1.5)
    hearing = Hearing()

    scans = hearing.hear(_in_order([*room.statics(), *room.tf(), *sent, unset]))

    assert [0.5, 0.6, 0.7] == [(each.scan.stamp_ns - room.ns(0)) / 1e9 for each in scans]
    assert (6, 3, 2) == (
        hearing.counts.received, hearing.counts.placed, hearing.counts.repeated,
    )  # fmt: skip
    text = "\n".join(hearing.complaints.lines())
    assert "a scan whose stamp does not advance" in text
    assert "a scan without a stamp" in text


def test_a_stray_transform_costs_no_scan() -> None:
    """One from an hour ahead, as a node with another clock sends it."""
    room = LaserRoom(seconds=3.0)
    link = room.link("odom", "base_link", moved(0, 0), 3600.0)
    stray = replace(room.transforms("tf", 1.0, [link]), at_ns=room.ns(1.0))
    hearing = Hearing()

    scans = hearing.hear(_in_order([*room.said(), stray]))

    assert 23 <= len(scans)
    _check(room, scans)
    lines = hearing.complaints.lines()
    assert any("odom -> base_link: 3599.0 s" in line for line in lines)


def test_a_scan_from_the_future_holds_up_no_other() -> None:
    """It waits for transforms that will not come, and those behind it do not wait with it."""
    room = LaserRoom(seconds=3.0)
    ahead = room.scan(1.0, header=room.robot.header(room.ns(3600.0), "laser"))
    hearing = Hearing()

    scans = hearing.hear(_in_order([*room.said(), room.sent(ahead, 1.01)]))

    assert 22 <= len(scans)
    _check(room, scans)
    assert hearing.counts.received - hearing.counts.placed <= 3


def test_a_pose_from_the_future_holds_up_no_other() -> None:
    """Nor does one that is older than all odometry."""
    room = LaserRoom(seconds=4.0)
    mapping = RosMapping(scans=ReadScan(pose_topic="/amcl_pose"))
    odd = [
        replace(next(iter(LaserRoom(begins_s=at).poses())), at_ns=room.ns(0.5))
        for at in (3600.0, -3600.0)
    ]
    poses = [*odd, *list(room.poses())[2:]]
    said = [*room.statics(), *room.tf(localised=False), *poses, *room.scans()]

    scans = Hearing(mapping).hear(_in_order(said))

    assert 20 <= len(scans)
    _check(room, scans)


def test_a_circle_of_frames_places_nothing() -> None:
    """And is told as what it is."""
    room = LaserRoom(seconds=4.0)
    wrong = [room.link("laser", "base_link", moved(0, 0), 0.0)]
    hearing = Hearing()

    said = [*room.statics(), room.transforms("tf_static", 0.1, wrong), *room.scans()]

    assert [] == hearing.hear(_in_order(said)) + hearing.translator.rest()
    assert "laser on base_link" in hearing.complaints.lines()[0]


_BAD = st.sampled_from([0.0, -1.0, 1e-9, 1e30, math.nan, math.inf, -math.inf, 3.2, 1e6])


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.lists(
        st.tuples(
            st.dictionaries(
                st.sampled_from([
                    "angle_min", "angle_max", "angle_increment", "time_increment", "range_min",
                    "range_max",
                ]),
                _BAD,
            ),
            st.integers(0, 400),
            _BAD,
            st.sampled_from([0.0, 0.4, 1.0, 1.01, 5.0, 1e4]),
        ),
        max_size=6,
    ),
    st.lists(st.tuples(st.sampled_from(["map", "odom", "base_link", "laser"]),
                       st.sampled_from(["map", "odom", "base_link", "laser"]), _BAD,
                       st.sampled_from([0.0, 1.0, 3.0, 1e4])), max_size=6),
)  # fmt: skip
def test_whatever_comes_a_scan_that_is_placed_is_one(scans: Any, links: Any) -> None:
    """Nothing raises; what comes out is finite, in order, and beams that point one way round."""
    room = LaserRoom(seconds=1.5, beams=24)
    sent = []
    for i, (values, beams, value, t) in enumerate(scans):
        ranges = np.full(beams, value, np.float32)
        sent.append(room.sent(room.scan(t, **({"ranges": ranges} | values)), 0.5 + i / 9))
    odd = [
        room.transforms("tf", 0.3, [room.link(parent, child, moved(x, 0.0), t)])
        for parent, child, x, t in links
    ]
    hearing = Hearing()

    found = hearing.hear(_in_order([*room.said(), *sent, *odd])) + hearing.translator.rest()

    stamps = [each.scan.stamp_ns for each in found]
    assert sorted(set(stamps)) == stamps
    for each in found:
        scan = each.scan
        assert len(scan.origins) == len(scan.bearings) == len(scan.ranges) >= 2
        assert np.isfinite(scan.origins).all()
        assert np.isfinite(scan.bearings).all()
        assert not (scan.ranges < 0).any()
        assert 0 < scan.max_range < math.inf
        steps = np.diff(scan.bearings)
        assert (steps > 0).all() or (steps < 0).all()
        assert (abs(steps) < math.pi).all()
    assert hearing.counts.received == hearing.counts.placed + hearing.counts.dropped
