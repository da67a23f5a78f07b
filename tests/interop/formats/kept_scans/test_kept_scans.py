"""Scans that are kept beside a log are read back, whole or torn, by us and by others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semmap_log.analysis.scans.visit import KeptVisit, PlacedScan, Visit, scans_folder
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.errors import OutputError
from semmap_log.interop.formats.kept_scans.reading import (
    has_kept_scans,
    kept_visits,
    scans_of_event,
)
from semmap_log.interop.formats.kept_scans.writing import KeptScansWriter, keeping_scans
from tests.analysis.scans.some_scans import LINE, seen_visit
from tests.analysis.scans.some_visits import S, some_visit
from tests.interop.formats.kept_scans.torn import chunks_at

LOG_ID = "0123"


def _keep(log: Path, visits: Sequence[tuple[Visit, Sequence[PlacedScan]]]) -> Path:
    with keeping_scans(log, LOG_ID) as writer:
        for number, (visit, scans) in enumerate(visits):
            writer.keep(visit, line=LINE, level=2, scans=scans, event=number)
        assert writer.path is not None
        return writer.path


def _read(log: Path, **how: object) -> list[KeptVisit]:
    return list(kept_visits(log, LOG_ID, **how))  # type: ignore[arg-type]


def _assert_same(kept: KeptVisit, visit: Visit, scans: Sequence[PlacedScan]) -> None:
    assert repr(kept.visit) == repr(visit)  # NaN is like NaN
    assert [scan.stamp_ns for scan in kept.scans] == [scan.stamp_ns for scan in scans]
    for got, expected in zip(kept.scans, scans, strict=True):
        np.testing.assert_allclose(got.origins, expected.origins, atol=1e-6)
        np.testing.assert_allclose(got.bearings, expected.bearings, atol=2e-6)
        np.testing.assert_allclose(got.ranges, expected.ranges, rtol=1e-6)
        assert (got.laser, got.robot) == (expected.laser, expected.robot)
        assert got.max_range == pytest.approx(expected.max_range)
        np.testing.assert_allclose([got.sd_xy, got.sd_theta], [expected.sd_xy, expected.sd_theta])


def test_visits_and_their_scans_come_back(tmp_path: Path) -> None:
    """With the door's line, its level, and the event that each became."""
    first = seen_visit(0, opening=math.nan, behind_m=0.1, side=1)
    second = seen_visit(30, leaf=None, robot="rover")

    path = _keep(tmp_path / "office", [first, second])

    assert path.parent == scans_folder(tmp_path / "office") == tmp_path / "office.scans"
    one, other = _read(tmp_path / "office")
    _assert_same(one, *first)
    _assert_same(other, *second)
    assert [(kept.level, kept.line, kept.event) for kept in (one, other)] == [
        (2, LINE, 0), (2, LINE, 1),
    ]  # fmt: skip


def test_beams_that_were_not_measured_or_lost_stay_so(tmp_path: Path) -> None:
    """NaN and inf; and of a pose of which nothing is told, that."""
    visit, (scan, *_) = seen_visit(0)
    ranges = scan.ranges.copy()
    ranges[:4] = [math.nan, math.inf, 0.5, math.nan]
    scan = replace(scan, ranges=ranges, sd_xy=math.nan, sd_theta=math.nan)

    _keep(tmp_path / "office", [(visit, [scan])])

    _assert_same(_read(tmp_path / "office")[0], visit, [scan])


def test_a_laser_that_moves_while_it_turns_is_kept_beam_by_beam(tmp_path: Path) -> None:
    """A LaserScan has one place, and even angles: these have neither."""
    visit, (scan, *_) = seen_visit(0)
    moving = np.linspace(0, 0.1, len(scan.ranges))[:, None] * [1.0, 0.5]
    scan = replace(
        scan,
        origins=scan.origins + moving,
        bearings=scan.bearings + 0.05 * np.sin(scan.bearings),
        ranges=np.where(np.arange(180) % 7 == 0, math.inf, scan.ranges),
    )

    _keep(tmp_path / "office", [(visit, [scan])])

    _assert_same(_read(tmp_path / "office")[0], visit, [scan])


def test_a_scan_of_several_visits_is_written_once(tmp_path: Path) -> None:
    """Doors beside each other are seen by the same scans."""
    visit, scans = seen_visit(0, scans=40)
    others = [replace(visit, door_id=DoorId(n)) for n in range(2, 8)]

    alone = _keep(tmp_path / "one", [(visit, scans)]).stat().st_size
    together = _keep(tmp_path / "six", [(other, scans) for other in others]).stat().st_size

    assert together < 1.5 * alone
    for kept, other in zip(_read(tmp_path / "six"), others, strict=True):
        _assert_same(kept, other, scans)


def test_a_killed_recorder_leaves_what_it_was_told(tmp_path: Path) -> None:
    """Each visit is on its way to the disk once it is kept; the file's end is missing."""
    visit, scans = seen_visit(0)
    writer = KeptScansWriter(tmp_path / "office", LOG_ID)
    writer.keep(visit, line=LINE, level=0, scans=scans)
    told: list[str] = []

    (kept,) = _read(tmp_path / "office", tell=told.append)

    _assert_same(kept, visit, scans)
    assert "its end was never written" in told[0]
    writer.close()
    writer.close()
    told.clear()
    _assert_same(_read(tmp_path / "office", tell=told.append)[0], visit, scans)
    assert not told


def test_a_torn_file_is_read_up_to_its_tear(tmp_path: Path) -> None:
    """Wherever it is cut: whole visits with all their scans, and never an error."""
    visits = [seen_visit(30 * n, scans=2) for n in range(3)]
    path = _keep(tmp_path / "office", visits)
    whole = path.read_bytes()
    found = set()

    for size in range(0, len(whole), 97):
        path.write_bytes(whole[:size])
        kept = _read(tmp_path / "office")
        found.add(len(kept))
        for one, (visit, scans) in zip(kept, visits, strict=False):
            _assert_same(one, visit, scans)

    assert found == {0, 1, 2, 3}


def test_a_damaged_file_is_read_up_to_there_and_told(tmp_path: Path) -> None:
    """A flipped byte in the last chunk leaves the visits before it."""
    visits = [seen_visit(30 * n, scans=2) for n in range(3)]
    path = _keep(tmp_path / "office", visits)
    data = bytearray(path.read_bytes())
    data[chunks_at(path)[2] + 100] ^= 0xFF
    path.write_bytes(data)
    told: list[str] = []

    kept = _read(tmp_path / "office", tell=told.append)

    assert len(kept) == 2
    assert "read up to where it is damaged" in told[0]


def test_zeros_behind_a_power_cut_are_no_visits(tmp_path: Path) -> None:
    """Blocks that were given to the file, and never written."""
    path = _keep(tmp_path / "office", [seen_visit(30 * n) for n in range(2)])
    path.write_bytes(path.read_bytes()[: chunks_at(path)[1]] + bytes(4096))
    told: list[str] = []

    assert len(_read(tmp_path / "office", tell=told.append)) == 1
    assert "its end was never written" in told[0]


def test_each_run_has_a_file_of_its_own(tmp_path: Path) -> None:
    """Nothing that is there is written to; a visit that is kept twice is read once."""
    first = _keep(tmp_path / "office", [seen_visit(0)])
    before = first.read_bytes()

    second = _keep(tmp_path / "office", [seen_visit(0), seen_visit(30)])

    assert first != second
    assert first.read_bytes() == before
    assert len(_read(tmp_path / "office")) == 2


def test_without_a_visit_there_is_no_file(tmp_path: Path) -> None:
    """Nor a folder."""
    with keeping_scans(tmp_path / "office", LOG_ID):
        pass

    assert not list(tmp_path.iterdir())
    assert not has_kept_scans(tmp_path / "office")
    assert _read(tmp_path / "office") == []


def test_scans_of_another_log_are_passed_over(tmp_path: Path) -> None:
    """A log that was removed may have had the same name."""
    _keep(tmp_path / "office", [seen_visit(0)])
    told: list[str] = []

    assert not list(kept_visits(tmp_path / "office", "4567", tell=told.append))
    assert "these are scans of another log" in told[0]


def test_some_visits_are_asked_for(tmp_path: Path) -> None:
    """By time, by door; and those without their scans that nobody wants to see."""
    visits = [seen_visit(30 * n, door_id=1 + n % 2) for n in range(4)]
    _keep(tmp_path / "office", visits)
    second_ns, last_ns = visits[1][0].last_ns, visits[3][0].last_ns

    between = _read(tmp_path / "office", since_ns=second_ns, until_ns=last_ns)
    of_a_door = _read(tmp_path / "office", doors=[DoorId(2)])
    bare = _read(tmp_path / "office", with_scans=lambda visit: visit.last_ns == last_ns)

    assert [kept.event for kept in between] == [1, 2]
    assert [kept.event for kept in of_a_door] == [1, 3]
    assert [len(kept.scans) for kept in bare] == [0, 0, 0, 5]


def test_an_event_finds_its_scans(tmp_path: Path) -> None:
    """By its door and when it happened, anywhere in the visit."""
    (visit, scans), (later, _) = seen_visit(0), seen_visit(30)
    _keep(tmp_path / "office", [(visit, scans), (later, scans)])

    for happened_ns in (visit.first_ns, visit.last_ns):
        kept = scans_of_event(
            tmp_path / "office", LOG_ID, door_id=visit.door_id, happened_ns=happened_ns
        )
        assert kept is not None
        _assert_same(kept, visit, scans)
    assert not scans_of_event(tmp_path / "office", LOG_ID, door_id=DoorId(9),
                              happened_ns=visit.last_ns)  # fmt: skip
    assert not scans_of_event(tmp_path / "office", LOG_ID, door_id=visit.door_id,
                              happened_ns=visit.last_ns + S)  # fmt: skip


def test_a_passage_needs_no_scans(tmp_path: Path) -> None:
    """It is told by the robot's way."""
    passing = some_visit(7, 0, passed=True, state=DoorState.OPEN)

    _keep(tmp_path / "office", [(passing, [])])

    (kept,) = _read(tmp_path / "office")
    assert (kept.visit.passed, kept.scans) == (True, ())


def test_where_nothing_can_be_written_it_is_told(tmp_path: Path) -> None:
    """A file stands where the folder would be."""
    (tmp_path / "office.scans").write_text("", encoding="utf-8")

    with pytest.raises(OutputError, match=r"office\.scans"):
        _keep(tmp_path / "office", [seen_visit(0)])


@pytest.mark.parametrize(
    "names", [("", "base_laser"), ("rover/1", "laser front"), ("機械", "雷射")]
)
def test_robots_and_lasers_may_be_called_anything(names: tuple[str, str], tmp_path: Path) -> None:
    """Topics bear what ROS allows of their names; two that are spelt alike are told apart."""
    robot, laser = names
    visits = [seen_visit(30 * n, robot=robot, laser=laser + "!" * n) for n in range(2)]

    path = _keep(tmp_path / "office", visits)

    for kept, (visit, scans) in zip(_read(tmp_path / "office"), visits, strict=True):
        _assert_same(kept, visit, scans)
    topics = _topics(path)
    assert len(topics) == 6  # /tf, /visits, and pose and scan of both lasers
    assert all(topic.replace("/", "").replace("_", "").isalnum() for topic in topics)
    assert all(topic.isascii() for topic in topics)


def test_others_read_it(tmp_path: Path) -> None:
    """The mcap library with rosbags' decoder: standard messages, at the scans' own times."""
    from rosbags.highlevel import AnyReader

    visit, scans = seen_visit(0, robot="rover")
    scans[0] = replace(scans[0], sd_xy=math.nan, sd_theta=math.nan)
    path = _keep(tmp_path / "office", [(visit, scans)])

    with AnyReader([path]) as reader:
        types = {connection.topic: connection.msgtype for connection in reader.connections}
        messages = [
            (connection.topic, at_ns, reader.deserialize(data, connection.msgtype))
            for connection, at_ns, data in reader.messages()
        ]

    assert types == {
        "/tf": "tf2_msgs/msg/TFMessage",
        "/visits": "std_msgs/msg/String",
        "/rover/laser/pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "/rover/laser/scan": "sensor_msgs/msg/LaserScan",
    }
    assert [at for topic, at, _ in messages if topic == "/tf"] == [s.stamp_ns for s in scans]
    poses = [m.pose.covariance for topic, _, m in messages if topic.endswith("/pose")]
    assert [poses[0][0], poses[0][35]] == [-1.0, -1.0]  # not told
    np.testing.assert_allclose([poses[1][0], poses[1][7], poses[1][35]], [0.0025, 0.0025, 0.0004])
    frames = {m.transforms[0].child_frame_id for topic, _, m in messages if topic == "/tf"}
    assert frames == {m.header.frame_id for topic, _, m in messages if topic.endswith("/scan")}


def _topics(path: Path) -> set[str]:
    from mcap.reader import make_reader

    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        return {channel.topic for channel in summary.channels.values()}
