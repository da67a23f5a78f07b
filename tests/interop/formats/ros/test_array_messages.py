"""Arrays joined from encoded parts are, byte for byte, what rosbags makes of the whole message."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.model.doors import DoorId
from semmap_log.interop.formats.ros.door_messages import ArrayType, DoorLook, DoorMarkers
from semmap_log.interop.formats.ros.ros_types import (
    DOOR_ENTRY,
    DOOR_MAP,
    MARKERS,
    Messages,
    RosVersion,
    ros_types,
)
from tests.strategies import texts

labels = st.lists(texts, max_size=6)


def serialized(version: RosVersion, message: Any, name: str) -> bytes:
    """Return a whole message as rosbags encodes it."""
    types = ros_types(version)
    serialize = types.serialize_ros1 if version == 1 else types.serialize_cdr
    return bytes(serialize(message, name))


@pytest.mark.parametrize("version", [1, 2])
@settings(deadline=None)
@given(labels=labels)
def test_texts_of_any_length_leave_the_others_where_they_belong(
    version: RosVersion, labels: list[str]
) -> None:
    """In CDR numbers are aligned: each text shifts all that is behind it."""
    parts = ArrayType(version, DOOR_MAP, "door_db", DOOR_ENTRY)
    new = Messages(version).new
    entries = [
        new(DOOR_ENTRY, door_id=number, pos_x=1.5, pos_y=-2.5, pos_theta=0.25, width=0.9,
            door_state=label, prob_open=0.125, prob_closed=float("nan"))
        for number, label in enumerate(labels)
    ]  # fmt: skip
    expected = serialized(version, new(DOOR_MAP, door_db=entries), DOOR_MAP)

    assert expected == parts.joined([parts.encoded(entry) for entry in entries])


@pytest.mark.parametrize("version", [1, 2])
@settings(deadline=None)
@given(labels=labels)
def test_markers_survive_a_round_through_rosbags(version: RosVersion, labels: list[str]) -> None:
    """Decoded and encoded again, a joined MarkerArray has the same bytes."""
    markers = DoorMarkers(version)
    looks = [
        DoorLook(DoorId(2**32 - 1 - number), (1.0, 2.0), 0.5, 0.9, 3.5, label, (1, 2, 3), (4, 5, 6))
        for number, label in enumerate(labels)
    ]
    types = ros_types(version)
    deserialize = types.deserialize_ros1 if version == 1 else types.deserialize_cdr

    joined = markers.message([markers.encoded(look) for look in looks])

    message = deserialize(joined, MARKERS)
    assert joined == serialized(version, message, MARKERS)
    assert labels == [marker.text for marker in message.markers[2::2]]
    assert [-1 - number for number in range(len(labels))] == [
        marker.id for marker in message.markers[1::2]
    ]
