"""Classes of objects as values: words for states, and outlines as text."""

from __future__ import annotations

import copy
import math
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.core.model.doors import (
    DOOR,
    Door,
    DoorId,
    DoorState,
    Geometry,
    ObjectClass,
    outline_text,
    parse_outline,
)
from semmap_log.core.model.events import ClassDefined

numbers = st.floats(-1e6, 1e6)


def test_a_class_is_what_its_event_says() -> None:
    said = ClassDefined(
        class_name="lift", geometry="segment", states="here, away ,riding", blocks="Away,RIDING"
    )

    assert said.object_class == ObjectClass(
        "lift", Geometry.SEGMENT, ("here", "away", "riding"),
        frozenset([DoorState.CLOSED, DoorState.MOVING]),
    )  # fmt: skip


@pytest.mark.parametrize("typed", ["taken", " TAKEN ", "closed", "Closed"])
def test_a_state_is_told_by_its_word_or_its_name(typed: str) -> None:
    dock = ObjectClass.told("dock", "point", "free,taken", "")

    assert DoorState.CLOSED is dock.state(typed)
    assert "taken" == dock.word(DoorState.CLOSED)
    assert "OFFLINE" == dock.word(DoorState.OFFLINE)


@pytest.mark.parametrize("typed", ["moving", "wet", "", "free,taken"])
def test_a_state_that_a_class_has_not_is_refused(typed: str) -> None:
    dock = ObjectClass.told("dock", "point", "free,taken", "")

    with pytest.raises(ValueError, match="UNKNOWN free taken OFFLINE"):
        dock.state(typed)
    assert not dock.has(DoorState.MOVING)
    assert DOOR.has(DoorState.MOVING)


@given(st.lists(st.tuples(numbers, numbers), min_size=3, max_size=9))
def test_an_outline_survives_being_text(corners: list[tuple[float, float]]) -> None:
    assert tuple(corners) == parse_outline(outline_text(corners))


@pytest.mark.parametrize(
    "text",
    ["", "0,0 1,1", "0,0 1,1 nan,2", "0,0 1,1 2", "0,0 1,1 2,2,2", "a,b c,d e,f", "0,0 " * 1001],
)
def test_what_is_no_outline_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="corners, X,Y in metres"):
        parse_outline(text)


@given(numbers, numbers, st.floats(-7, 7))
def test_an_outline_turns_and_moves_with_its_object(x: float, y: float, theta: float) -> None:
    """Beside complex numbers: a turn is a product, a move a sum."""
    spill = ObjectClass.told("spill", "polygon", "dry,wet", "wet")
    corners = ((0.0, 0.0), (2.0, 0.0), (1.0, 3.0))
    door = Door(
        DoorId(1), 0, x, y, theta, 0.0, DoorState.OPEN, math.nan, math.nan,
        annotations={"outline": outline_text(corners)}, object_class=spill,
    )  # fmt: skip

    turn = complex(math.cos(theta), math.sin(theta))
    for (seen_x, seen_y), (own_x, own_y) in zip(door.outline, corners, strict=True):
        expected = complex(x, y) + turn * complex(own_x, own_y)
        assert math.isclose(expected.real, seen_x, abs_tol=1e-9, rel_tol=1e-12)
        assert math.isclose(expected.imag, seen_y, abs_tol=1e-9, rel_tol=1e-12)


def test_a_door_that_comes_from_another_process_is_a_door() -> None:
    assert pickle.loads(pickle.dumps(DOOR)).is_door
    assert copy.deepcopy(DOOR).is_door
    assert not ObjectClass.told("dock", "point", "free,taken", "").is_door


def test_only_a_polygon_has_an_outline() -> None:
    """A word that is none, or one of a door, draws nothing."""
    corners = {"outline": "0,0 1,0 1,1"}
    door = Door(DoorId(1), 0, 1.0, 1.0, 0.0, 0.9, DoorState.OPEN, math.nan, math.nan,
                annotations=corners)  # fmt: skip

    assert () == door.outline
    assert (door.start, door.end) == door.extent
