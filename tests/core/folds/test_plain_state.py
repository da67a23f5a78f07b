"""States as bytes and back: the same values of the same types, or an error."""

from __future__ import annotations

import math
import pickle
from collections import Counter, defaultdict
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.core.folds.plain_state import dump_plain, load_plain
from semmap_log.core.model.doors import DoorState
from semmap_log.errors import CheckpointError

KEYS = st.none() | st.booleans() | st.integers() | st.text() | st.binary() | st.floats()
PLAIN = st.recursive(
    KEYS,
    lambda inner: (
        st.lists(inner)
        | st.lists(inner).map(tuple)
        | st.sets(KEYS)
        | st.frozensets(KEYS)
        | st.dictionaries(KEYS | st.tuples(KEYS, KEYS), inner)
        | st.dictionaries(KEYS, st.integers()).map(Counter)
    ),
    max_leaves=20,
)


def _said(value: Any) -> Any:
    """Return all that there is to a value, types too, in a form in which NaN is equal to itself."""
    if isinstance(value, dict):
        return type(value), [(_said(k), _said(v)) for k, v in value.items()]
    if isinstance(value, (set, frozenset)):
        return type(value), sorted(map(repr, value))
    if isinstance(value, (list, tuple)):
        return type(value), [_said(item) for item in value]
    return type(value), repr(value)


@given(PLAIN)
def test_plain_values_come_back_as_they_were(state: Any) -> None:
    """Numbers, texts, bytes, and what holds them, with keys of any plain type, in their order."""
    assert _said(state) == _said(load_plain(dump_plain(state)))


@pytest.mark.parametrize(
    "array",
    [
        np.arange(12.0).reshape(3, 4),
        np.asfortranarray(np.arange(12).reshape(3, 4)),
        np.array(7, np.uint8),
        np.zeros((0, 3), np.float32),
        np.array([(1, 2.5)], [("door_id", "u4"), ("p", "f8")]),
        np.array(["2026-03-01"], "M8[ns]"),
        np.array([math.nan, -0.0]),
        np.array(["front", ""]),
        np.zeros(3, [(f"field_{i}", "f8") for i in range(500)]),
    ],
    ids=lambda array: str(array.dtype)[:20],
)
def test_arrays_come_back_as_they_were(array: np.ndarray) -> None:
    """Alone, and anywhere within plain values; they can be changed in place afterwards."""
    alone = load_plain(dump_plain(array))
    within = load_plain(dump_plain({"a": [array, (array, 1)]}))

    assert array.tobytes() == alone.tobytes()
    assert (array.dtype, array.shape) == (alone.dtype, alone.shape)
    assert array.tobytes() == within["a"][1][0].tobytes()
    assert alone.flags.writeable


def test_numpy_numbers_stay_numpy_numbers() -> None:
    """As values and as keys: what was counted with numpy goes on as it was."""
    state = {np.uint32(3): np.float64(0.5), "n": np.int64(2), "t": np.bool_(True)}

    back = load_plain(dump_plain(state))

    assert state == back
    assert [type(v) for v in (*state, *state.values())] == [
        type(v) for v in (*back, *back.values())
    ]


class Odd:
    pass


@pytest.mark.parametrize(
    ("state", "what"),
    [
        (Odd(), r"the state is a Odd"),
        ({"doors": [1, {2: Odd()}]}, r"the state\['doors'\]\[1\]\[2\] is a Odd"),
        ({(1, DoorState.OPEN): 1}, r"a key of the state\[1\] is a DoorState"),
        (defaultdict(int), "is a defaultdict"),
        (np.array([Odd()]), "cannot be stored"),
        (1j, "is a complex"),
        (np.ma.masked_array([1.0]), "is a MaskedArray"),
    ],
)
def test_what_would_come_back_as_something_else_is_refused(state: Any, what: str) -> None:
    """The error names the place, the type, and the way out."""
    with pytest.raises(CheckpointError, match=rf"{what}.*dump\(state\) -> bytes"):
        dump_plain(state)


def test_a_state_that_holds_itself_is_refused() -> None:
    """Instead of running until the memory is full."""
    state: list[Any] = []
    state.append(state)

    with pytest.raises(CheckpointError, match="cannot be stored"):
        dump_plain(state)


def test_nothing_of_a_foreign_file_is_run() -> None:
    """A pickle in the place of an array, or of all of it, is not what we made."""
    pickled = pickle.dumps(np.array([Odd()], object))
    whole = dump_plain(np.zeros(3))
    head = whole[: whole.index(b"\n") + 1]

    for data in (pickled, head + pickled, head, head + whole[len(head) : -1], b"", b"[1]\n"):
        with pytest.raises(ValueError):  # noqa: PT011 - of several kinds
            load_plain(data)


@given(st.binary(max_size=60))
def test_random_bytes_are_a_value_error_or_a_plain_value(data: bytes) -> None:
    """No other error, whatever the bytes."""
    try:
        load_plain(data)
    except ValueError:
        return
    assert load_plain(data) is None or data.strip()
