"""Doors by two clicks in RViz."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, LevelAdded
from semmap_log.errors import FormatError
from semmap_log.interop.formats.ros.ros_types import POINT_STAMPED, RosVersion
from semmap_log.interop.importing.importing import ImportOptions, import_file
from semmap_log.interop.topics.mapping_file import read_mapping
from semmap_log.interop.topics.topic_reader import Known
from semmap_log.interop.topics.topic_rules import (
    CLICKED,
    WELL_KNOWN,
    ReadClicks,
    RosMapping,
    TopicRule,
)
from tests.interop.formats.bags.bags_of_others import Said, write_mcap
from tests.interop.topics.robots import START, Listener, Robot, S


def _click(
    x: float, y: float, z: float = 0.0, *, frame: str = "map", at_s: float = 0.0,
    version: RosVersion = 2,
) -> tuple[str, bytes]:  # fmt: skip
    robot = Robot(version)
    message = robot.new(
        POINT_STAMPED,
        header=robot.header(START + round(at_s * S), frame),
        point=robot.new("geometry_msgs/msg/Point", x=x, y=y, z=z),
    )
    return POINT_STAMPED, robot.encoded(POINT_STAMPED, message)


def _listener(rule: ReadClicks = ReadClicks(), version: RosVersion = 2) -> Listener:
    return Listener({CLICKED: rule}, version=version)


@pytest.mark.parametrize("version", [1, 2])
def test_two_clicks_are_a_door(version: RosVersion) -> None:
    """From the first to the second; a line tells who clicks what was done."""
    listener = _listener(version=version)

    first = listener.made(CLICKED, _click(2, 1, version=version))
    second = listener.made(CLICKED, _click(2, 1.9, version=version), 3)

    assert first.events == []
    assert "2.00, 1.00; now click" in first.said
    added, named = second.events
    assert isinstance(added, DoorAdded)
    assert isinstance(named, DoorAnnotated)
    assert (added.x, added.y, added.width) == pytest.approx((2, 1, 0.9))
    assert added.theta == pytest.approx(math.pi / 2)
    assert (named.key, named.value) == ("name", "clicked 2.0 1.4")
    assert "door 1 from 2.00, 1.00 to 2.00, 1.90, 0.90 m wide" in second.said
    assert listener.told == []


@pytest.mark.parametrize(
    ("clicks", "events", "starts", "told"),
    [
        ([(0, 0), (1, 1), (3, 3), (4, 4)], [0, 2, 0, 2], [0, 3], ""),
        ([(0, 0), (9, 0), (9.5, 0), (10.4, 0)], [0, 0, 0, 2], [9.5], "0.4 to 6 m"),
        ([(0, 0), (1, 11), (2, 12)], [0, 0, 2], [1], "more than 10 s after"),
        ([(0, 0), (0.9, 0), (1.0, 0), (0.1, 0)], [0, 2, 0, 0], [0], "passed over: door 1"),
    ],
    ids=["four clicks are two doors", "a bad width forgets both", "too late", "there already"],
)
def test_each_two_clicks_are_a_door(
    clicks: list[tuple[float, float]], events: list[int], starts: list[float], told: str
) -> None:
    """The clicks are x and time; doors start at the first of two."""
    listener = _listener(ReadClicks(within_s=10))
    made = [len(listener.hear(CLICKED, _click(x, 0), at_s)) for x, at_s in clicks]

    assert made == events
    assert [door.x for door in listener.known.doors.values()] == starts
    assert bool(told) == len(listener.told)
    assert told in "".join(listener.told)


@pytest.mark.parametrize(
    ("clicks", "said"),
    [
        ([(0, 0, 0), (0.1, 0, 0)], "expected 0.4 to 6 m between them"),
        ([(0, 0, 0), (9, 0, 0)], "expected 0.4 to 6 m between them"),
        ([(0, 0, 0), (math.nan, 0, 0)], "a click that is nowhere"),
        ([(0, 0, 0), (0.9, 0, 4)], "a click on another level"),
    ],
)
def test_nonsense_is_refused(clicks: list[tuple[float, float, float]], said: str) -> None:
    """With words; the next two clicks are a door."""
    listener = _listener()

    assert [listener.hear(CLICKED, _click(*each)) for each in clicks] == [[], []]

    assert len(listener.told) == 1
    assert said in listener.told[0]


def test_clicks_in_another_frame_are_passed_over() -> None:
    """RViz's Fixed Frame was odom."""
    listener = _listener()

    made = [listener.hear(CLICKED, _click(x, 0, frame="odom")) for x in (0, 1)]

    assert made == [[], []]
    assert "Fixed Frame: 'odom'" in listener.told[0]


def test_doors_come_onto_the_level_that_is_told() -> None:
    """The same place on another level is another door."""
    known = Known()
    for level in (1, 2):
        known.apply(LevelAdded(level=level, name=f"L{level}", elevation=0.0))
    known.apply(DoorAdded(door_id=5, level=1, x=0.0, y=0.0, theta=0.0, width=0.9))
    listener = Listener({CLICKED: ReadClicks(level="L2")}, known)

    listener.hear(CLICKED, _click(0, 0))
    added, _ = listener.hear(CLICKED, _click(0.9, 0))

    assert isinstance(added, DoorAdded)
    assert added.level == 2


def test_a_mapping_file_says_it_and_a_bag_brings_the_same(tmp_path: Path) -> None:
    """By the same code."""
    mapping = tmp_path / "m.yaml"
    mapping.write_text("topics:\n  /clicked_point: {read: clicked_points, within: 20}\n")
    said = [Said(CLICKED, *_click(x, 0, at_s=x), START + round(x * S)) for x in (0.0, 0.9)]
    write_mcap(tmp_path / "x.mcap", said)

    assert read_mapping(mapping).topics[CLICKED].reading == ReadClicks(within_s=20)
    with sl.create(tmp_path / "office", tz="UTC") as log:
        import_file(log, tmp_path / "x.mcap", ImportOptions(mapping=mapping))
        (door,) = log.replay().doors.values()

    assert door.name == "clicked 0.5 0.0"
    assert door.width == pytest.approx(0.9)


def test_a_mapping_file_that_cannot_be_is_refused(tmp_path: Path) -> None:
    """With the key."""
    mapping = tmp_path / "m.yaml"
    mapping.write_text("topics:\n  /clicked_point: {read: clicked_points, heights: [3, 1]}\n")

    with pytest.raises(FormatError, match="heights: expected two numbers"):
        read_mapping(mapping)


def test_clicks_are_read_only_where_asked_for() -> None:
    """By the option, unless the mapping names their topic."""
    mine = RosMapping(topics={"/door_points": TopicRule(ReadClicks())})

    assert WELL_KNOWN.rule(CLICKED, POINT_STAMPED) is None
    assert WELL_KNOWN.with_clicks().rule(CLICKED, POINT_STAMPED) == TopicRule(ReadClicks())
    assert mine.with_clicks() is mine
