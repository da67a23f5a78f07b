"""Bytes of ROS messages to values, by the publisher's own definition of the type if there is one.

Two packages may call different things the same: a robot's `DoorMap` with one more field is read by
its own text, and whoever looks at the values sees what is there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.damage import reason_of
from semmap_log.interop.formats.ros.ros_types import RosVersion, ros_types

MOST_ITEMS = 8_000_000
"""Of lists in a message, each of which becomes an object; numbers in arrays do not count."""

DefinitionForm = Literal["msg", "idl"]


@dataclass(frozen=True, slots=True)
class MessageType:
    """A type as a bag or a publisher tells it."""

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
