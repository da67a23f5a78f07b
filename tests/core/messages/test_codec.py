"""Our CDR bytes are those of ROS 2: rosbags' own typestore reads and writes the same."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.messages import (
    OBJECT_KINDS,
    decode,
    encode,
    fixed_layout,
    layout,
    ros_type,
    type_hash,
)
from semmap_log.core.model.events import KINDS, Event, FloorMap, field_names
from tests.core.messages.typestore import deserialize, serialize
from tests.strategies import events, fixed_size, same


@given(events)
def test_an_event_survives_the_way_to_bytes_and_back(event: Event) -> None:
    """decode(encode(event)) is the event, for every kind."""
    assert event.happened_ns is not None
    data = encode(event, event.happened_ns)

    again = decode(event.kind, data, event.happened_ns, getattr(event, "level", 0))

    assert same(event, again)


@given(fixed_size)
def test_rosbags_reads_what_our_layouts_wrote(event: Event) -> None:
    """The typestore, which reads the same .msg text its own way, finds the same values."""
    message = deserialize(ros_type(event.kind), encode(event, 0))

    theirs = {name: getattr(message, name) for name in field_names(type(event))}
    ours = {name: getattr(event, name) for name in field_names(type(event))}

    assert repr(ours_as_plain(ours)) == repr(ours_as_plain(theirs))


@given(fixed_size)
def test_our_layouts_read_what_rosbags_wrote(event: Event) -> None:
    """The bytes are the same in the other direction, padding included."""
    values = ours_as_plain({name: getattr(event, name) for name in field_names(type(event))})

    theirs = serialize(ros_type(event.kind), **values)

    assert encode(event, 0) == theirs


def ours_as_plain(values: dict[str, Any]) -> dict[str, Any]:
    """Return states and bits as the numbers that they are in a message."""
    return {
        name: int(v) if isinstance(v, int) and not isinstance(v, bool) else v
        for name, v in values.items()
    }


@given(st.lists(events, max_size=20))
def test_a_batch_holds_the_events_as_columns(drawn: list[Event]) -> None:
    """Going through a batch gives the events back, in order, with their numbers."""
    batch = EventBatch.from_events(drawn)

    again = list(batch)

    assert list(range(len(drawn))) == [r.number for r in again]
    assert all(same(event, r.event) for event, r in zip(drawn, again, strict=True))


@pytest.mark.slow
@given(st.lists(events, max_size=20), st.data())
def test_selecting_from_a_batch_is_selecting_from_its_events(
    drawn: list[Event], data: st.DataObject
) -> None:
    """`select` keeps columns, objects and stamps side by side."""
    keep = data.draw(st.lists(st.booleans(), min_size=len(drawn), max_size=len(drawn)))

    chosen = EventBatch.from_events(drawn).select(np.array(keep, np.bool_))

    expected = [event for event, kept in zip(drawn, keep, strict=True) if kept]
    assert [repr(event) for event in expected] == [repr(r.event) for r in chosen]


@pytest.mark.parametrize("kind", [k for k in KINDS if k.kind not in OBJECT_KINDS])
def test_hot_kinds_have_one_size_for_ever(kind: type[Event]) -> None:
    """struct and numpy agree on the size, and every field of the event is in the layout."""
    fixed = fixed_layout(kind.kind)

    assert fixed.packer.size == fixed.dtype.itemsize
    assert fixed.fields == field_names(kind)


def test_the_commit_has_the_layout_that_its_hash_relies_on() -> None:
    """`hash` is the last field, so that a record without its last 32 bytes is what is hashed."""
    commit = layout("Commit")
    assert commit.dtype.fields is not None

    assert commit.fields[-1] == "hash"
    assert commit.dtype.fields["hash"][1] + 32 == commit.dtype.itemsize


def test_type_hashes_are_what_was_written_before() -> None:
    """A changed message would be another type under the same name: it needs a new name instead."""
    from tests.core.messages.frozen_types import TYPE_HASHES

    now = {kind.__name__: type_hash(ros_type(kind.kind)) for kind in KINDS if kind is not FloorMap}
    own = ("Commit", "CommitNote", "Keyframe", "Tombstone")
    now |= {name: type_hash(f"semmap_msgs/msg/{name}") for name in own}

    assert now == TYPE_HASHES


@given(st.sampled_from(sorted(k.kind for k in KINDS)), st.binary(max_size=200))
def test_bytes_that_are_no_message_are_refused_in_words(kind: int, data: bytes) -> None:
    """Whatever the bytes: an event, or a ValueError; never another exception."""
    try:
        event = decode(kind, data, 0)
    except ValueError as error:
        assert str(error)
    else:
        assert isinstance(event, Event)


@given(st.floats(-math.pi, math.pi))
def test_the_angle_of_a_floor_map_does_not_creep(theta: float) -> None:
    """A map that goes from log to log keeps its bytes, though a quaternion is between."""
    cells = np.zeros((1, 1), np.int8)
    first = FloorMap(resolution=0.05, origin_x=0, origin_y=0, origin_theta=theta, cells=cells)

    data = encode(first, 0)
    again = decode(FloorMap.kind, data, 0, level=0)

    assert data == encode(again, 0)


@given(st.floats(-math.pi, math.pi), st.floats(0.9, 1.1))
def test_an_angle_of_no_exact_quaternion(theta: float, length: float) -> None:
    """Another program's, rounded as it likes: the nearest angle is taken."""
    cells = np.zeros((1, 1), np.int8)
    ours = FloorMap(resolution=0.05, origin_x=0, origin_y=0, origin_theta=theta, cells=cells)
    data = encode(ours, 0)
    turn = struct.pack("<2d", math.sin(theta / 2), math.cos(theta / 2))
    assert 1 == data.count(turn)
    theirs = struct.pack("<2d", length * math.sin(theta / 2), length * math.cos(theta / 2))

    read = decode(FloorMap.kind, data.replace(turn, theirs), 0, level=0)

    assert isinstance(read, FloorMap)
    assert math.isclose(math.cos(read.origin_theta - theta), 1, abs_tol=1e-12)
