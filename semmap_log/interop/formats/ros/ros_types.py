"""The ROS messages of foreign bags: their types, their bytes, and how new ones are built.

Types are those of noetic and of Jazzy, and those that they left out. Bytes become values by the
publisher's own definition of the type if there is one. Two packages may call different things the
same: a robot's `DoorMap` with one more field is read by its own text, and whoever looks at the
values sees what is there. Messages are built of ROS 1's classes or of ROS 2's; single events
become poses of the robot, and lines for a log panel.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.resources import files
from typing import Any, Literal

from semmap_log.core.model.events import RobotPose
from semmap_log.errors import FormatError, OutputError
from semmap_log.interop.formats.bags.unpacking import reason_of

MOST_ITEMS = 8_000_000
"""Of lists in a message, each of which becomes an object; numbers in arrays do not count."""

DefinitionForm = Literal["msg", "idl"]


@dataclass(frozen=True, slots=True)
class MessageType:
    """A type as a bag or a publisher declares it."""

    name: str
    """In ROS 2's long form, such as `std_msgs/msg/Bool`; for ROS 1, too."""
    ros_version: RosVersion
    """Whose bytes: ROS 2's are CDR."""
    definition: str = ""
    """The text of the type, and of all it is made of; empty: as we know it."""
    form: DefinitionForm = "msg"


def decode_message(message_type: MessageType, data: bytes) -> Any:
    """Return the message as an object with its fields.

    Raises:
        FormatError: The type is not known, or the bytes are no such message.
    """
    types = _types_of(message_type)
    if len(data) > MOST_ITEMS * _item_bytes(message_type):
        raise FormatError(
            message_type.name,
            f"expected lists of at most {MOST_ITEMS:,} items, got {len(data):,} bytes of them",
        )
    decode = types.deserialize_ros1 if message_type.ros_version == 1 else types.deserialize_cdr
    try:
        return decode(data, message_type.name)
    except Exception as error:  # noqa: BLE001  of bytes that are anything: rosbags checks few
        reason = reason_of(error)
        raise FormatError(message_type.name, f"bytes that are no such message: {reason}") from None


@lru_cache(maxsize=256)
def _item_bytes(message_type: MessageType) -> float:
    """Return how many bytes the least item takes in any list of the type that is no array.

    Raises:
        FormatError: None: a few bytes could say that there are billions.
    """
    types = _types_of(message_type)
    try:
        return least_item_bytes(types.fielddefs, message_type.name, message_type.ros_version)
    except (ValueError, RecursionError) as error:
        raise FormatError(message_type.name, f"its definition: {reason_of(error)}") from None


@lru_cache(maxsize=256)
def _types_of(message_type: MessageType) -> Any:
    if not message_type.definition:
        types = ros_types(message_type.ros_version)
        if message_type.name not in types.types:
            raise FormatError(
                message_type.name, "a type that is not known here, and its text is not at hand"
            )
        return types
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    types = get_typestore(Stores.EMPTY)
    try:
        if message_type.form == "idl":
            found: dict[str, Any] = {}
            for text in _idl_texts(message_type.definition):
                found |= get_types_from_idl(text)
            types.register(found)
        else:
            types.register(get_types_from_msg(message_type.definition, message_type.name))
    except Exception as error:  # noqa: BLE001  a grammar's, a missing type's, a name's
        reason = reason_of(error)
        raise FormatError(message_type.name, f"its definition cannot be read: {reason}") from None
    return types


def _idl_texts(definition: str) -> list[str]:
    """Return the IDL of each type: rosbag2 puts a line of `=` and `IDL: name` before each."""
    ruler = "=" * 80 + "\n"
    if not definition.startswith(ruler):
        return [definition]
    return [part.partition("\n")[2] for part in definition.split(ruler)[1:]]


PADDING = "structure_needs_at_least_one_member"
"""What rosbags puts into a type without fields; ROS 1 writes nothing for it."""
_BYTES = {"bool": 1, "byte": 1, "char": 1, "octet": 1, "string": 4, "wstring": 4, "float128": 16}


def least_item_bytes(definitions: Mapping[str, Any], name: str, version: RosVersion) -> float:
    """Return the least number of bytes that an item takes, of all lists of objects in a type.

    Infinity: it has none but arrays of numbers.

    Raises:
        ValueError: Items that take none, a type within itself, or one that is not there.
    """
    return _Sizes(definitions, version).least_item(name, ())


class _Sizes:
    def __init__(self, definitions: Mapping[str, Any], version: RosVersion) -> None:
        self._definitions = definitions
        self._version = version
        self._known: dict[str, int] = {}

    def least_item(self, name: str, within: tuple[str, ...]) -> float:
        if name in within:
            raise ValueError(f"{name} is a part of itself")
        least = math.inf
        for _, (kind, of) in self._fields(name):
            if kind.name in {"ARRAY", "SEQUENCE"}:
                (item_kind, item), _ = of
                if item_kind.name == "BASE" and item[0] not in {"string", "wstring"}:
                    continue  # an array of numbers
                size = self._bytes(item_kind, item)
                if not size:
                    raise ValueError(f"expected items of some bytes in its lists, got {item}")
                least = min(least, size)
                if item_kind.name == "NAME":
                    least = min(least, self.least_item(item, (*within, name)))
            elif kind.name == "NAME":
                least = min(least, self.least_item(of, (*within, name)))
        return least

    def _fields(self, name: str) -> Any:
        if name not in self._definitions:
            raise ValueError(f"it lacks the type {name}")
        return self._definitions[name][1]

    def _bytes(self, kind: Any, of: Any) -> int:
        if kind.name == "BASE":
            digits = "".join(filter(str.isdigit, of[0]))
            return _BYTES.get(of[0], int(digits or 8) // 8)
        if kind.name == "SEQUENCE":
            return 4
        if kind.name == "ARRAY":
            item, count = of
            return int(count) * self._bytes(*item)
        if of not in self._known:
            self._known[of] = 0  # a type within itself is refused elsewhere
            self._known[of] = sum(
                self._bytes(*field)
                for field_name, field in self._fields(of)
                if not (self._version == 1 and field_name == PADDING)
            )
        return self._known[of]


_INFO = {1: 2, 2: 20}
"""By the version of ROS."""


def pose_message(messages: Messages, at_ns: int, number: int, pose: RobotPose, z: float) -> Any:
    """Return a geometry_msgs/PoseStamped.

    Args:
        messages: Of which ROS.
        at_ns: Its stamp.
        number: How many came before on its topic.
        pose: Where the robot was.
        z: The floor's height, metres.
    """
    header = messages.header(at_ns, number)
    return messages.new(
        POSE_STAMPED, header=header, pose=messages.pose(pose.x, pose.y, z, pose.theta)
    )


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line of a log panel, in the words of ROS."""

    name: str
    """Of the node: panels choose by it."""
    msg: str
    file: str
    function: str
    line: int


def log_message(messages: Messages, at_ns: int, number: int, said: LogLine) -> Any:
    """Return an rcl_interfaces/Log, or of ROS 1 a rosgraph_msgs/Log, of level INFO."""
    version = messages.ros_version
    values: dict[str, Any] = {"name": said.name, "msg": said.msg, "file": said.file,
                              "function": said.function, "line": said.line % 2**32}  # fmt: skip
    if version == 1:
        values |= {"header": messages.header(at_ns, number), "topics": []}
    else:
        values |= {"stamp": messages.stamp(at_ns)}
    return messages.new(log_type(version), level=_INFO[version], **values)


FRAME = "map"

LAST_STAMP_NS = 2**31 * 10**9
"""builtin_interfaces/Time counts its seconds in 31 bits: until January 2038."""


class Messages:
    """A factory of messages."""

    def __init__(self, ros_version: RosVersion) -> None:
        self.ros_version = ros_version
        self._types = ros_types(ros_version).types

    def new(self, ros_type: str, /, **values: Any) -> Any:
        """Return a message of that type, in ROS 2's long form."""
        return self._types[ros_type](**values)

    def header(self, at_ns: int, number: int = 0, frame: str = FRAME) -> Any:
        """Return a header.

        Args:
            at_ns: Its stamp.
            number: How many messages of its topic came before; ROS 1 has a field for it.
            frame: The frame of the message's coordinates.

        Raises:
            OutputError: The time cannot be a ROS stamp.
        """
        count = {"seq": number % 2**32} if self.ros_version == 1 else {}
        return self.new("std_msgs/msg/Header", stamp=self.stamp(at_ns), frame_id=frame, **count)

    def stamp(self, at_ns: int) -> Any:
        """Return a time.

        Raises:
            OutputError: ROS has no number for it.
        """
        check_stamp(at_ns)
        seconds, nanoseconds = divmod(at_ns, 10**9)
        return self.new("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)

    def pose(self, x: float, y: float, z: float = 0.0, theta: float = 0.0) -> Any:
        """Return a pose: metres, and radians around z."""
        half = theta / 2
        return self.new(
            "geometry_msgs/msg/Pose",
            position=self.new("geometry_msgs/msg/Point", x=x, y=y, z=z),
            orientation=self.new(
                "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)
            ),
        )


def check_stamp(at_ns: int) -> None:
    """Return if ROS has a stamp for that time.

    Raises:
        OutputError: It has none.
    """
    if not 0 <= at_ns < LAST_STAMP_NS:
        raise OutputError(
            f"a ROS message's stamp: expected a time from 1970 to January 2038, got @{at_ns}; "
            "choose another range."
        )


GRID = "nav_msgs/msg/OccupancyGrid"
GRID_UPDATE = "map_msgs/msg/OccupancyGridUpdate"
MARKER = "visualization_msgs/msg/Marker"
MARKERS = "visualization_msgs/msg/MarkerArray"
POINT_STAMPED = "geometry_msgs/msg/PointStamped"
POSE_ARRAY = "geometry_msgs/msg/PoseArray"
POSE_STAMPED = "geometry_msgs/msg/PoseStamped"
CLOCK = "rosgraph_msgs/msg/Clock"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
LASER_SCAN = "sensor_msgs/msg/LaserScan"
POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
ODOMETRY = "nav_msgs/msg/Odometry"
RMF_DOOR_STATE = "rmf_door_msgs/msg/DoorState"
RMF_DOOR_REQUEST = "rmf_door_msgs/msg/DoorRequest"
DOOR_ENTRY = "lta_semantic_map/msg/DoorEntry"
DOOR_MAP = "lta_semantic_map/msg/DoorMap"

RosVersion = Literal[1, 2]

_LEFT_OUT = {
    GRID_UPDATE: """\
std_msgs/Header header
int32 x
int32 y
uint32 width
uint32 height
int8[] data
""",
    TRANSFORMS: "geometry_msgs/TransformStamped[] transforms\n",
    "rmf_door_msgs/msg/DoorMode": """\
uint32 value
uint32 MODE_CLOSED=0
uint32 MODE_MOVING=1
uint32 MODE_OPEN=2
uint32 MODE_OFFLINE=3
uint32 MODE_UNKNOWN=4
""",
    RMF_DOOR_STATE: """\
builtin_interfaces/Time door_time
string door_name
DoorMode current_mode
""",
    RMF_DOOR_REQUEST: """\
builtin_interfaces/Time request_time
string requester_id
string door_name
DoorMode requested_mode
""",
}
"""Types that rosbags does not know, or not of both ROS; their texts are those of
ros-planning/navigation_msgs, ros/geometry2 and open-rmf/rmf_internal_msgs."""


def log_type(version: RosVersion) -> str:
    """Return the type of a line of log, which ROS 2 has renamed."""
    return "rosgraph_msgs/msg/Log" if version == 1 else "rcl_interfaces/msg/Log"


@cache
def ros_types(version: RosVersion) -> Any:
    """Return rosbags' store of the types of ROS 1 (noetic) or ROS 2 (Jazzy)."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_JAZZY)
    for name, text in _LEFT_OUT.items():
        if name not in types.types:
            types.register(get_types_from_msg(text, name))
    for name, text in _thesis_texts():
        types.register(get_types_from_msg(text, name))
    return types


def encoded(version: RosVersion, message: Any, ros_type: str) -> bytes:
    """Return a message as the bytes that this ROS sends: CDR with its header, or ROS 1's own."""
    types = ros_types(version)
    serialize = types.serialize_ros1 if version == 1 else types.serialize_cdr
    return bytes(serialize(message, ros_type))


def decoded(version: RosVersion, data: bytes, ros_type: str) -> Any:
    """Return the message that these bytes are: the way back of `encoded`."""
    types = ros_types(version)
    deserialize = types.deserialize_ros1 if version == 1 else types.deserialize_cdr
    return deserialize(data, ros_type)


def _thesis_texts() -> Iterator[tuple[str, str]]:
    """Yield name and text of each message of the thesis's package."""
    package = "lta_semantic_map"
    for file in (files("semmap_log") / "live" / "robot_files" / package / "msg").iterdir():
        name = file.name.removesuffix(".msg")
        yield f"{package}/msg/{name}", file.read_text(encoding="utf-8")


def short_name(ros_type: str) -> str:
    """Return a type's name as ROS 1 has it: `std_msgs/Bool`."""
    return ros_type.replace("/msg/", "/")


def long_name(ros_type: str) -> str:
    """Return a type's name as ROS 2 has it: `std_msgs/msg/Bool`."""
    package, _, name = short_name(ros_type).partition("/")
    return f"{package}/msg/{name}"


def whole_topic(name: str) -> str:
    """Return a topic's whole name: `contact` is `/contact` to a node without a namespace."""
    return name if name.startswith(("/", "~")) else f"/{name}"


def ros1_definition(ros_type: str) -> tuple[str, str]:
    """Return the text of a type and of all it is made of, and its md5 sum, as ROS 1 has them."""
    text, md5 = ros_types(1).generate_msgdef(ros_type, ros_version=1)
    return str(text), str(md5)
