"""Simulated bags: read back by rosbags, their frames composed, their truth beside them."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

import semmap_log as sl
from patrol_sim.laser_bag import FORMATS, Told, write_bag, write_doors, write_truth
from patrol_sim.laser_pose import Localisation, PoseError, localised
from patrol_sim.laser_world import START_NS, Patrol
from patrol_sim.tests.corridor import building, patrol
from semmap_log.errors import OutputError
from semmap_log.interop.importing.importing import ImportOptions, import_file

ERROR = PoseError(0.05, 1.0)
SHORT_MIN = 0.4
TOOL = Path(__file__).parents[2] / "make_patrol_bag.py"
TYPES = {
    "/scan": "sensor_msgs/msg/LaserScan",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/amcl_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
}


def short(*, upside_down: bool = False) -> Patrol:
    return patrol(minutes=SHORT_MIN, upside_down=upside_down)


def where(*, upside_down: bool = False) -> Localisation:
    return localised(short(upside_down=upside_down).track, ERROR, seed=3)


def written(folder: Path, form: str, **options: Any) -> Path:
    path = folder / ("patrol.bag" if form == "ros1" else "patrol")
    usual = {"told": Told(0.05, 1.0)}
    upside_down = options.pop("upside_down", False)
    one = short(upside_down=upside_down)
    write_bag(path, one, where(upside_down=upside_down), form=form, **{**usual, **options})
    return path


def messages(path: Path) -> dict[str, list[tuple[int, Any]]]:
    found: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with AnyReader([path]) as reader:
        assert {c.topic: c.msgtype for c in reader.connections}.items() <= TYPES.items()
        for connection, at_ns, data in reader.messages():
            found[connection.topic].append((at_ns, reader.deserialize(data, connection.msgtype)))
    return found


def ns(stamp: Any) -> int:
    return stamp.sec * 10**9 + stamp.nanosec


def matrix(place: Any, turn: Any) -> np.ndarray:
    """Return a transform as 4 x 4, from its quaternion as the textbooks have it."""
    x, y, z, w = turn.x, turn.y, turn.z, turn.w
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), place.x],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), place.y],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), place.z],
        [0, 0, 0, 1],
    ])  # fmt: skip


@pytest.mark.parametrize("form", FORMATS)
def test_bag_is_read_back(tmp_path: Path, form: str) -> None:
    """
    All topics with their ROS types; every scan with its ranges; stamps that begin at the patrol.
    """
    found = messages(written(tmp_path, form))

    assert set(found) == set(TYPES)
    assert [m.header.frame_id for _, m in found["/scan"][:1]] == ["laser"]
    scans = short().scans
    assert len(found["/scan"]) == len(scans)
    for (_, message), scan in zip(found["/scan"], scans, strict=True):
        assert ns(message.header.stamp) == START_NS + round(scan.at_s * 1e9)
        assert message.ranges.tolist() == scan.ranges.astype(np.float32).tolist()
        assert message.angle_min + 179 * message.angle_increment == pytest.approx(message.angle_max)


@pytest.mark.parametrize("form", ["ros1", "mcap"])
def test_same_patrol_same_bytes(tmp_path: Path, form: str) -> None:
    texts = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        path = written(tmp_path / name, form)
        files = [path] if path.is_file() else sorted(path.iterdir())
        texts.append([file.read_bytes() for file in files])

    assert texts[0] == texts[1]


def test_same_patrol_same_messages_in_sqlite3(tmp_path: Path) -> None:
    found = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        with AnyReader([written(tmp_path / name, "sqlite3")]) as reader:
            found.append([(c.topic, at_ns, data) for c, at_ns, data in reader.messages()])

    assert found[0] == found[1]


def test_scan_is_recorded_after_its_last_beam(tmp_path: Path) -> None:
    """So the transforms for all its beams were there, and times in the bag run forward."""
    found = messages(written(tmp_path, "mcap"))

    for at_ns, scan in found["/scan"]:
        turn_ns = scan.time_increment * (len(scan.ranges) - 1) * 1e9
        assert at_ns >= ns(scan.header.stamp) + turn_ns
    for stamped in found.values():
        times = [at_ns for at_ns, _ in stamped]
        assert times == sorted(times)


@pytest.mark.parametrize("upside_down", [False, True])
@pytest.mark.parametrize("form", ["ros1", "mcap"])
def test_frames_compose_to_what_is_believed(tmp_path: Path, form: str, upside_down: bool) -> None:
    """
    map -> odom -> base_link -> laser, multiplied as matrices: each beam begins and points where
    the simulation's own placing says, the laser hung upside down or not.
    """
    found = messages(written(tmp_path, form, upside_down=upside_down))
    chain: dict[tuple[str, str], dict[int, np.ndarray]] = defaultdict(dict)
    for topic in ("/tf", "/tf_static"):
        for _, message in found[topic]:
            for t in message.transforms:
                frames = t.header.frame_id, t.child_frame_id
                moved = matrix(t.transform.translation, t.transform.rotation)
                chain[frames][ns(t.header.stamp)] = moved
    assert set(chain) == {("map", "odom"), ("odom", "base_link"), ("base_link", "laser")}
    [laser] = chain["base_link", "laser"].values()
    one, believed = short(upside_down=upside_down), where(upside_down=upside_down)
    scan = found["/scan"][0][1]

    for stamp_ns, correction in list(chain["map", "odom"].items())[::20]:
        placed = correction @ chain["odom", "base_link"][stamp_ns] @ laser
        base = believed.believed_at(np.full(one.laser.beams, (stamp_ns - START_NS) / 1e9))
        beams = one.laser.placed(base, as_told=True)
        for beam in (0, 60, 179):
            angle = scan.angle_min + beam * scan.angle_increment
            to = placed[:3, :3] @ [math.cos(angle), math.sin(angle), 0]
            assert placed[:2, 3] == pytest.approx(beams.origins[beam], abs=1e-6)
            assert to == pytest.approx([*beams.to[beam], 0], abs=1e-5)


def test_rates_of_transforms(tmp_path: Path) -> None:
    """Ten corrections a second, odometry as often as asked for."""
    found = messages(written(tmp_path, "mcap", odom_hz=20))
    counts = Counter(t.child_frame_id for _, m in found["/tf"] for t in m.transforms)

    assert counts["odom"] == pytest.approx(10 * 60 * SHORT_MIN, abs=2)
    assert counts["base_link"] == pytest.approx(20 * 60 * SHORT_MIN, abs=2)


def test_pose_tells_its_covariance_or_is_not_there(tmp_path: Path) -> None:
    """Variances of x, y and the heading; and no topic where nothing is told."""
    found = messages(written(tmp_path, "mcap", told=Told(0.2, 4.0)))
    covariance = found["/amcl_pose"][5][1].pose.covariance
    (tmp_path / "b").mkdir()

    assert covariance[[0, 7]].tolist() == pytest.approx([0.04, 0.04])
    assert covariance[35] == pytest.approx(math.radians(4) ** 2)
    assert "/amcl_pose" not in messages(written(tmp_path / "b", "mcap", told=None))


def test_map_is_the_plans(tmp_path: Path) -> None:
    [(_, grid)] = messages(written(tmp_path, "ros1"))["/map"]
    floor = short().plan.floor

    assert grid.header.frame_id == "map"
    assert (grid.info.height, grid.info.width) == floor.cells.shape
    assert grid.data.tolist() == floor.cells.ravel().tolist()
    assert grid.info.origin.position.x == floor.origin_x


def test_truth_agrees_with_the_world(tmp_path: Path) -> None:
    """At any moment the row before it says how the door stood."""
    path = tmp_path / "truth.json"
    write_truth(path, patrol(), where(), ERROR)
    told = json.loads(path.read_text())

    assert told["start_ns"] == START_NS
    assert {
        d["door_id"]: d["driven_through_s"] for d in told["doors"] if d["driven_through_s"]
    } == {door_id: [round(s, 2) for s in times] for door_id, times in patrol().passages.items()}
    moving = 0
    for door in told["doors"]:
        life = patrol().lives[door["door_id"]]
        for at_s in np.arange(0.005, patrol().length_s, 0.37):
            row = [row for row in door["states"] if row["from_s"] <= at_s][-1]
            if life.moves(at_s, at_s):
                assert row["state"] == "MOVING"
                moving += 1
            else:
                assert row["state"] == life.body.word(life.amounts(at_s))
                assert row["opening"] == pytest.approx(
                    life.body.opening(life.amounts(at_s)), abs=1e-4
                )
    assert moving > 3


def test_doors_can_be_imported(tmp_path: Path) -> None:
    """The doors beside the bag make a log: names, kinds, places, before the patrol began."""
    path = tmp_path / "patrol.doors.jsonl"
    write_doors(path, patrol())
    with sl.create(tmp_path / "log") as log:
        import_file(log, path, ImportOptions())
    doors = sl.read(tmp_path / "log").replay(at=START_NS).doors

    assert {d.name: (d.x, d.width) for d in doors.values()} == {
        d.name: (pytest.approx(d.x), pytest.approx(d.width)) for d in patrol().plan.doors
    }


@pytest.mark.parametrize(
    ("name", "form"), [("a.mcap", "ros1"), ("a.bag", "sqlite3"), ("a", "ros1")]
)
def test_name_that_does_not_fit_is_refused(tmp_path: Path, name: str, form: str) -> None:
    with pytest.raises(OutputError, match=f"{name}: for {form} expected a name with"):
        write_bag(tmp_path / name, short(), where(), form=form, told=None)
    assert not (tmp_path / name).exists()


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(TOOL), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_command_makes_bag_truth_and_doors(tmp_path: Path) -> None:
    """One command: three files and a picture, and a line that says what is in them."""
    plan = building(tmp_path)
    done = run(
        tmp_path / "walk.bag", "--building", plan, "--minutes", "0.3", "--beams", "90",
        "--not-told", "--picture", tmp_path / "walk.png",
    )  # fmt: skip

    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "walk.bag: 178 scans, 3 doors that move" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "corridor.building.yaml", "walk.bag", "walk.doors.jsonl", "walk.png", "walk.truth.json",
    ]  # fmt: skip


def test_command_names_what_is_missing(tmp_path: Path) -> None:
    """No plan, or a level that it does not have: one line, nothing made."""
    missing = run(tmp_path / "a.bag", "--maps", tmp_path)
    level = run(tmp_path / "a.bag", "--building", building(tmp_path), "--level", "7")

    assert missing.returncode == level.returncode == 1
    assert "expected an Open-RMF plan, found nothing; say with --maps" in missing.stderr
    assert "expected one of the levels [1] with --level, got 7" in level.stderr
    assert not list(tmp_path.glob("a*"))
