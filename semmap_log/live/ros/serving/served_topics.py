"""Topics that a server offers while it runs: made when something is first said on them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from semmap_log.core.folds.doors_present import DoorsPresent
from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import RosVersion, encoded
from semmap_log.live.ros.ros_node import Publisher, RosNode


class ServedTopics:
    """A node's topics, to be written to as to a bag (`NewBag`)."""

    def __init__(self, node: RosNode) -> None:
        self.ros_version: RosVersion = node.ros_version
        self._node = node
        self._publishers: dict[BagTopic, Publisher] = {}

    def offer(self, topic: BagTopic) -> None:
        """Let subscribers find a topic before anything is said on it.

        Raises:
            RosError: Its type is not installed.
        """
        if topic not in self._publishers:
            self._publishers[topic] = self._node.publisher(topic)

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        """Publish a message."""
        self.write_encoded(topic, at_ns, encoded(self.ros_version, message, topic.ros_type))

    def write_encoded(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        """Publish a message that is bytes already.

        Raises:
            RosError: Its type is not installed.
        """
        del at_ns  # live, a message's time is now
        self.offer(topic)
        self._publishers[topic].publish(data)


class LevelNames:
    """How the topics of levels are called: plain, or with the level's number.

    What is alone at the server's start keeps the plain name; of several, level 0 has it.
    """

    def __init__(self, levels: Iterable[int]) -> None:
        found = list(levels)
        self._plain = found[0] if len(found) == 1 else 0

    def topic(self, name: str, level: int, ros_type: str, *, is_latched: bool = True) -> BagTopic:
        """Return a level's topic; its name is relative, so that it follows the node's namespace.

        Args:
            name: As of level 0.
            level: Its number.
            ros_type: In the long form.
            is_latched: See `BagTopic`.
        """
        own = name if level == self._plain else f"{name}/level_{level}"  # ROS 2: not /1
        return BagTopic(own, ros_type, is_latched)


class ChangedDoors:
    """Tells which doors are another than in the map before; that costs what the change does."""

    def __init__(self) -> None:
        self._seen: DoorsPresent | None = None

    def take(self, doors: DoorMap) -> dict[DoorId, Door | None]:
        """Return the doors that are other than they were, None for those that are gone.

        Of the first map these are all.
        """
        now = doors_of(doors)
        changed, gone = (list(now), []) if self._seen is None else now.others_than(self._seen)
        self._seen = now
        return {**{door: now[door] for door in changed}, **dict.fromkeys(gone)}


def doors_of(doors: DoorMap) -> DoorsPresent:
    """Return the doors of a map that a log gave: they can be compared without making each."""
    assert isinstance(doors.doors, DoorsPresent)
    return doors.doors


def levels_of(doors: DoorMap) -> set[int]:
    """Return the levels that have a door with a place, or a floor plan."""
    drawn = {n for n, level in doors.levels.items() if level.floor_map_event is not None}
    return doors_of(doors).placed_levels() | drawn
