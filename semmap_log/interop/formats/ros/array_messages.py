"""Messages that are one long array, joined from elements that were encoded once each.

A door changes, and the message with all doors is sent again: but for one door it has the same
bytes. In CDR they depend on where in the message they lie, modulo 8; so each element is kept both
ways. What the bytes are, rosbags says; here they are only put side by side.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from semmap_log.interop.formats.ros.ros_types import RosVersion, ros_types

_CDR_HEADER = b"\x00\x01\x00\x00"
_COUNT_BYTES = 4
_ALIGNMENT = 4
"""Of an element: it begins with a field of 4 bytes, such as a stamp or an id."""


@dataclass(frozen=True, slots=True)
class EncodedElement:
    """An encoded element."""

    at_0: bytes
    """As it is at a multiple of 8."""
    at_4: bytes
    """As it is 4 bytes behind one."""


class ArrayType:
    """A message type with one field, an array; its elements begin with a field of 4 bytes."""

    def __init__(self, ros_version: RosVersion, array: str, field: str, element: str) -> None:
        """Name the types.

        Args:
            ros_version: Whose bytes.
            array: The message, such as `visualization_msgs/msg/MarkerArray`.
            field: Its only field.
            element: What that is an array of.
        """
        self._types = ros_types(ros_version)
        self._is_cdr = ros_version == 2
        self._array, self._field, self._element = array, field, element

    def encoded(self, element: Any) -> EncodedElement:
        """Return an element as bytes."""
        if not self._is_cdr:
            data = bytes(self._types.serialize_ros1(element, self._element))
            return EncodedElement(data, data)
        alone = self._types.serialize_cdr(element, self._element)
        one = self._types.types[self._array](**{self._field: [element]})
        behind_count = self._types.serialize_cdr(one, self._array)
        skipped = len(_CDR_HEADER)
        return EncodedElement(bytes(alone[skipped:]), bytes(behind_count[skipped + _COUNT_BYTES :]))

    def joined(self, parts: Iterable[EncodedElement]) -> bytes:
        """Return the message with these elements."""
        listed = list(parts)
        count = struct.pack("<I", len(listed))
        if not self._is_cdr:
            return count + b"".join([part.at_0 for part in listed])
        pieces, at = [_CDR_HEADER, count], _COUNT_BYTES
        for part in listed:
            gap = -at % _ALIGNMENT
            data = part.at_4 if (at + gap) % 8 else part.at_0
            pieces += [bytes(gap), data]
            at += gap + len(data)
        return b"".join(pieces)
