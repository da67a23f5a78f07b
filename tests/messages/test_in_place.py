"""Messages with arrays, read in place: what rosbags reads, and no byte more."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from semmap_log.folds.door_map import DoorMapState
from semmap_log.messages import deserialize, read_in_place, texts_in, type_name
from semmap_log.messages.typestore import serialize
from semmap_log.replay.keyframes import encode

_ELEMENTS = {"u4": st.integers(0, 2**32 - 1), "u2": st.integers(0, 2**16 - 1),
             "u1": st.integers(0, 255), "i8": st.integers(-(2**63), 2**63 - 1),
             "f8": st.floats()}  # fmt: skip
_TEXTS = ("level_name", "annotation_key", "annotation_value")


@st.composite
def keyframes(draw: st.DrawFn) -> bytes:
    """Return the CDR bytes of a Keyframe with arrays of any lengths, as rosbags writes them."""
    empty = deserialize(type_name("Keyframe"), encode(DoorMapState()))
    values: dict[str, Any] = {}
    for name in empty.__dataclass_fields__:
        value = getattr(empty, name)
        if name in _TEXTS:
            values[name] = draw(st.lists(st.text().map(lambda text: text.replace("\0", "")),
                                         max_size=4))  # fmt: skip
        elif name == "state_hash":
            values[name] = value
        elif isinstance(value, np.ndarray):
            size = draw(st.integers(0, 3))
            values[name] = draw(arrays(value.dtype, size, elements=_ELEMENTS[value.dtype.str[1:]]))
        elif name != "__msgtype__":
            values[name] = draw(st.integers(0, 2**31))
    return serialize(type_name("Keyframe"), **values)


@pytest.mark.slow
@given(keyframes())
def test_it_reads_what_rosbags_reads(data: bytes) -> None:
    """
    Every field, whatever the lengths of the arrays before it make of its alignment.
    """
    theirs = deserialize(type_name("Keyframe"), data)

    ours = read_in_place("Keyframe", data)

    for name, value in ours.items():
        expected = getattr(theirs, name)
        if name in _TEXTS:
            assert expected == list(value)
        else:
            assert np.asarray(expected).tobytes() == np.asarray(value).tobytes()


def test_a_message_that_is_cut_is_an_error_at_every_byte() -> None:
    """
    Never other values, nor an error of another kind.
    """
    state = DoorMapState()
    data = serialize(type_name("Keyframe"), **_fields(encode(state)) | {"level_name": ["ground"]})
    for end in range(len(data) - 8):
        with pytest.raises(ValueError, match=r"Keyframe|text"):
            list(read_in_place("Keyframe", data[:end])["annotation_value"])


def _fields(data: bytes) -> dict[str, Any]:
    message = deserialize(type_name("Keyframe"), data)
    names = [name for name in message.__dataclass_fields__ if name != "__msgtype__"]
    return {name: getattr(message, name) for name in names}


def note_of(said: list[str]) -> bytes:
    names = ("actor", "source", "reason", "correlation")
    texts = dict(zip(names, said, strict=True))
    return serialize(type_name("CommitNote"), salt=np.zeros(16, np.uint8), **texts)


@given(st.lists(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"])),
                min_size=4, max_size=4))  # fmt: skip
def test_the_texts_of_a_note_are_what_was_written(said: list[str]) -> None:
    """
    Of any length, in any script; they begin behind the encapsulation and the salt.
    """
    assert said == texts_in(note_of(said), 20, 4)


def test_texts_that_are_cut_are_an_error_at_every_byte() -> None:
    """
    And so is a text whose last byte is not the 0 that ends it.
    """
    data = note_of(["ann", "", "it was late", "t7"])

    for end in range(20, len(data)):
        with pytest.raises(ValueError, match="does not end"):
            texts_in(data[:end], 20, 4)
    with pytest.raises(ValueError, match="does not end"):
        texts_in(data[:-1] + b"x", 20, 4)
