"""Two door maps of a log are compared without making their doors."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.folds.levels import DoorsPresent
from semmap_log.core.model.events import LevelAdded


@pytest.fixture
def log(tmp_path: Path) -> sl.DoorLogWriter:
    """Door 1 in a place with a name, 2 without probabilities, 3 without a place."""
    log = sl.create(tmp_path / "log", tz="UTC", durability="none")
    log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, prob_open=0.5, prob_closed=0.5, name="front")
    log.add_door(x=2.0, y=1.0, theta=0.0, width=1.0)
    log.add_door(name="sensor")
    return log


def _doors(log: sl.DoorLogWriter) -> DoorsPresent:
    doors = log.door_map().doors
    assert isinstance(doors, DoorsPresent)
    return doors


def test_the_same_doors_do_not_differ(log: sl.DoorLogWriter) -> None:
    """Though NaN equals nothing, not even itself."""
    assert ([], []) == _doors(log).others_than(_doors(log))


def test_what_changed_came_or_went_is_told(log: sl.DoorLogWriter) -> None:
    """By value, by name, by coming, by going; ids ascend."""
    before = _doors(log)

    log.annotate(3, "name", "probe")
    log.remove_door(2)
    log.add_door(x=9.0, y=1.0, theta=0.0, width=1.0)
    log.observe(1, "open")

    assert ([1, 3, 4], [2]) == _doors(log).others_than(before)
    assert ([1, 2, 3], [4]) == before.others_than(_doors(log))


def test_a_name_that_was_taken_back_differs(log: sl.DoorLogWriter) -> None:
    """A retraction may leave every other value as it was."""
    number = log.annotate(1, "name", "back").first_event
    log.request(1, "open")
    before = _doors(log)

    log.retract(number)

    assert [1] == _doors(log).others_than(before)[0]
    assert "front" == _doors(log)[1].name


def test_levels_with_doors_that_have_a_place(log: sl.DoorLogWriter) -> None:
    """A sensor without a place draws nothing on its level."""
    log.append([LevelAdded(level=5, name="5")])
    log.add_door(name="on five", level=5)

    assert {0} == _doors(log).placed_levels()
