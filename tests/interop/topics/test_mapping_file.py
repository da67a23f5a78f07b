"""Mapping files: what they say, and what is said of wrong ones."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from semmap_log.core.model.doors import DoorState
from semmap_log.errors import FormatError
from semmap_log.interop import topics as topics_module
from semmap_log.interop.formats.ros.ros_types import (
    DOOR_MAP,
    GRID,
    LASER_SCAN,
    POSE_STAMPED,
    POSE_WITH_COVARIANCE,
    TRANSFORMS,
)
from semmap_log.interop.topics.mapping_file import read_mapping
from semmap_log.interop.topics.topic_rules import (
    WELL_KNOWN,
    Accuracy,
    ReadDoorMap,
    ReadFloorMap,
    ReadPatrol,
    ReadPose,
    ReadRmfRequest,
    ReadRmfState,
    ReadScan,
    ReadSensor,
    ReadTransforms,
    RosMapping,
    TopicRule,
)

FOLDER = Path(topics_module.__file__).parent


def _read(tmp_path: Path, text: str) -> RosMapping:
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    return read_mapping(path)


def _problems(tmp_path: Path, text: str) -> str:
    with pytest.raises(FormatError) as raised:
        _read(tmp_path, text)
    return str(raised.value).replace(str(tmp_path), "")


def test_the_shipped_example_says_what_its_comments_say() -> None:
    """Words, tables of names, values of a sensor, types, numbers."""
    mapping = read_mapping(FOLDER / "example.yaml")

    assert TopicRule(ReadDoorMap()) == mapping.topics["/lta_semantic_map_door_db"]
    assert TopicRule(ReadRmfRequest()) == mapping.topics["/door_requests"]
    states = mapping.topics["/door_states"].reading
    assert isinstance(states, ReadRmfState)
    assert {"main_door_east": "L1/main_door", "17": "L2/lab"} == states.doors
    assert Accuracy(0.99, 0.99) == states.accuracy
    gate = mapping.topics["/gate/status"].reading
    assert isinstance(gate, ReadSensor)
    assert (DoorState.OPEN, DoorState.MOVING) == (gate.states["1"], gate.states["falling"])
    lobby = mapping.topics["/lobby/range"]
    assert "sensor_msgs/msg/Range" == lobby.ros_type
    assert isinstance(lobby.reading, ReadSensor)
    assert ("range", 1.2, "error") == (
        lobby.reading.path, lobby.reading.open_above, lobby.reading.unknown
    )  # fmt: skip
    assert Accuracy(0.9, 0.95) == lobby.reading.accuracy
    assert TopicRule(ReadPose("L1")) == mapping.topics["/amcl_pose"]
    assert "evening round" == mapping.topics["/follow_waypoints/_action/status"].reading.name  # type: ignore[union-attr]
    assert (30, 0.5, 20) == (mapping.repeats_s, mapping.moved_m, math.degrees(mapping.turned_rad))


def test_the_readme_shows_mappings_that_can_be_read(tmp_path: Path) -> None:
    """Every YAML block of it, as it stands."""
    blocks = (FOLDER / "README.md").read_text().split("```yaml\n")[1:]

    assert 3 <= len(blocks)
    for block in blocks:
        _read(tmp_path, block.partition("```")[0])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("topics: {/a: dor_map}", "/robot.yaml:1: /a: read: expected one of door_map, "),
        ("topics: {/a: dor_map}", "got 'dor_map'"),
        ("topics:\n  /a: {read: pose, levl: 1}", "yaml:2: /a: expected only the keys read, level"),
        ("topics:\n  /a: {read: pose, levl: 1}", "got 'levl' (did you mean level?)"),
        ("topics: {/a: pose}\nrepeat: 3", "yaml:2: a mapping file: expected only the keys"),
        ("topics: {/a: pose}\nrepeats: -3", "repeats: expected seconds, 0 to 1e9, got '-3'"),
        ("topics: {~a: pose}", "topics: expected a topic's name such as /door_states, got '~a'"),
        ("topics: {/a: pose, a: tf}", "topics: /a is there twice; keep one of them"),
        ("topics: {/a: sensor}", "/a: expected the key door, got none"),
        ("topics: {/a: {read: sensor, door: d, accuracy: 97}}", "expected a number from 0.5 to 1"),
        ("topics: {/a: {read: sensor, door: d, states: {opn: 1}}}", "(did you mean open?)"),
        ("topics: {/a: {read: sensor, door: d, states: {open: 1, closed: 1}}}", "no other state"),
        (
            "topics: {/a: {read: pose, type: std_msgs/Bool}}",
            "expected geometry_msgs/PoseStamped or",
        ),
        ("topics: {/a: {read: door_map, removes: mine}}", "expected one of own, all, none"),
        ("topics: {/a: {level: 1}}", "/a: expected read: one of door_map, "),
        ("topics: {/a: {reed: pose}}", "yaml:1: /a: expected read: one of door_map, "),
        ("topics: {/a: {reed: pose, level: 1}}", "clicked_points; got only reed, level"),
        ("topics: {}", "expected a topic at least"),
        ("topics: {/a: {read: scan, heights: 1}}", "heights: expected two numbers, the lower"),
        ("topics: {/a: {read: scan, heights: [2, 1]}}", "heights: expected two numbers, the"),
        ("topics: {/a: {read: scan, heights: [1, 2, 3]}}", "heights: expected two numbers, the"),
        ("topics: {/a: {read: scan, heights: [1, x]}}", "heights: expected a number, got 'x'"),
        ("topics: {/a: {read: scan, pose_topic: a b}}", "expected a topic's whole name, as /amcl"),
        ("topics: {/a: {read: scan, type: std_msgs/Bool}}", "expected sensor_msgs/LaserScan or"),
        ("topics: {/a: pose}\nposes: {metres: far}", "poses: metres: expected a number, got 'far'"),
        ("topics: {/a: {read: sensor, door: ''}}", "/a: door: expected a name, got ''"),
        ("topics: {/a: {read: rmf_door_state, doors: {b: ''}}}", "b: expected a name, got ''"),
        ("topics: {/a: {read: sensor, door: d, type: Bool}}", "such as std_msgs/Bool, got 'Bool'"),
        ("topics: {/a: {read: sensor, door: d, field: a..b}}", "expected a field's name"),
        (
            "topics: {/a: {read: sensor, door: d, open_above: 1, closed_below: 2}}",
            "open_above: expected a number not below closed_below, got '1'",
        ),
        ("topics: {/a: {read: patrol, starts: false}}", "expected values that do not mark both"),
        ("topics: {/a: pose}\nrepeats: 1e300", "repeats: expected seconds, 0 to 1e9, got '1e300'"),
        ("topics: {/a: pose}\nstamps: 1e300", "stamps: expected seconds, 0 to 1e9, got '1e300'"),
        ("topics: {/a: tf}\nframes: {map: a, robot: /a}", "the robot's another than the map's"),
        ("topics: {/a: tf}\nframes: {map: ''}", "frames: map: expected a name, got ''"),
        ("- /a", "a mapping file: expected keys and values, got a list"),
        ("topics: {/a: pose, /a: tf}", "'/a' is there twice"),
    ],
)
def test_a_wrong_file_is_told_by_line_with_what_was_expected(
    text: str, says: str, tmp_path: Path
) -> None:
    """And where a word is nearly right, with the right one."""
    assert says in _problems(tmp_path, text)


def test_all_problems_are_told_at_once(tmp_path: Path) -> None:
    """One run shows every line that is wrong."""
    said = _problems(tmp_path, "topics:\n  /a: dor_map\n  /b: {read: pose, x: 1}\nrepeats: no\n")

    assert [":2:", ":3:", ":4:"] == [line[line.index(":") :][:3] for line in said.splitlines()]


@pytest.mark.parametrize(
    ("topic", "ros_type", "rule"),
    [
        ("/anything", DOOR_MAP, TopicRule(ReadDoorMap())),
        ("/amcl_pose", POSE_WITH_COVARIANCE, TopicRule(ReadPose())),
        ("/goal_pose", POSE_STAMPED, None),
        ("/map", GRID, TopicRule(ReadFloorMap())),
        ("/map/level_2", GRID, TopicRule(ReadFloorMap("2"))),
        ("/local_costmap/costmap", GRID, None),
        ("/chatter", "std_msgs/msg/String", None),
    ],
)
def test_well_known_topics_need_no_file(topic: str, ros_type: str, rule: TopicRule | None) -> None:
    """By their type, and poses and maps by their names, too; nothing else is touched."""
    assert rule == WELL_KNOWN.rule(topic, ros_type)


def test_a_named_topic_is_read_as_named_though_it_is_well_known(tmp_path: Path) -> None:
    """`well_known: true` adds the others to those that are named."""
    mapping = _read(tmp_path, "topics: {/map: {read: patrol}}\nwell_known: true")

    assert isinstance(mapping.topics["/map"].reading, ReadPatrol)
    assert mapping.topics["/map"] == mapping.rule("/map", GRID)
    assert TopicRule(ReadDoorMap()) == mapping.rule("/doors", DOOR_MAP)


def test_a_laser_has_its_keys(tmp_path: Path) -> None:
    """All of them, or a word where the defaults are right."""
    path = tmp_path / "robot.yaml"
    path.write_text(
        "topics:\n  /a/scan: scan\n  /b: {read: scan, robot: tug2, level: L2, "
        "pose_topic: /b/amcl_pose, heights: [0.5, 1]}\n  /b/tf: {read: tf, robot: tug2}\n"
    )

    mapping = read_mapping(path)

    assert {
        "/a/scan": ReadScan(),
        "/b": ReadScan("L2", "tug2", "/b/amcl_pose", (0.5, 1.0)),
        "/b/tf": ReadTransforms(robot="tug2"),
    } == {topic: rule.reading for topic, rule in mapping.topics.items()}
    assert mapping.reads_scans
    assert isinstance(mapping.rule("/b/amcl_pose", POSE_STAMPED), TopicRule)
    assert isinstance(mapping.rule("/tf_static", TRANSFORMS), TopicRule)
    assert mapping.rule("/scan", LASER_SCAN) is None


@pytest.mark.parametrize("topics", [["/velo"], ["/velo", "/scan"], [""]])
def test_what_is_told_of_lasers_on_the_command_line_holds_for_all(topics: list[str]) -> None:
    """What is not told stays as it is."""
    told = RosMapping().asked_for(topics, heights=(0.2, 0.9))
    again = told.asked_for(topics, "/amcl_pose")

    assert {(0.2, 0.9)} == {rule.heights for rule in told.scan_rules()}
    assert {((0.2, 0.9), "/amcl_pose")} == {
        (rule.heights, rule.pose_topic) for rule in again.with_scans([]).scan_rules()
    } or topics == [""]
