"""How topics are read: what a mapping file says, as values, and what holds without one."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, TypeAlias

from semmap_log.domain.doors import DoorState
from semmap_log.formats.ros.ros_types import (
    DOOR_MAP,
    GRID,
    POSE_STAMPED,
    POSE_WITH_COVARIANCE,
    RMF_DOOR_REQUEST,
    RMF_DOOR_STATE,
    TRANSFORMS,
)

Unknown = Literal["add", "ignore", "error"]
"""What becomes of a door that nobody knows: an unplaced door of that name, nothing, a complaint."""
Removes = Literal["own", "all", "none"]
Value = str | int | float | bool


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How often a sensor reads right, each in [0.5, 1]."""

    open: float = 1.0
    closed: float = 1.0


@dataclass(frozen=True, slots=True)
class ReadDoorMap:
    """lta_semantic_map/DoorMap of a server: what differs from the message before becomes events."""

    level: str | None = None
    """Of its doors, which the message knows nothing of; None: the log's only one."""
    removes: Removes = "own"
    """Which doors are removed once the message lacks them: those that came with this topic, all
    that have a place on that level, none."""


@dataclass(frozen=True, slots=True)
class ReadRmfState:
    """rmf_door_msgs/DoorState: sightings."""

    doors: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """Their name -> our door: id, name, or level/name. Those not in it are looked up by name."""
    unknown: Unknown = "add"
    accuracy: Accuracy = Accuracy()
    level: str | None = None
    """Of doors that are added."""


@dataclass(frozen=True, slots=True)
class ReadRmfRequest:
    """rmf_door_msgs/DoorRequest: somebody asked for a state."""

    doors: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    unknown: Unknown = "add"
    level: str | None = None


@dataclass(frozen=True, slots=True)
class ReadSensor:
    """A field of any message that says how one door is."""

    door: str
    path: str = "data"
    """To the field, with dots."""
    states: Mapping[Value, DoorState] = field(default_factory=lambda: MappingProxyType({}))
    """Value -> state; none at all: true is open, a text is a state's name."""
    open_above: float = math.nan
    """A number above it is OPEN; NaN: not asked."""
    closed_below: float = math.nan
    unknown: Unknown = "add"
    accuracy: Accuracy = Accuracy()
    level: str | None = None


@dataclass(frozen=True, slots=True)
class ReadPose:
    """PoseStamped or PoseWithCovarianceStamped in the map's frame: where the robot is."""

    level: str | None = None


@dataclass(frozen=True, slots=True)
class ReadTransforms:
    """TF: where the robot is, composed from map to the robot's frame."""

    level: str | None = None


@dataclass(frozen=True, slots=True)
class ReadFloorMap:
    """nav_msgs/OccupancyGrid: a level's floor plan, once for each content."""

    level: str | None = None


@dataclass(frozen=True, slots=True)
class ReadPatrol:
    """What marks the rounds: an action's status, a Bool, a String."""

    path: str = "data"
    """To the field of a message that is no action's status."""
    starts: tuple[Value, ...] = (True, "start", "started")
    finishes: tuple[Value, ...] = (False, "finish", "finished")
    name: str = ""
    """What the rounds are called."""


Reading: TypeAlias = (
    ReadDoorMap | ReadRmfState | ReadRmfRequest | ReadSensor | ReadPose | ReadTransforms
    | ReadFloorMap | ReadPatrol
)  # fmt: skip

READINGS: Mapping[str, type[Reading]] = {
    "door_map": ReadDoorMap,
    "rmf_door_state": ReadRmfState,
    "rmf_door_request": ReadRmfRequest,
    "sensor": ReadSensor,
    "pose": ReadPose,
    "tf": ReadTransforms,
    "floor_map": ReadFloorMap,
    "patrol": ReadPatrol,
}
"""By the word that a mapping file uses."""

ONLY_TYPES: Mapping[type[Reading], tuple[str, ...]] = {
    ReadDoorMap: (DOOR_MAP,),
    ReadRmfState: (RMF_DOOR_STATE,),
    ReadRmfRequest: (RMF_DOOR_REQUEST,),
    ReadPose: (POSE_STAMPED, POSE_WITH_COVARIANCE),
    ReadTransforms: (TRANSFORMS, "tf/msg/tfMessage"),
    ReadFloorMap: (GRID,),
}
"""Which messages can be read so; the others take any."""


@dataclass(frozen=True, slots=True)
class TopicRule:
    """How a topic is read."""

    reading: Reading
    ros_type: str = ""
    """In the long form; "": what the topic has."""

    @property
    def expected_type(self) -> str:
        """The type to ask for before anybody publishes the topic; "": it is not known yet."""
        known = ONLY_TYPES.get(type(self.reading), ())
        return self.ros_type or (known[0] if len(known) == 1 or TRANSFORMS in known else "")


@dataclass(frozen=True, slots=True)
class RosMapping:
    """Which topics are read, and how."""

    topics: Mapping[str, TopicRule] = field(default_factory=lambda: MappingProxyType({}))
    """By the full name."""
    well_known: bool = False
    """Topics that are not named are read as `well_known_rule` says."""
    repeats_s: float = 60.0
    """A sighting that says the same of a door as the one before it, from the same topic, is left
    out within this time; one that says something else never is."""
    moved_m: float = 0.25
    turned_rad: float = math.radians(15)
    """A pose is kept once the robot has moved or turned that far, and at sightings."""
    stamps_within_s: float = 60.0
    """A message's own stamp counts if it lies at most that long before the message came."""
    map_frame: str = "map"
    robot_frame: str = "base_link"

    def rule(self, topic: str, ros_type: str) -> TopicRule | None:
        """Return how a topic is read; None: it is not."""
        named = self.topics.get(topic)
        if named is not None or not self.well_known:
            return named
        return well_known_rule(topic, ros_type)


_FLOOR = re.compile(r"/map(?:/(?:level_)?([0-9]{1,5}))?")
_POSES = frozenset({"/amcl_pose", "/robot_pose", "/semmap/robot_pose"})


def well_known_rule(topic: str, ros_type: str) -> TopicRule | None:
    """Return how a topic is read that no mapping names: by its type, some by their names, too."""
    if ros_type == DOOR_MAP:
        return TopicRule(ReadDoorMap())
    if ros_type == RMF_DOOR_STATE:
        return TopicRule(ReadRmfState())
    if ros_type == RMF_DOOR_REQUEST:
        return TopicRule(ReadRmfRequest())
    if ros_type in ONLY_TYPES[ReadPose] and topic in _POSES:
        return TopicRule(ReadPose())
    if ros_type == GRID and (floor := _FLOOR.fullmatch(topic)):
        return TopicRule(ReadFloorMap(floor[1]))
    return None


WELL_KNOWN = RosMapping(well_known=True)
"""What holds without a mapping file."""

EXPECTED_TOPICS: Mapping[str, str] = {
    "/lta_semantic_map_door_db": DOOR_MAP,
    "/door_states": RMF_DOOR_STATE,
    "/door_requests": RMF_DOOR_REQUEST,
}
"""Well-known topics of one type: a recorder need not wait until somebody publishes them."""
