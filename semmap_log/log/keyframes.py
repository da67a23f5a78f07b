"""Keyframes: the whole state of the door map, stored in the log as a cache."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from semmap_log.log import records as mcap
from semmap_log.log.chunks import BuiltChunk, build_chunk
from semmap_log.log.form import KEYFRAME_CHANNEL
from semmap_log.messages import deserialize, serialize, type_name
from semmap_log.projections.door_map import STATE_VERSION, DoorMapState

_LIST_TYPES = {
    "annotation_door_id": "u4", "annotation_happened_ns": "i8", "annotation_event": "i8",
    "level_number": "u2", "level_elevation": "f8", "level_happened_ns": "i8", "level_event": "i8",
    "floor_map_happened_ns": "i8", "floor_map_event": "i8",
}  # fmt: skip
_NO_HASH = np.zeros(32, np.uint8)


def keyframe_chunk(state: DoorMapState, log_time_ns: int) -> BuiltChunk:
    """Return the chunk that holds the state, at a time of the log's own counting."""
    record = mcap.message(KEYFRAME_CHANNEL, state.event, log_time_ns, log_time_ns, encode(state))
    return build_chunk(record, np.zeros(1, np.int64))


def encode(state: DoorMapState) -> bytes:
    """Return the CDR bytes of the state's Keyframe message."""
    fields = state.to_arrays()
    for name, dtype in _LIST_TYPES.items():
        fields[name] = np.array(fields[name], dtype)
    return _serialize(fields, np.frombuffer(_hash(fields), np.uint8))


def decode(data: bytes) -> DoorMapState | None:
    """Return the state that a Keyframe message holds; None if it is of another version or damaged.

    A keyframe is a cache: one that cannot be used is left out, and replay goes further back.
    """
    try:
        message = deserialize(type_name("Keyframe"), data)
    except ValueError:
        return None
    fields = {name: getattr(message, name) for name in message.__dataclass_fields__
              if name not in ("__msgtype__", "state_hash", "state_version")}  # fmt: skip
    if message.state_version != STATE_VERSION or bytes(message.state_hash) != _hash(fields):
        return None
    return DoorMapState.from_arrays(fields)


def _hash(fields: dict[str, Any]) -> bytes:
    return hashlib.sha256(_serialize(fields, _NO_HASH)).digest()


def _serialize(fields: dict[str, Any], state_hash: Any) -> bytes:
    return serialize(
        type_name("Keyframe"), state_hash=state_hash, state_version=STATE_VERSION, **fields
    )
