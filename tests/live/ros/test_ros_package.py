"""The ROS package lta_semantic_map: the thesis to the letter, whole in the wheel."""

from __future__ import annotations

import json
import os
import re
import subprocess
import time
import xml.etree.ElementTree as ET
from pathlib import Path
from shutil import which

import pytest
import yaml

from semmap_log.interop.formats.ros.ros_types import ros_types
from semmap_log.live.ros.ros_node import write_ros_package
from semmap_log.live.ros.serving.served_topics import MARKERS_NAME
from semmap_log.live.ros.serving.server import LAYER_NAME, MASTER_NAME
from tests.live.ros.ros_world import ROOT, RosWorld
from tests.verbs import run

BUILT_WITHIN_S = 600
"""A build of seven times four messages for C++, Lisp, Node and Python, on a busy machine."""

PACKAGE = ROOT / "semmap_log" / "live" / "robot_files" / "lta_semantic_map"

VALUES = """\
float64 pos_x
float64 pos_y
float64 pos_theta
float64 width
string door_state
float64 prob_open
float64 prob_closed"""
FEEDBACK = "float32 percent_complete"
THESIS = {
    "action/AddDoor.action": f"{VALUES}\n---\nuint32 door_id\n---\n{FEEDBACK}",
    "action/RemoveDoor.action": f"uint64 door_id\n---\nbool door_removed\n---\n{FEEDBACK}",
    "action/SaveDoorDB.action": f"string file_name\n---\nbool stored_successful\n---\n{FEEDBACK}",
    "action/UpdateDoor.action": "uint64 door_id\nbool change_pos\nbool change_width\n"
    "bool change_open\nbool change_prob_open\nbool change_prob_closed\n"
    f"{VALUES}\n---\nbool door_updated\n---\n{FEEDBACK}",
    "msg/DoorEntry.msg": f"uint32 door_id\n{VALUES}",
    "msg/DoorMap.msg": "DoorEntry[] door_db",
}
"""Figures B.1 to B.4, C.1 and C.2, without their comments."""

CHECKSUMS = {
    "DoorEntry": "3772ce60ce32d9e60b7b2c8fe554e0a9",
    "DoorMap": "508bc5364e8b67756f73afae8cdea662",
    "AddDoorAction": "c6668618ac5dea41d3d85c02b9111760",
    "RemoveDoorAction": "59db65db41671ea8add1a1f392f4acd1",
    "SaveDoorDBAction": "4099531d1de215fd048f6fe8b4711965",
    "UpdateDoorAction": "9e8eac79414d59934bfc4525e33b9902",
}
"""As a catkin workspace of Debian 12 (catkin 0.8.10) built the package."""


@pytest.mark.parametrize("name", THESIS)
def test_definitions_are_the_thesis_to_the_letter(name: str) -> None:
    """All fields, their names, types and order."""
    lines = (PACKAGE / name).read_text(encoding="utf-8").splitlines()

    assert THESIS[name].splitlines() == [line for line in lines if not line.startswith("#")]


def test_there_is_no_other_definition() -> None:
    """The thesis has two messages and four actions."""
    found = {f"{path.parent.name}/{path.name}" for path in PACKAGE.glob("[ma]*/*.*")}

    assert set(THESIS) == found


def test_ros1_tools_see_the_checksums_of_catkin(ros1: RosWorld) -> None:
    """`rosmsg md5` of what our builder made; `rosbags` reckons the same for bags."""
    names = [f"lta_semantic_map/{name}" for name in CHECKSUMS]

    for name, checksum in zip(names, CHECKSUMS.values(), strict=True):
        with ros1.tool("rosmsg", "md5", name) as rosmsg:
            assert checksum == rosmsg.finish().strip()
    for name in ("DoorEntry", "DoorMap"):
        types = ros_types(1)
        assert CHECKSUMS[name] == types.generate_msgdef(f"lta_semantic_map/msg/{name}")[1]


@pytest.mark.parametrize(
    "name",
    [
        "lta_semantic_map/msg/DoorEntry",
        "lta_semantic_map/msg/DoorMap",
        "map_msgs/msg/OccupancyGridUpdate",
        "rmf_door_msgs/msg/DoorRequest",
        "rmf_door_msgs/msg/DoorState",
        "tf2_msgs/msg/TFMessage",
    ],
)
def test_ros2_has_the_type_hashes_that_rosbags_reckons(
    name: str, jazzy: RosWorld, kilted: RosWorld
) -> None:
    """Nodes of other makers compare them; rosidl's generators wrote those of our builder."""
    expected = ros_types(2).hash_rihs01(name)

    for world in (jazzy, kilted):
        built = world.interpreter.parents[1] / "share" / f"{name}.json"
        hashes = json.loads(built.read_text())["type_hashes"]
        assert expected == next(h["hash_string"] for h in hashes if h["type_name"] == name)


MANIFEST = """
import os, sys
from catkin_pkg.package import parse_package
package = parse_package(sys.argv[1])
package.evaluate_conditions({"ROS_VERSION": sys.argv[2]})
on = lambda depends: " ".join(sorted({d.name for d in depends if d.evaluated_condition}))
print(on(package.buildtool_depends), package.get_build_type(), sep="\\n")
print(on(package.member_of_groups))
print(on(package.exec_depends))
"""


def test_one_manifest_serves_both(ros1: RosWorld) -> None:
    """Read by catkin's own parser, which colcon uses, too: each ROS sees its own dependencies."""
    with ros1.code(MANIFEST, PACKAGE / "package.xml", 1) as of_ros1:
        tools, build_type, groups, needs = of_ros1.finish().split("\n")[:4]
        assert ("catkin", "catkin", "") == (tools, build_type, groups)
        assert "rospy" in needs
        assert "rclpy" not in needs

    with ros1.code(MANIFEST, PACKAGE / "package.xml", 2) as of_ros2:
        tools, build_type, groups, needs = of_ros2.finish().split("\n")[:4]
        assert "ament_cmake rosidl_default_generators" == tools
        assert ("ament_cmake", "rosidl_interface_packages") == (build_type, groups)
        assert "rclpy" in needs
        assert "rospy" not in needs


def test_the_version_is_the_packages() -> None:
    """A workspace says which release its messages are of."""
    pyproject = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    manifest = ET.parse(PACKAGE / "package.xml").getroot()

    assert f'version = "{manifest.findtext("version")}"' in pyproject


NODES = [
    path for name in ("server", "recorder") for path in sorted(PACKAGE.glob(f"launch/{name}*"))
]
COSTMAPS = sorted({*PACKAGE.glob("launch/*")} - {*NODES})


@pytest.mark.parametrize("path", NODES, ids=lambda path: path.name)
def test_launch_files_start_what_is_there(path: Path) -> None:
    """They parse, and the executable that they name is one of the scripts."""
    text = path.read_text(encoding="utf-8")

    if path.suffix == ".py":
        compile(text, path, "exec")
        _, _, named = text.partition('executable="')
        executable = named.partition('"')[0]
    else:
        (node,) = ET.fromstring(text).iter("node")
        executable = node.get("type") or node.get("exec") or ""

    assert os.access(PACKAGE / "scripts" / executable, os.X_OK)


@pytest.mark.parametrize("path", COSTMAPS, ids=lambda path: path.name)
def test_launch_files_of_the_costmap_have_what_they_need(path: Path) -> None:
    """They include a launch file and parameters of the package."""
    text = path.read_text(encoding="utf-8")
    used = re.findall(r"\$\((?:find|find-pkg-share) lta_semantic_map\)/([\w./]+)", text)
    (include,) = ET.fromstring(text).iter("include")
    target = PACKAGE / include.get("file", "").partition("lta_semantic_map)/")[2]

    taken = {arg.get("name") for arg in ET.parse(target).getroot().findall("arg")}
    handed = {arg.get("name"): arg.get("value", "") for arg in include.findall("arg")}

    assert 2 == len(used)
    assert all((PACKAGE / name).is_file() for name in used)
    assert handed.keys() <= taken
    assert "--costmap" in handed["options"]


def test_roslaunch_loads_the_parameters_of_the_costmap(ros1: RosWorld) -> None:
    """As move_base reads them: under the costmap's static layer."""
    where = {"ROS_PACKAGE_PATH": str(PACKAGE.parent)}
    asked = ("lta_semantic_map", "costmap.launch", "log:=/my/log", "move_base:=mover")

    with ros1.tool("roslaunch", "--dump-params", *asked, environment=where) as dumped:
        found = yaml.safe_load(dumped.finish())
    node = ("--args", "lta_semantic_map_server")
    with ros1.tool("roslaunch", *node, *asked, environment=where) as arguments:
        command = arguments.finish().split()

    layer = "/mover/global_costmap/static_layer/"
    assert {name.removeprefix(layer): value for name, value in found.items()} == {
        "map_topic": f"/{MASTER_NAME}",
        "subscribe_to_updates": False,
        "track_unknown_space": True,
        "trinary_costmap": False,
    }
    respawned, _, *words = command
    assert ('SEMMAP_RESPAWNED="1"', ["/my/log", "--costmap"]) == (respawned, words[:2])


def test_roslaunch_does_not_start_for_ever_what_would_fail_again(
    ros1: RosWorld, tmp_path: Path
) -> None:
    """Without a log: told once, though it starts a node again after two seconds."""
    command = tmp_path / "semmap-log"
    command.write_text(f'#!/bin/sh\nexec {ros1.interpreter} -m semmap_log "$@"\n')
    command.chmod(0o755)
    where = {"ROS_PACKAGE_PATH": str(PACKAGE.parent), "SEMMAP_LOG": str(command)}
    launch = ("lta_semantic_map", "server.launch", f"log:={tmp_path / 'nowhere'}")

    with ros1.tool("roslaunch", *launch, environment=where) as launched:
        launched.wait_for("it waits")
        time.sleep(5)
        told = launched.output + launched.errors
        assert 0 == launched.stop()

    assert 1 == told.count("no such log")
    assert "has died" not in told


def test_parameters_name_what_is_served() -> None:
    """Nav2's two ways, by their whole names."""
    doors, keepout = (
        yaml.safe_load((PACKAGE / "param" / f"nav2_{name}.yaml").read_text(encoding="utf-8"))
        for name in ("doors", "keepout")
    )

    layer = doors["global_costmap"]["global_costmap"]["ros__parameters"]["static_layer"]
    info = keepout["costmap_filter_info_server"]["ros__parameters"]
    filtered = keepout["global_costmap"]["global_costmap"]["ros__parameters"]["keepout_filter"]
    assert f"/{MASTER_NAME}" == layer["map_topic"]
    assert f"/{LAYER_NAME}" == info["mask_topic"]
    assert info["filter_info_topic"] == filtered["filter_info_topic"]
    managed = keepout["lifecycle_manager_filters"]["ros__parameters"]["node_names"]
    assert ["costmap_filter_info_server"] == managed


def test_every_launch_and_parameter_file_is_installed() -> None:
    """By a build of one ROS or the other."""
    text = (PACKAGE / "CMakeLists.txt").read_text(encoding="utf-8")

    names = [str(p.relative_to(PACKAGE)) for kind in ("launch", "param")
             for p in _files(PACKAGE / kind)]  # fmt: skip
    assert names
    assert [] == [name for name in names if not re.search(rf"\s{re.escape(name)}\s", text)]


def test_catkin_make_builds_a_workspace_without_a_setup_file(
    ros1: RosWorld, tmp_path: Path
) -> None:
    """Debian's ROS 1 has none to source, so nothing says which ROS it is."""
    if which("catkin_make") is None:
        pytest.skip("catkin_make is not installed")
    (tmp_path / "src").mkdir()
    write_ros_package(tmp_path / "src")

    unset = ("ROS_VERSION", "ROS_MASTER_URI", "PYTHONPATH")
    bare = ("env", *(f"--unset={name}" for name in unset), "PATH=/usr/bin:/bin")
    with ros1.run(*bare, "catkin_make", "-C", tmp_path) as build:
        built = build.wait(timeout_s=BUILT_WITHIN_S)
        assert 0 == built, str(build)
    use = ". devel/setup.sh && echo $ROS_VERSION && /usr/bin/python3 -c "
    use += "'from lta_semantic_map import msg; print(msg.DoorMap._md5sum)'"
    with ros1.run(*bare, "bash", "-c", use, cwd=tmp_path) as used:
        said = used.finish()

    assert f"1\n{CHECKSUMS['DoorMap']}\n" == said


def test_messages_without_a_workspace(
    ros1: RosWorld, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder for PYTHONPATH, which ROS's own Python needs no more than."""
    words = ("ros-package", tmp_path / "messages", "--messages")
    for said in ("written", "there already"):
        with ros1.python("-m", "semmap_log", *words) as made:
            made.finish()
            assert said in made.errors
            assert f"export PYTHONPATH={tmp_path}/messages" in made.errors
    stock = (
        "from lta_semantic_map import msg; print(msg.DoorMap._md5sum, msg.AddDoorAction._md5sum)"
    )
    where = {"PYTHONPATH": str(tmp_path / "messages")}
    with ros1.run("/usr/bin/python3", "-c", stock, environment=where) as used:
        assert [CHECKSUMS["DoorMap"], CHECKSUMS["AddDoorAction"]] == used.finish().split()

    (tmp_path / "other" / "lta_semantic_map").mkdir(parents=True)
    assert 1 == run("ros-package", tmp_path / "other", "--messages")
    assert "is there already, and has no messages of ROS 1 in it" in capsys.readouterr().err


def test_rviz_shows_what_is_served() -> None:
    """The topics of its displays, by their whole names; and a workspace installs the file."""
    text = (PACKAGE / "rviz" / "doors.rviz").read_text(encoding="utf-8")
    displays = yaml.safe_load(text)["Visualization Manager"]["Displays"]

    shown = {each.get("Topic", each.get("Marker Topic")) for each in displays}

    assert {f"/{name}" for name in (MARKERS_NAME, MASTER_NAME, LAYER_NAME)} == shown
    assert "rviz/doors.rviz" in (PACKAGE / "CMakeLists.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("script", "verb"), [("lta_semantic_map_server", "serve"), ("semmap_recorder", "record")]
)
def test_scripts_start_our_verbs(script: str, verb: str) -> None:
    """
    For the ROS whose setup.bash was sourced, with the launch file's options and ROS's arguments.
    """
    done = subprocess.run(
        [PACKAGE / "scripts" / script, "/my log", "__name:=doors"],
        env={"PATH": os.environ["PATH"], "SEMMAP_LOG": "echo", "ROS_VERSION": "1",
             "SEMMAP_OPTIONS": "--read-only --costmap"},
        capture_output=True, text=True, check=True,
    )  # fmt: skip

    assert f"{verb} --ros1 --read-only --costmap /my log __name:=doors\n" == done.stdout


def test_scripts_say_what_is_missing() -> None:
    """Started by hand, outside of ROS."""
    done = subprocess.run(
        [PACKAGE / "scripts" / "semmap_recorder", "log"], env={"PATH": os.environ["PATH"]},
        capture_output=True, text=True, check=False,
    )  # fmt: skip

    assert 0 != done.returncode
    assert "ROS_VERSION: is not set: source the setup.bash of ROS" in done.stderr


def test_a_workspace_gets_all_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Every file as it is here, the scripts executable; and it says how to go on."""
    assert 0 == run("ros-package", tmp_path)

    copied = {p.relative_to(tmp_path / PACKAGE.name): p.read_bytes() for p in _files(tmp_path)}
    assert {p.relative_to(PACKAGE): p.read_bytes() for p in _files(PACKAGE)} == copied
    scripts = list((tmp_path / PACKAGE.name / "scripts").iterdir())
    assert scripts
    assert all(os.access(script, os.X_OK) for script in scripts)
    said = capsys.readouterr().err
    assert "catkin_make" in said
    assert "colcon build" in said


def _files(folder: Path) -> list[Path]:
    return [p for p in folder.rglob("*") if p.is_file() and "__pycache__" not in p.parts]


def test_a_second_copy_changes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As a set-up script would do it at each start."""
    for _ in range(2):
        assert 0 == run("ros-package", tmp_path)

    assert "there already, the same" in capsys.readouterr().err


def test_what_somebody_changed_stays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A package of that name may be the robot's own; the first file that differs is named."""
    theirs = tmp_path / PACKAGE.name / "package.xml"
    theirs.parent.mkdir()
    theirs.write_text("theirs")

    assert 1 == run("ros-package", tmp_path)

    assert "differs from this package (CMakeLists.txt differs)" in capsys.readouterr().err
    assert ["package.xml"] == [path.name for path in theirs.parent.iterdir()]
    assert "theirs" == theirs.read_text()


def test_a_workspace_must_be_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A misspelt path makes no folder."""
    assert 1 == run("ros-package", tmp_path / "srcc")

    assert "no such folder; expected a workspace's src" in capsys.readouterr().err
    assert [] == list(tmp_path.iterdir())
