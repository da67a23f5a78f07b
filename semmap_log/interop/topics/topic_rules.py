"""How topics are read: what a mapping file says, as values, and what holds without one."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal, TypeAlias

from semmap_log.core.model.doors import DoorState
from semmap_log.interop.formats.ros import ros_types

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
    """rmf_door_msgs/DoorRequest: somebody requested a state."""

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
    """A number above it is OPEN; NaN: no such threshold."""
    closed_below: float = math.nan
    unknown: Unknown = "add"
    accuracy: Accuracy = Accuracy()
    level: str | None = None


@dataclass(frozen=True, slots=True)
class ReadPose:
    """PoseStamped or PoseWithCovarianceStamped in the map's frame: where the robot is."""

    level: str | None = None
    robot: str = ""
    """Whose: its lasers learn from it how sure the robot is of its place."""


@dataclass(frozen=True, slots=True)
class ReadTransforms:
    """TF: where the robot is, composed from map to the robot's frame."""

    level: str | None = None
    robot: str = ""
    """Whose frames they are, where robots have trees of frames each for itself."""


@dataclass(frozen=True, slots=True)
class ReadFrames:
    """TF, for the robot's lasers only: it makes no poses."""

    robot: str = ""


@dataclass(frozen=True, slots=True)
class ReadPlace:
    """Poses in the map's frame, for the robot's lasers only; Odometry, too."""

    robot: str = ""


@dataclass(frozen=True, slots=True)
class ReadScan:
    """LaserScan or PointCloud2 of a laser: what it sees of the doors."""

    level: str | None = None
    robot: str | None = None
    """Whose laser it is; None: the namespace of its topic, if there are frames with it."""
    pose_topic: str = ""
    """Poses of the robot on the map; empty: TF leads from the map to it."""
    heights: tuple[float, float] = (0.3, 1.5)
    """Of a cloud: points between these heights over the robot's frame count, m."""

    def told(self, pose_topic: str = "", heights: tuple[float, float] | None = None) -> ReadScan:
        """Return it with the given topic of poses and heights in place of its own."""
        return replace(
            self, pose_topic=pose_topic or self.pose_topic, heights=heights or self.heights
        )


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


@dataclass(frozen=True, slots=True)
class ReadClicks:
    """PointStamped, as RViz's Publish Point sends them: two clicks are a door."""

    level: str | None = None
    """Of the doors; None: the log's only one."""
    within_s: float = 60.0
    """A second click that comes later begins another door."""
    heights: tuple[float, float] = (-1.0, 3.0)
    """m; a click above or below is on another level."""


Reading: TypeAlias = (
    ReadDoorMap | ReadRmfState | ReadRmfRequest | ReadSensor | ReadPose | ReadTransforms
    | ReadFloorMap | ReadPatrol | ReadScan | ReadFrames | ReadPlace | ReadClicks
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
    "scan": ReadScan,
    "clicked_points": ReadClicks,
}
"""By the word that a mapping file uses."""

ONLY_TYPES: Mapping[type[Reading], tuple[str, ...]] = {
    ReadDoorMap: (ros_types.DOOR_MAP,),
    ReadRmfState: (ros_types.RMF_DOOR_STATE,),
    ReadRmfRequest: (ros_types.RMF_DOOR_REQUEST,),
    ReadPose: (ros_types.POSE_STAMPED, ros_types.POSE_WITH_COVARIANCE),
    ReadTransforms: (ros_types.TRANSFORMS, "tf/msg/tfMessage"),
    ReadFloorMap: (ros_types.GRID,),
    ReadScan: (ros_types.LASER_SCAN, ros_types.POINT_CLOUD),
    ReadClicks: (ros_types.POINT_STAMPED,),
    ReadFrames: (ros_types.TRANSFORMS, "tf/msg/tfMessage"),
    ReadPlace: (ros_types.POSE_STAMPED, ros_types.POSE_WITH_COVARIANCE, ros_types.ODOMETRY),
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
        return self.ros_type or (
            known[0] if len(known) == 1 or ros_types.TRANSFORMS in known else ""
        )


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
    scans: ReadScan | None = None
    """How topics called `scan` are read that are not named; None: they are not."""
    level: str | None = None
    """Of topics that have none; None: the log's only one."""

    def rule(self, topic: str, ros_type: str) -> TopicRule | None:
        """Return how a topic is read; None: it is not."""
        found = self.topics.get(topic)
        if found is None and self.well_known:
            found = well_known_rule(topic, ros_type)
        if found is None and self.reads_scans:
            found = self._rule_for_lasers(topic, ros_type)
        return found

    @property
    def reads_scans(self) -> bool:
        """Return whether any laser is read."""
        return self.scans is not None or any(True for _ in self.scan_rules())

    def with_scans(
        self,
        topics: Collection[str],
        pose_topic: str = "",
        heights: tuple[float, float] | None = None,
    ) -> RosMapping:
        """Return a mapping that reads scans of these topics, too.

        Args:
            topics: As the mapping says, where it names them.
            pose_topic: Of all its lasers, where it is given.
            heights: The same.
        """
        named = [ros_types.whole_topic(topic) for topic in topics]
        pose_topic = ros_types.whole_topic(pose_topic) if pose_topic else ""
        rules = {topic: TopicRule(ReadScan()) for topic in named} | {
            topic: rule
            for topic, rule in self.topics.items()
            if topic not in named or isinstance(rule.reading, ReadScan)
        }
        for topic, rule in rules.items():
            if isinstance(rule.reading, ReadScan):
                rules[topic] = replace(rule, reading=rule.reading.told(pose_topic, heights))
        return replace(self, topics=rules)

    def asked_for(
        self,
        topics: Collection[str],
        pose_topic: str = "",
        heights: tuple[float, float] | None = None,
    ) -> RosMapping:
        """Return a mapping that reads scans of these topics; an empty one: all called `scan`."""
        mapping = self.with_scans([topic for topic in topics if topic], pose_topic, heights)
        named = any(isinstance(rule.reading, ReadScan) for rule in mapping.topics.values())
        is_any = "" in topics and not named
        pose_topic = ros_types.whole_topic(pose_topic) if pose_topic else ""
        return replace(mapping, scans=ReadScan().told(pose_topic, heights)) if is_any else mapping

    def with_clicks(self) -> RosMapping:
        """Return a mapping that reads RViz's clicks, too, where it does not name them."""
        if any(isinstance(rule.reading, ReadClicks) for rule in self.topics.values()):
            return self
        return replace(self, topics={**self.topics, CLICKED: TopicRule(ReadClicks())})

    def for_lasers_only(self) -> RosMapping:
        """Return the part of it that places scans; nothing else is read."""
        kept: dict[str, TopicRule] = {}
        for topic, rule in self.topics.items():
            reading = rule.reading
            if isinstance(reading, ReadTransforms):
                kept[topic] = replace(rule, reading=ReadFrames(reading.robot))
            elif isinstance(reading, ReadPose):
                kept[topic] = replace(rule, reading=ReadPlace(reading.robot))
            elif isinstance(reading, ReadScan):
                kept[topic] = rule
        return replace(self, topics=kept, well_known=False)

    def without_lasers(self) -> RosMapping:
        """Return all of it but the scans."""
        kept = {
            topic: rule
            for topic, rule in self.topics.items()
            if not isinstance(rule.reading, ReadScan)
        }
        return replace(self, topics=kept, scans=None)

    def scan_rules(self) -> Iterator[ReadScan]:
        """Yield how lasers are read."""
        for rule in self.topics.values():
            if isinstance(rule.reading, ReadScan):
                yield rule.reading
        if self.scans is not None:
            yield self.scans

    def _rule_for_lasers(self, topic: str, ros_type: str) -> TopicRule | None:
        """Return how a topic is read that a laser needs, or that is one's."""
        namespace, _, name = topic.strip("/").rpartition("/")
        if any(topic == laser.pose_topic for laser in self.scan_rules()):
            return TopicRule(ReadPlace(namespace))
        if ros_type in ONLY_TYPES[ReadFrames] and name in {"tf", "tf_static"}:
            return TopicRule(ReadFrames(namespace))
        if ros_type == ros_types.POSE_WITH_COVARIANCE and name == "amcl_pose":
            return TopicRule(ReadPlace(namespace))
        if ros_type == ros_types.LASER_SCAN and name == "scan" and self.scans is not None:
            return TopicRule(self.scans)
        return None


CLICKED = "/clicked_point"
"""Where RViz publishes the points that are clicked."""

_FLOOR = re.compile(r"/map(?:/(?:level_)?([0-9]{1,5}))?")
_POSES = frozenset({"/amcl_pose", "/robot_pose", "/semmap/robot_pose"})


def well_known_rule(topic: str, ros_type: str) -> TopicRule | None:
    """Return how a topic is read that no mapping names: by its type, some by their names, too."""
    if ros_type == ros_types.DOOR_MAP:
        return TopicRule(ReadDoorMap())
    if ros_type == ros_types.RMF_DOOR_STATE:
        return TopicRule(ReadRmfState())
    if ros_type == ros_types.RMF_DOOR_REQUEST:
        return TopicRule(ReadRmfRequest())
    if ros_type in ONLY_TYPES[ReadPose] and topic in _POSES:
        return TopicRule(ReadPose())
    if ros_type == ros_types.GRID and (floor := _FLOOR.fullmatch(topic)):
        return TopicRule(ReadFloorMap(floor[1]))
    return None


WELL_KNOWN = RosMapping(well_known=True)
"""What holds without a mapping file."""

EXPECTED_TOPICS: Mapping[str, str] = {
    "/lta_semantic_map_door_db": ros_types.DOOR_MAP,
    "/door_states": ros_types.RMF_DOOR_STATE,
    "/door_requests": ros_types.RMF_DOOR_REQUEST,
}
"""Well-known topics of one type: a recorder need not wait until somebody publishes them."""
