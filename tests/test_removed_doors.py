"""Doors that are gone, asked for by what they were called; and names that are another's id."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.best_times import best_time
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.core.model.doors import DoorId
from semmap_log.errors import DoorRemovedError, UnknownDoorError

Verb = Callable[[sl.DoorLogWriter, str], object]

VERBS: dict[str, Verb] = {
    "observe": lambda log, door: log.observe(door, "open"),
    "update": lambda log, door: log.update_door(door, state="open"),
    "annotate": lambda log, door: log.annotate(door, "kind", "sliding"),
    "request": lambda log, door: log.request(door, "open"),
    "passed": lambda log, door: log.passed(door),
    "remove": lambda log, door: log.remove_door(door),
}


@pytest.fixture
def log(tmp_path: Path) -> Iterator[sl.DoorLogWriter]:
    """A log whose door `front` was removed, by event 2, and whose door `side` is there."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(name="front", at="2026-03-01T08:00")
        log.remove_door("front", at="2026-03-01T12:00")
        log.add_door(name="side")
        yield log


@pytest.mark.parametrize("door", ["front", "0/front", "1", "id:1"])
@pytest.mark.parametrize("verb", VERBS)
def test_a_removed_door_is_named_with_its_id_and_the_way_back(
    verb: str, door: str, log: sl.DoorLogWriter
) -> None:
    """However it is called, by every verb that writes."""
    said = r"^door 'front' \(id 1\) was removed.* semmap-log retract .*log 2$"

    with pytest.raises(DoorRemovedError, match=said):
        VERBS[verb](log, door)


def test_what_happened_before_the_removal_is_told_by_name_too(log: sl.DoorLogWriter) -> None:
    """As by its id."""
    log.observe("front", "open", at="2026-03-01T10:00")

    assert "OPEN" == log.replay(at="2026-03-01T11:00").doors[DoorId(1)].state.name


@pytest.mark.parametrize("door", ["front", "0/front", "1", "id:1"])
def test_who_asks_about_it_is_told_how_to_ask_about_the_time_before(
    door: str, log: sl.DoorLogWriter
) -> None:
    """And that question is answered."""
    read = sl.read(log.path)
    asked: list[Callable[[], object]] = [
        lambda: probabilities(read, doors=[door]),
        lambda: best_time(read, door, "open"),
        lambda: read.resolve(door),
    ]
    for ask in asked:
        with pytest.raises(UnknownDoorError, match=r"'front' \(id 1\) .*: --at event:1\.$"):
            ask()

    (belief,) = probabilities(read, at="event:1", doors=[door])
    assert (1, 1) == (belief.door.door_id, read.resolve_any_door(door))


def test_a_name_of_two_removed_doors_asks_which(log: sl.DoorLogWriter) -> None:
    """No question takes the first of them in silence; what it says to write works."""
    log.add_door(name="front")
    log.remove_door("front")
    said = "'front' is the name of 2 doors that were removed; say which by id:1 or id:3"

    for ask in (lambda: log.observe("front", "open"), lambda: log.resolve_any_door("front")):
        with pytest.raises(UnknownDoorError, match=said):
            ask()
    assert [5, 6, 7] == [entry.number for entry in log.history("id:3")]
    with pytest.raises(DoorRemovedError, match=r"'front' \(id 3\)"):
        log.observe("id:3", "open")


def test_a_door_that_is_there_comes_before_those_that_bore_its_name(log: sl.DoorLogWriter) -> None:
    """Removed doors are looked for last."""
    again = log.add_door(name="front")

    assert again == log.resolve("front") == log.resolve_any_door("front")


def test_what_a_number_with_two_meanings_asks_for_can_be_written(log: sl.DoorLogWriter) -> None:
    """The id that is somebody's name: `id:2` is always the id."""
    called = log.add_door(name="2")

    with pytest.raises(UnknownDoorError, match=r"'2' can mean 2 doors: .*by id:3 or id:2\."):
        log.observe("2", "open")
    assert (2, called) == (log.resolve("id:2"), log.resolve(f"id:{called}"))
    assert called == log.resolve("0/2")


@pytest.mark.parametrize(
    ("text", "said"),
    [("id:9", "door 9 is not in the map"), ("id:", "such as id:7"), ("id:two", "such as id:7")],
)
def test_an_id_that_is_none_is_told(text: str, said: str, log: sl.DoorLogWriter) -> None:
    """Not taken for a name."""
    with pytest.raises(UnknownDoorError, match=said):
        log.observe(text, "open")
