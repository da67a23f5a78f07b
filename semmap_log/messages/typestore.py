"""Messages with strings and arrays, and the texts and hashes of all of them: by way of rosbags."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from semmap_log.domain.events import KINDS, FloorMap
from semmap_log.messages.layout import PACKAGE, message_text

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

OWN_MESSAGES = (
    *(kind.__name__ for kind in KINDS if kind is not FloorMap),
    "Commit",
    "CommitNote",
    "Keyframe",
)
"""A floor map is ROS's own message."""
OCCUPANCY_GRID = "nav_msgs/msg/OccupancyGrid"


def type_name(message: str) -> str:
    """Return the full ROS 2 name of one of our messages."""
    return f"{PACKAGE}/msg/{message}"


@cache
def typestore() -> Typestore:
    """Return rosbags' types of ROS 2 Jazzy and ours."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    for message in OWN_MESSAGES:
        store.register(get_types_from_msg(message_text(message), type_name(message)))
    return store


@cache
def schema_text(ros_type: str) -> str:
    """Return the `ros2msg` text of a type with those of all that it holds."""
    package, _, message = ros_type.split("/")
    if package == PACKAGE:
        return message_text(message)
    return str(typestore().generate_msgdef(ros_type, ros_version=2)[0])


@cache
def type_hash(ros_type: str) -> str:
    """Return the type's RIHS01 hash, by which ROS 2 tells whether two types are the same."""
    return str(typestore().hash_rihs01(ros_type))


def serialize(ros_type: str, **values: Any) -> bytes:
    """Return the CDR bytes of a message of that type."""
    store = typestore()
    return bytes(store.serialize_cdr(store.types[ros_type](**values), ros_type))


def deserialize(ros_type: str, data: bytes | memoryview) -> Any:
    """Return the message; arrays are numpy arrays.

    Raises:
        ValueError: The bytes are not such a message.
    """
    try:
        return typestore().deserialize_cdr(bytes(data), ros_type)
    except Exception as error:  # rosbags raises whatever its generated code meets
        raise ValueError(f"not a {ros_type}: {type(error).__name__} {error}") from error
