"""The ROS messages of foreign bags: the types of noetic and of Jazzy, and those they left out."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from typing import Any, Literal

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
