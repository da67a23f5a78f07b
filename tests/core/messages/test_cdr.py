"""Messages with texts and arrays: byte for byte what rosbags writes, and what it reads."""

from __future__ import annotations

from operator import attrgetter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.messages import (
    OCCUPANCY_GRID,
    read_message,
    schema_text,
    type_name,
    write_message,
)
from semmap_log.core.messages.type_hash import (
    CODES,
    MessageField,
    definitions,
    flat_fields,
    type_hash,
)
from semmap_log.log.replay.keyframes import encode
from tests.core.messages.typestore import OWN_MESSAGES, deserialize, serialize, typestore

ALL_TYPES = [*map(type_name, OWN_MESSAGES), OCCUPANCY_GRID]
KEYFRAME = type_name("Keyframe")

_NUMBERS: dict[str, st.SearchStrategy[Any]] = {
    "bool": st.booleans(), "uint8": st.integers(0, 2**8 - 1), "int8": st.integers(-(2**7), 127),
    "uint16": st.integers(0, 2**16 - 1), "uint32": st.integers(0, 2**32 - 1),
    "int32": st.integers(-(2**31), 2**31 - 1), "uint64": st.integers(0, 2**64 - 1),
    "int64": st.integers(-(2**63), 2**63 - 1), "float32": st.floats(width=32),
    "float64": st.floats(),
}  # fmt: skip
_TEXTS = st.text(st.characters(codec="utf-8"), max_size=9)


def _values(field: MessageField) -> st.SearchStrategy[Any]:
    """Return what a field can hold."""
    if field.type == "string":
        return _TEXTS if field.count is None else st.lists(_TEXTS, max_size=4)
    numbers = _NUMBERS[field.type]
    if field.count is None:
        return numbers
    sizes = st.just(field.count) if field.count else st.integers(0, 5)
    dtype = np.dtype(CODES[field.type][0])
    return sizes.flatmap(lambda size: arrays(dtype, size, elements=numbers))


@st.composite
def messages(draw: st.DrawFn) -> tuple[str, dict[str, Any]]:
    """Return a type, and a value for each of its fields."""
    ros_type = draw(st.sampled_from(ALL_TYPES))
    return ros_type, {field.name: draw(_values(field)) for field in flat_fields(ros_type)}


def _theirs(ros_type: str, values: dict[str, Any], prefix: str = "") -> Any:
    """Return rosbags' object of a message, made from the inside out."""
    made = {}
    for field in definitions(OCCUPANCY_GRID if "/" in ros_type else ros_type).get(ros_type, ()):
        name = f"{prefix}{field.name}"
        is_message = "/" in field.type
        made[field.name] = _theirs(field.type, values, f"{name}.") if is_message else values[name]
    return typestore().types[ros_type](**made)


def _written(ros_type: str, values: dict[str, Any]) -> bytes:
    """Return the bytes that rosbags makes of them."""
    if ros_type != OCCUPANCY_GRID:
        return serialize(ros_type, **values)
    return bytes(typestore().serialize_cdr(_theirs(ros_type, values), ros_type))


def _as_bytes(value: Any) -> Any:
    """Return a value as something that is equal where it is the same, NaN too."""
    if isinstance(value, (str, list)):
        return value
    return np.asarray(value).tobytes()


@given(messages())
def test_it_writes_what_rosbags_writes(drawn: tuple[str, dict[str, Any]]) -> None:
    """Every byte, padding too, whatever the lengths of the fields before make of the alignment."""
    ros_type, values = drawn

    assert _written(ros_type, values) == write_message(ros_type, values)


@given(messages())
def test_it_reads_what_rosbags_reads(drawn: tuple[str, dict[str, Any]]) -> None:
    """Every field of every type that a log holds."""
    ros_type, values = drawn
    data = _written(ros_type, values)
    theirs = deserialize(ros_type, data)

    ours = read_message(ros_type, data)

    assert list(values) == list(ours)
    for name, value in ours.items():
        found = list(value) if isinstance(values[name], list) else value
        assert _as_bytes(attrgetter(name)(theirs)) == _as_bytes(found)


@given(messages(), st.data())
def test_a_message_with_a_byte_changed_is_read_as_rosbags_reads_it_or_refused(
    drawn: tuple[str, dict[str, Any]], data: st.DataObject
) -> None:
    """Where ours reads it, rosbags does, and finds the same: nothing is made up."""
    ros_type, values = drawn
    message = bytearray(_written(ros_type, values))
    message[data.draw(st.integers(4, len(message) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        read = read_message(ros_type, bytes(message))
        ours = {name: list(v) if _is_texts(v) else v for name, v in read.items()}
    except ValueError:
        return
    theirs = deserialize(ros_type, bytes(message))

    assert all(_as_bytes(attrgetter(n)(theirs)) == _as_bytes(v) for n, v in ours.items())


def _is_texts(value: Any) -> bool:
    return not isinstance(value, (str, int, float, np.ndarray))


@pytest.mark.parametrize("ros_type", ALL_TYPES)
def test_every_type_has_the_hash_that_rosbags_gives_it(ros_type: str) -> None:
    """Of its definition, with the types that it holds."""
    assert typestore().hash_rihs01(ros_type) == type_hash(ros_type)


def test_the_text_of_ros_own_message_is_ros_own() -> None:
    """As it stands in the schema of every log."""
    assert typestore().generate_msgdef(OCCUPANCY_GRID, ros_version=2)[0] == schema_text(
        OCCUPANCY_GRID
    )


@pytest.mark.parametrize("ros_type", [KEYFRAME, type_name("DoorAnnotated"), OCCUPANCY_GRID])
def test_a_message_that_is_cut_is_an_error_at_every_byte(ros_type: str) -> None:
    """Never other values, nor an error of another kind."""
    data = _one_of(ros_type)
    for end in range(len(data)):
        with pytest.raises(ValueError, match=r"not a|text"):
            _read_whole(ros_type, data[:end])


def test_bytes_behind_the_end_are_refused_but_for_padding() -> None:
    """Other writers fill up to a multiple of four."""
    ros_type = type_name("DoorAnnotated")
    data = _one_of(ros_type)

    assert read_message(ros_type, data).keys() == read_message(ros_type, data + bytes(3)).keys()
    with pytest.raises(ValueError, match="4 bytes after its end"):
        read_message(ros_type, data + bytes(4))


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"door_id": 2**32}, "door_id"),
        ({"key": 7}, "key"),
        ({"salt": bytes(15)}, "salt: expected 16 elements, got 15"),
    ],
)
def test_a_value_that_does_not_fit_is_named(values: dict[str, Any], named: str) -> None:
    """Nothing is wrapped, cut, or filled up."""
    fitting = {"salt": bytes(16), "door_id": 1, "key": "name", "value": "front"}

    with pytest.raises(ValueError, match=named):
        write_message(type_name("DoorAnnotated"), fitting | values)


def _one_of(ros_type: str) -> bytes:
    """Return a message of each of these types, with something in every array."""
    if ros_type == KEYFRAME:
        data = encode(DoorMapState())
        return write_message(KEYFRAME, _read_whole(KEYFRAME, data) | {"annotation_value": ["a"]})
    numbers = {"int8": np.ones(2, np.int8), "uint8": bytes(16)}
    return write_message(
        ros_type,
        {
            field.name: "map"
            if field.type == "string"
            else numbers[field.type]
            if field.count is not None
            else 1
            for field in flat_fields(ros_type)
        },
    )


def _read_whole(ros_type: str, data: bytes) -> dict[str, Any]:
    """Return all of a message: texts in arrays are walked when they are asked for."""
    read = read_message(ros_type, data)
    return {name: list(v) if _is_texts(v) else v for name, v in read.items()}
