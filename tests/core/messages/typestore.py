"""The oracle: what rosbags makes of our `.msg` texts, which it reads its own way."""

from __future__ import annotations

from functools import cache
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from semmap_log.core.messages import message_text, type_name
from semmap_log.core.model.events import KINDS, FloorMap

OWN_MESSAGES = (
    *(kind.__name__ for kind in KINDS if kind is not FloorMap),
    "Commit",
    "CommitNote",
    "Keyframe",
)
"""A floor map is ROS's own message."""


@cache
def typestore() -> Typestore:
    """Return rosbags' types of ROS 2 Jazzy and ours."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for message in OWN_MESSAGES:
        store.register(get_types_from_msg(message_text(message), type_name(message)))
    return store


def serialize(ros_type: str, **values: Any) -> bytes:
    """Return the CDR bytes of a message of that type."""
    store = typestore()
    return bytes(store.serialize_cdr(store.types[ros_type](**values), ros_type))


def deserialize(ros_type: str, data: bytes) -> Any:
    """Return the message; arrays are numpy arrays."""
    return typestore().deserialize_cdr(data, ros_type)
