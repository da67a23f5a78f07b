"""How few bytes the items of a type's lists can have: by them a short message can mean many."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from semmap_log.formats.ros.ros_types import RosVersion

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
