"""The doors of a map as lasers are asked about them, and what is said of visits to them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from semmap_log.analysis.scans.visit import DoorPlaces, Visit
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorRemoved,
    DoorUpdated,
    Event,
    RobotPose,
)
from semmap_log.interop.topics.lasers.door_places import DoorsNow, changes_places, places_of
from semmap_log.interop.topics.lasers.scan_keeper import VisitTally
from semmap_log.interop.topics.topic_reader import Known

ONE = DoorId(1)


def _known(*events: Event) -> Known:
    known = Known()
    for event in events:
        known.apply(event)
    return known


def _door(number: int, x: float = 1.0, level: int = 0) -> DoorAdded:
    return DoorAdded(
        door_id=DoorId(number), level=level, x=x, y=2.0, theta=0.5, width=0.9, happened_ns=1
    )


def _note(key: str, value: str, number: int = 1) -> DoorAnnotated:
    return DoorAnnotated(door_id=DoorId(number), key=key, value=value, happened_ns=2)


def test_doors_with_a_place_have_it_with_their_kinds() -> None:
    """Those without are no laser's business; rows belong together."""
    known = _known(
        _door(1), DoorAdded(door_id=DoorId(2), level=0, happened_ns=1), _door(3, x=4.0, level=2),
        _note("kind", "sliding", 3), _note("glass", "yes", 3),
    )  # fmt: skip

    places = places_of(known.doors.values())

    assert ([1, 3], [0, 2]) == (places.ids.tolist(), places.levels.tolist())
    np.testing.assert_array_equal([[1, 2, 0.5, 0.9], [4, 2, 0.5, 0.9]], places.lines)
    assert (("", "sliding"), [False, True]) == (places.kinds, places.glass.tolist())


@pytest.mark.parametrize(
    ("value", "is_glass"),
    [("yes", True), ("Glass", True), ("1", True), ("no", False), ("False", False), (" 0 ", False)],
)
def test_glass_is_what_is_not_denied(value: str, is_glass: bool) -> None:
    """People write it in many ways."""
    places = places_of(_known(_door(1), _note("glass", value)).doors.values())

    assert [is_glass] == places.glass.tolist()


def test_no_doors_are_rows_of_none() -> None:
    """With the shapes of any."""
    assert (0, 4) == places_of([]).lines.shape


@pytest.mark.parametrize(
    ("event", "changes"),
    [
        (_door(1), True),
        (DoorRemoved(door_id=ONE), True),
        (DoorUpdated(door_id=ONE, changed=Changed.WIDTH, width=1.0), True),
        (DoorUpdated(door_id=ONE, changed=Changed.STATE, state=DoorState.OPEN), False),
        (DoorObserved(door_id=ONE, state=DoorState.OPEN), False),
        (_note("kind", "double"), True),
        (_note("glass", "yes"), True),
        (_note("room", "lab"), False),
        (RobotPose(x=1, y=2, theta=3), False),
    ],
)
def test_only_what_moves_a_door_makes_places_anew(event: Event, changes: bool) -> None:
    """A sighting does not: there are many, and visits go on over them."""
    known = _known(_door(1))
    doors = DoorsNow(known)
    before = doors.at(0)

    doors.saw([event])

    assert changes == changes_places(event)
    assert changes == (doors.at(0) is not before)


def _visit(**values: Any) -> Visit:
    usual = {
        "door_id": ONE, "first_ns": 0, "last_ns": 1, "scans": 9, "state": DoorState.CLOSED,
        "accuracy": 0.9, "opening": 0.0, "ajar": 0.0, "looks": 9.0, "through": 0.0,
        "stopped": 9.0, "behind_m": 0.0, "near": 9.0,
    }  # fmt: skip
    return Visit(**usual | values)


def _warnings(*visits: Visit) -> list[str]:
    tally = VisitTally()
    for visit in visits:
        tally.add(visit)
    return list(tally.warnings(lambda door_id: f"{door_id} (lab)"))


@pytest.mark.parametrize(
    ("offsets", "said"),
    [
        ([0.22, 0.2, 0.24], "beams end 0.22 m behind"),
        ([-0.3, -0.28, -0.31], "beams end 0.30 m before"),
        ([0.22, 0.2], ""),
        ([0.22, -0.2, 0.24], ""),
        ([0.02, 0.3, 0.31], ""),
        ([0.05, 0.06, 0.07], ""),
        ([math.nan, 0.22, 0.22], ""),
    ],
)
def test_a_door_drawn_elsewhere_is_one_on_which_visits_agree(
    offsets: list[float], said: str
) -> None:
    """Three visits at least; a leaf that stands otherwise each time is no wrong drawing."""
    found = _warnings(*(_visit(behind_m=each) for each in offsets))

    assert [True] * bool(said) == [said in each for each in found]


def test_what_was_open_or_ajar_says_nothing_of_the_drawing() -> None:
    """Its beams ended on what is behind, or on the leaf."""
    opened = [_visit(behind_m=0.3, state=DoorState.OPEN)] * 3
    ajar = [_visit(behind_m=0.3, state=DoorState.UNKNOWN, ajar=0.9)] * 3

    assert [] == _warnings(*opened, *ajar)


@pytest.mark.parametrize(
    ("others", "is_told"),
    [([], True), ([_visit()], False), ([_visit(state=DoorState.OPEN, passed=True)], False)],
    ids=["always", "shut once", "driven through"],
)
def test_a_door_that_was_never_shut_nor_driven_through_may_be_glass(
    others: list[Visit], is_told: bool
) -> None:
    """After five visits that decided."""
    opened = [_visit(state=DoorState.OPEN)] * 5

    assert is_told == any("glass" in each for each in _warnings(*opened, *others))
    assert [] == _warnings(*opened[:4])


def test_how_near_doors_were_is_of_the_robots_level() -> None:
    """A door over its head is not near."""
    tally = VisitTally()
    doors = places_of(_known(_door(1, level=2), _door(2, x=30.0)).doors.values())

    for x in (0.0, 10.0, 20.0):
        tally.stood(RobotPose(level=0, x=x, y=2.0, theta=0.0, happened_ns=1), doors)

    metres, door = tally.nearest
    assert 2 == door
    assert pytest.approx(10.4, abs=0.05) == metres
    assert "ever within 6 m (nearest: door 2, 10.4 m)" in tally.nothing_met(0)
    assert "5, the doors on level 0, 2" in tally.nothing_met(5)
    assert isinstance(doors, DoorPlaces)
