"""RIHS01, the hash by which ROS 2 tells whether two types of one name are the same (REP 2016)."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from typing import Any

from semmap_log.core.messages.definitions import MessageField, definitions

_TYPE_IDS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8,
    "uint64": 9, "float32": 10, "float64": 11, "bool": 15, "string": 17,
}  # fmt: skip
"""As type_description_interfaces/msg/FieldType numbers them."""
_MESSAGE_ID = 1
_OF_FIXED_SIZE = 48
_OF_ANY_SIZE = 144
"""Added for arrays."""


@cache
def type_hash(ros_type: str) -> str:
    """Return the RIHS01 hash of one of the types that a log holds."""
    known = {
        name: {"type_name": name, "fields": [_field(field) for field in fields]}
        for name, fields in definitions(ros_type).items()
    }
    described = {
        "type_description": known[ros_type],
        "referenced_type_descriptions": [known[name] for name in sorted(known.keys() - {ros_type})],
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(described).encode()).hexdigest()}"


def _field(field: MessageField) -> dict[str, Any]:
    of_array = 0 if field.count is None else _OF_FIXED_SIZE if field.count else _OF_ANY_SIZE
    is_message = field.type not in _TYPE_IDS
    return {
        "name": field.name,
        "type": {
            "type_id": of_array + _TYPE_IDS.get(field.type, _MESSAGE_ID),
            "capacity": field.count or 0,
            "string_capacity": 0,
            "nested_type_name": field.type if is_message else "",
        },
    }
