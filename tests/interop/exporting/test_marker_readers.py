"""The bags of markers in other programs' readers: each message is read by the schema beside it."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from shutil import which
from types import SimpleNamespace
from typing import Any

import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability

from semmap_log.interop.exporting.log_files import record_bag
from semmap_log.interop.exporting.stream import StreamOptions
from semmap_log.interop.formats.ros.ros_types import ros_types
from tests.interop.exporting.lively import lively_log, seen_in, some_moments
from tests.interop.formats.bags.marked import doors_in, shown_after
from tests.views.rerun.some_logs import small_log

LATCHED = {"/map", "/semmap/doors", "/lta_semantic_map_door_db"}

MARKED = StreamOptions(markers=True)


@pytest.mark.parametrize("name", ["x.mcap", "x"])
def test_who_comes_late_gets_the_whole_truths(name: str, tmp_path: Path) -> None:
    """ROS 2's players offer maps and arrays as transient_local, single events as volatile."""
    record_bag(small_log(tmp_path / "log"), tmp_path / name, MARKED)

    with AnyReader([tmp_path / name]) as reader:
        offered = {c.topic: c.ext.offered_qos_profiles[0].durability for c in reader.connections}

    stays = {t for t, durability in offered.items() if durability is QosDurability.TRANSIENT_LOCAL}
    assert LATCHED == stays
    assert {"/semmap/robot_pose", "/semmap/events"} == offered.keys() - stays


def test_ros_1_knows_the_thesis_messages_by_their_digests() -> None:
    """The MD5s that genmsg makes of the thesis's two texts."""
    digests = {name: ros_types(1).generate_msgdef(f"lta_semantic_map/msg/{name}")[1]
               for name in ("DoorEntry", "DoorMap")}  # fmt: skip

    assert {
        "DoorEntry": "3772ce60ce32d9e60b7b2c8fe554e0a9",
        "DoorMap": "508bc5364e8b67756f73afae8cdea662",
    } == digests


@pytest.mark.viewer
def test_rerun_finds_nothing_wrong(tmp_path: Path) -> None:
    """`rerun mcap check` exits with 0, and its loader finds the robot and the floor plan."""
    rerun_cli = pytest.importorskip("rerun_cli")
    from rerun.chunk import McapReader

    record_bag(small_log(tmp_path / "log"), tmp_path / "x.mcap", MARKED)
    binary = Path(rerun_cli.__path__[0]) / "rerun"

    done = subprocess.run([binary, "mcap", "check", tmp_path / "x.mcap"], capture_output=True,
                          text=True, check=False)  # fmt: skip

    assert (0, True) == (done.returncode, "/semmap/doors" in done.stdout), done.stderr
    entities = {chunk.entity_path for chunk in McapReader(tmp_path / "x.mcap").stream()}
    assert {*LATCHED, "/semmap/robot_pose", "/semmap/events"} <= entities


@pytest.mark.node
def test_foxglove_shows_the_doors_of_any_moment(tmp_path: Path, node_packages: Path) -> None:
    """As Lichtblick's player reads backward, decoded by Foxglove's code."""
    log = lively_log(tmp_path / "log", seed=3)
    done = record_bag(log, tmp_path / "x.mcap", MARKED)
    moments = some_moments(log, seed=3)

    (counts,) = run_node(tmp_path / "x.mcap", ["all"], node_packages)
    found = run_node(tmp_path / "x.mcap", moments, node_packages)

    assert done.messages == counts
    for moment, last in zip(moments, found, strict=True):
        now = log.replay(at=moment)
        for level in (1, 2):
            messages = [namespace(last[t]) for t in [f"/semmap/doors/level_{level}"] if t in last]
            assert seen_in(now, level) == doors_in(shown_after(messages))
        placed = [door.door_id for door in now.doors.values() if door.is_placed]
        assert placed == [e["door_id"] for e in last["/lta_semantic_map_door_db"]["door_db"]]


def run_node(bag: Path, arguments: list[Any], node_packages: Path) -> list[Any]:
    """Return the JSON lines that the script prints."""
    script = Path(__file__).with_name("read_markers.mjs")
    done = subprocess.run(
        ["node", script, bag, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env={"PATH": str(Path(which("node") or "").parent), "NODE_PACKAGES": str(node_packages)},
    )
    assert 0 == done.returncode, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def namespace(value: Any) -> Any:
    """Return a JSON value with its fields as attributes."""
    if isinstance(value, dict):
        return SimpleNamespace(**{key: namespace(item) for key, item in value.items()})
    return [namespace(item) for item in value] if isinstance(value, list) else value
