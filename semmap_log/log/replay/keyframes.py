"""Keyframes: the whole state of the door map, stored in the log as a cache."""

from __future__ import annotations

import hashlib
import struct

import numpy as np

from semmap_log.core.folds.door_map import STATE_VERSION, DoorMapState
from semmap_log.core.messages import read_message, type_name, write_message

_LIST_TYPES = {
    "annotation_door_id": "u4", "annotation_happened_ns": "i8", "annotation_event": "i8",
    "level_number": "u2", "level_elevation": "f8", "level_happened_ns": "i8", "level_event": "i8",
    "floor_map_happened_ns": "i8", "floor_map_event": "i8",
}  # fmt: skip
_HASH_BYTES = 32


def encode(state: DoorMapState) -> bytes:
    """Return the CDR bytes of the state's Keyframe message."""
    fields = state.to_arrays()
    for name, dtype in _LIST_TYPES.items():
        fields[name] = np.array(fields[name], dtype)
    blank = {"state_hash": bytes(_HASH_BYTES), "state_version": STATE_VERSION}
    data = write_message(type_name("Keyframe"), fields | blank)
    digest = hashlib.sha256(data).digest()
    return data[:_HASH_AT] + digest + data[_HASH_AT + _HASH_BYTES :]


def decode(data: bytes) -> DoorMapState | None:
    """Return the state that a Keyframe message holds; None if it is of another version or damaged.

    A keyframe is a cache: one that cannot be used is left out, and replay goes further back.
    """
    if version_of(data) != STATE_VERSION:
        return None
    blank = b"".join((data[:_HASH_AT], bytes(_HASH_BYTES), data[_HASH_AT + _HASH_BYTES :]))
    if hashlib.sha256(blank).digest() != data[_HASH_AT : _HASH_AT + _HASH_BYTES]:
        return None
    try:
        return DoorMapState.from_arrays(read_message(type_name("Keyframe"), data))
    except (ValueError, IndexError):
        return None


def version_of(data: bytes) -> int | None:
    """Return the state version of a Keyframe message; None if it is too short to have one."""
    return _HEAD.unpack_from(data)[1] if len(data) >= _HASH_AT + _HASH_BYTES else None


def event_of(data: bytes) -> int | None:
    """Return the number of the last event in a Keyframe message; None if it is too short."""
    return _HEAD.unpack_from(data)[0] if len(data) >= _HASH_AT + _HASH_BYTES else None


def why_unused(data: bytes) -> str:
    """Say why `decode` takes a Keyframe message for none."""
    version = version_of(data)
    if version is None:
        return "it is cut"
    if version != STATE_VERSION:
        return f"it is of state version {version}, ours is {STATE_VERSION}"
    return "it does not fit its hash"


_HEAD = struct.Struct("<4xqI")
"""The encapsulation, the number of the last event, the state version; the hash follows."""
_HASH_AT = _HEAD.size
