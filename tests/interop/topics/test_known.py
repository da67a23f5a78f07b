"""What messages are compared with: the doors that there are, and the numbers that are free."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import MAX_DOOR_ID, DoorId, DoorState
from semmap_log.core.model.events import (
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorRemoved,
    LevelAdded,
)
from semmap_log.errors import UnknownDoorError
from semmap_log.interop.topics.topic_reader import Known

START = 1_700_000_000 * 10**9


def test_only_doors_that_were_added_use_up_numbers() -> None:
    """What is said of a door that nobody added gives no number away: a log says the same."""
    known = Known()
    known.apply(DoorAdded(door_id=DoorId(3), happened_ns=START))
    known.apply(DoorObserved(door_id=DoorId(900), state=DoorState.OPEN, happened_ns=START))

    assert known.next_id == 4
    assert known.next_id_but({4, 5}) == 6


def test_of_several_doors_of_a_name_the_level_says_which() -> None:
    """By its number or name; a name that is there once needs none, and none hides it."""
    known = Known()
    known.apply(LevelAdded(level=1, name="ground", happened_ns=START))
    known.apply(LevelAdded(level=2, name="upper", happened_ns=START))
    for number, level, name in ((1, 1, "lab"), (2, 2, "lab"), (3, 2, "attic")):
        door = DoorId(number)
        known.apply(DoorAdded(door_id=door, level=level, happened_ns=START))
        known.apply(DoorAnnotated(door_id=door, key="name", value=name, happened_ns=START))

    assert 1 == known.called("lab", level="ground")
    assert 2 == known.called("lab", level="2") == known.called("upper/lab", level="1")
    assert 3 == known.called("attic", level="ground") == known.called("attic")
    with pytest.raises(UnknownDoorError, match="can mean doors 1, 2"):
        known.called("lab")


def test_numbers_go_on_as_in_the_log(tmp_path: Path) -> None:
    """Removed doors keep theirs; behind the last number the lowest free one follows."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        first = log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9)
        log.remove_door(first)
        known = Known.of(log)
        assert known.next_id == 2

        for event in (
            DoorAdded(door_id=DoorId(MAX_DOOR_ID)),
            DoorRemoved(door_id=DoorId(MAX_DOOR_ID)),
        ):
            known.apply(event)
            log.append([event])

        assert known.next_id == Known.of(log).next_id == 2
        assert log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9) == 2
