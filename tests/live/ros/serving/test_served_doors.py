"""The doors on their topics: the whole truth, each time that it is another."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import LevelAdded
from semmap_log.live.ros.serving.served_topics import (
    LevelNames,
    ServedDoors,
    ServedTopics,
    levels_of,
)
from tests.live.ros.collecting_node import CollectingNode

DB, MARKERS = "lta_semantic_map_door_db", "semmap/doors"


@pytest.fixture
def log(tmp_path: Path) -> sl.DoorLogWriter:
    return sl.create(tmp_path / "log", tz="UTC", durability="none")


def _served(node: CollectingNode, log: sl.DoorLogWriter) -> ServedDoors:
    names = LevelNames(levels_of(log.door_map()))
    served = ServedDoors(ServedTopics(node), names)
    served.show(log.door_map(), 0)
    return served


@pytest.mark.parametrize("version", [1, 2])
def test_a_map_without_doors_is_said_too(log: sl.DoorLogWriter, version: int) -> None:
    """Who subscribes must learn that there are none, not wait."""
    node = CollectingNode(version)

    _served(node, log)

    (message,) = node.messages[DB]
    assert [] == list(message.door_db)
    assert node.topics[DB].is_latched
    assert 1 == len(node.messages[MARKERS])


def test_each_change_is_said_once_and_whole(log: sl.DoorLogWriter) -> None:
    """Added, seen, removed; what leaves the message as it was is not said again."""
    node = CollectingNode()
    served = _served(node, log)

    front = log.add_door(x=1.0, y=2.0, theta=0.5, width=0.9, state="open", prob_open=0.25)
    served.show(log.door_map(), 1)
    log.add_door(name="a sensor without a place")
    served.show(log.door_map(), 2)
    log.observe(front, "open")
    served.show(log.door_map(), 3)
    log.observe(front, "moving")
    served.show(log.door_map(), 4)
    log.remove_door(front)
    served.show(log.door_map(), 5)

    told = [[(e.door_id, e.door_state, e.width) for e in m.door_db] for m in node.messages[DB]]
    assert [[], [(1, "OPEN", 0.9)], [(1, "UNKNOWN", 0.9)], []] == told
    entry = node.messages[DB][1].door_db[0]
    assert (1.0, 2.0, 0.5, 0.25) == (entry.pos_x, entry.pos_y, entry.pos_theta, entry.prob_open)
    assert math.isnan(entry.prob_closed)
    assert [1, 3, 3, 1] == [len(message.markers) for message in node.messages[MARKERS]]


def test_names_are_shown_and_followed(log: sl.DoorLogWriter) -> None:
    """A name changes the markers, not the thesis's message."""
    node = CollectingNode()
    door = log.add_door(x=1.0, y=2.0, theta=0.5, width=0.9)
    served = _served(node, log)

    log.annotate(door, "name", "front")
    served.show(log.door_map(), 1)

    assert 1 == len(node.messages[DB])
    texts = [message.markers[2].text for message in node.messages[MARKERS]]
    assert ["door 1", "front"] == texts


def test_levels_have_topics_of_their_own_and_lie_above_each_other(log: sl.DoorLogWriter) -> None:
    """A level that comes later gets its number."""
    node = CollectingNode()
    log.append([LevelAdded(level=1, name="ground", elevation=2.0)])
    log.add_door(x=1.0, y=2.0, theta=0.0, width=1.0, level=1)
    served = _served(node, log)

    log.append([LevelAdded(level=2, name="first", elevation=7.0)])
    log.add_door(x=1.0, y=2.0, theta=0.0, width=1.0, level=2)
    served.show(log.door_map(), 1)

    heights = {
        name: [message.markers[1].pose.position.z for message in node.messages[name]]
        for name in (MARKERS, f"{MARKERS}/level_2")
    }
    assert {MARKERS: [1.0, 3.0], f"{MARKERS}/level_2": [8.0]} == heights
    assert [1, 2] == [len(message.door_db) for message in node.messages[DB]]


def test_a_door_that_goes_while_its_level_is_raised_is_gone(log: sl.DoorLogWriter) -> None:
    """Changes that come together are shown together: none hides another."""
    node = CollectingNode()
    log.append([LevelAdded(level=1, name="ground", elevation=2.0), LevelAdded(level=2, name="up")])
    doors = [log.add_door(x=1.0, y=2.0, theta=0.0, width=1.0, level=n) for n in (1, 1, 2)]
    served = _served(node, log)

    log.remove_door(doors[0])
    log.append([LevelAdded(level=2, name="up", elevation=9.0)])
    served.show(log.door_map(), 1)

    assert [3, 2] == [len(message.door_db) for message in node.messages[DB]]
    assert [5, 3] == [len(message.markers) for message in node.messages[f"{MARKERS}/level_1"]]
    up = [message.markers[1].pose.position.z for message in node.messages[f"{MARKERS}/level_2"]]
    assert [1.0, 10.0] == up
