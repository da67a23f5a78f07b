"""Objects live as doors do: added, seen, set, moved, removed, taken back, believed."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import probabilities
from semmap_log.core.folds.history import Diff
from semmap_log.core.folds.levels import DoorsPresent
from semmap_log.core.model.events import DoorAnnotated, DoorObserved
from semmap_log.errors import CommandError, InvalidEventError
from semmap_log.interop.formats.json.door_json import door_map_to_json
from semmap_log.log.door_log.summary import backdated, before_first_ns
from semmap_log.store.reading.reader import LogReader


def what(log: sl.DoorLog, **when: object) -> dict[str, tuple[str, str]]:
    """Return of each object what it is, and what its state is called."""
    doors = log.replay(**when).doors.values()  # type: ignore[arg-type]
    return {door.label: (door.object_class.name, door.state_word) for door in doors}


def test_an_object_is_what_it_was_added_as(log: sl.DoorLogWriter, path: Path) -> None:
    assert what(sl.read(path)) == {
        "front": ("door", "OPEN"), "west": ("dock", "free"), "bay": ("shutter", "CLOSED"),
        "spill 4": ("spill", "wet"),
    }  # fmt: skip
    assert ["dock", "shutter", "spill"] == list(log.replay().classes)
    assert "west" == log.replay().doors[sl.DoorId(2)].name


def test_states_are_told_by_the_words_of_a_class(log: sl.DoorLogWriter) -> None:
    """Or by the names that they have in every class; in the log they are these."""
    log.observe("west", "Taken", accuracy=0.9)
    assert ("dock", "taken") == what(log)["west"]
    log.update_door("west", state=" free ")
    assert ("dock", "free") == what(log)["west"]
    log.request("west", "taken")
    log.observe("west", "closed")
    log.observe("west", sl.DoorState.OPEN)
    log.observe("west", "unknown")

    states = [entry.event.state for entry in log.history("west") if hasattr(entry.event, "state")]
    assert [s.name for s in states] == ["OPEN", "CLOSED", "OPEN", "CLOSED", "CLOSED", "OPEN",
                                        "UNKNOWN"]  # fmt: skip


@pytest.mark.parametrize(
    ("do", "problem"),
    [
        (lambda log: log.observe("west", "wet"), "state: expected one of UNKNOWN free taken OFF"),
        (lambda log: log.observe("west", sl.DoorState.MOVING), "one of UNKNOWN free taken OFFLINE"),
        (lambda log: log.update_door("front", state="free"), "UNKNOWN OPEN CLOSED MOVING OFFLINE"),
        (lambda log: log.request(4, "taken"), "state: expected one of UNKNOWN dry wet OFFLINE"),
        (lambda log: log.add_door(object_class="bay"), "no class 'bay'; defined are: dock, shut"),
        (lambda log: log.add_door(object_class="spill", state="wet"), "at least 3 corners, got 0"),
        (lambda log: log.add_door(object_class="dock", outline=[(0, 0), (1, 0), (1, 1)]),
         "an outline is for polygons; a dock is a point"),
        (lambda log: log.add_door(object_class="spill", outline=[(n, 0) for n in range(1001)]),
         "expected 3 to 1000 corners"),
        (lambda log: log.add_door(object_class="spill", outline=[(0, 0), (1, 0), (math.inf, 1)]),
         "expected 3 to 1000 corners"),
        (lambda log: log.annotate("west", "class", "dokc"), "no class 'dokc'"),
        (lambda log: log.annotate(4, "outline", "0,0 1,1"), "expected 3 to 1000 corners"),
        (lambda log: log.define_class("door"), "no door, and without"),
        (lambda log: log.define_class("gate", states="open,shut", blocks="closed"),
         "expected some of open,shut, commas between, got 'closed'"),
        (lambda log: log.define_class("gate", geometry="line"), "one of segment polygon point"),
    ],
)  # fmt: skip
def test_what_no_object_can_be_is_refused(
    log: sl.DoorLogWriter, do: Callable[[sl.DoorLogWriter], object], problem: str
) -> None:
    """The message says what there is; nothing is written."""
    before = log.last_event()

    with pytest.raises((CommandError, InvalidEventError), match=re.escape(problem)):
        do(log)
    assert before == log.last_event()


def test_a_point_needs_no_direction_and_an_area_no_place(log: sl.DoorLogWriter) -> None:
    """An area lies at its first corner, or where it is put; its outline is in its own frame."""
    dock, spill = log.replay().doors[sl.DoorId(2)], log.replay().doors[sl.DoorId(4)]
    assert (0.0, 0.0) == (dock.theta, dock.width)
    assert (1.0, 3.0) == spill.start
    assert ((1.0, 3.0), (3.0, 3.0), (3.0, 4.0)) == spill.outline

    turned = log.add_door(
        object_class="spill", x=2.0, y=2.0, theta=3.0, outline=[(0, 0), (1, 0), (1, 2.5)]
    )
    for seen, given in zip(log.replay().doors[turned].outline, [(0, 0), (1, 0), (1, 2.5)],
                           strict=True):  # fmt: skip
        assert seen == pytest.approx(given, abs=1e-8)
    unplaced = log.add_door(object_class="dock")
    assert not log.replay().doors[unplaced].is_placed


def test_an_area_moves_with_its_place(log: sl.DoorLogWriter) -> None:
    log.update_door(4, x=11.0, y=3.0)

    assert ((11.0, 3.0), (13.0, 3.0), (13.0, 4.0)) == log.replay().doors[sl.DoorId(4)].outline


def test_what_an_object_was_holds_for_the_time_before(log: sl.DoorLogWriter) -> None:
    """A class that is defined anew, a class that is corrected, an object that is removed."""
    before = log.end_ns()
    log.define_class("dock", geometry="point", states="empty,full", blocks="")
    log.annotate("bay", "class", "")
    log.remove_door(4)

    assert ("dock", "empty") == what(log)["west"]
    assert ("door", "CLOSED") == what(log)["bay"]
    assert "spill 4" not in what(log)
    assert ("dock", "free") == what(log, at=f"@{before}")["west"]
    assert ("shutter", "CLOSED") == what(log, at=f"@{before}")["bay"]
    assert ("spill", "wet") == what(log, at=f"@{before}")["spill 4"]
    assert {2: "dock", 4: "spill"} == {i: one.name for i, one in log.objects().items()}
    assert [1, 3] == log.ids_of_class("door")


def test_a_definition_can_be_taken_back(log: sl.DoorLogWriter) -> None:
    """Then what was of that class is a door, as if the class had never been."""
    defined = next(e.number for e in log.history(kinds=["ClassDefined"]))
    log.retract(defined)

    assert ["shutter", "spill"] == list(log.replay().classes)
    assert ("door", "OPEN") == what(log)["west"]


def test_what_a_class_is_called_is_just_a_word_where_none_is_defined(path: Path) -> None:
    """As it was before there were classes: such a log says nothing of them."""
    with sl.create(path, tz="UTC", clock=SteadyClock()) as log:
        log.add_door(x=1.0, y=1.0, theta=0.0, width=1.0, name="front")
        log.annotate("front", "class", "fire door")
        log.annotate("front", "outline", "wide")
        shown = door_map_to_json(log.replay())

    assert {"classes", "class"} & {*shown, *shown["doors"][0]} == set()
    assert {"class": "fire door", "name": "front", "outline": "wide"} == (
        shown["doors"][0]["annotations"]
    )


def test_an_object_is_believed_to_be_in_a_state(log: sl.DoorLogWriter) -> None:
    """A dock that is seen free is as likely free as a door that is seen open is open."""
    both = [log.add_door(name="plain"), log.add_door(name="east", object_class="dock")]
    log.append([DoorObserved(door_id=i, state=sl.DoorState.OPEN, accuracy_open=0.9) for i in both])

    door, dock = probabilities(log, doors=both)

    assert dock.p_open == door.p_open > 0.6
    assert "dock" == dock.door.object_class.name


def test_json_says_what_each_is(log: sl.DoorLogWriter) -> None:
    shown = json.loads(json.dumps(door_map_to_json(log.replay())))

    assert {"name": "dock", "geometry": "point", "states": ["free", "taken"],
            "blocks": ["taken"]} == shown["classes"][0]  # fmt: skip
    assert [("door", "OPEN"), ("dock", "free"), ("shutter", "CLOSED"), ("spill", "wet")] == [
        (door["class"], door["state_word"]) for door in shown["doors"]
    ]


def test_what_was_there_before_its_class_was_told(log: sl.DoorLogWriter) -> None:
    """Who says that an object was there earlier says so of its class, too."""
    early = log.now_ns() - 3600 * 10**9
    log.add_door(object_class="dock", x=1.0, y=2.0, name="old", state="taken", at=early)
    log.annotate("front", "class", "shutter", at=early + 1)

    assert {"old": ("dock", "taken")} == what(log, at=f"@{early}")
    log.define_class("dock", geometry="point", states="empty,full")
    assert {"old": ("dock", "taken")} == what(log, at=f"@{early}")
    assert ("dock", "full") == what(log)["old"]


def test_objects_are_backdated_with_their_class(log: sl.DoorLogWriter, path: Path) -> None:
    """`import --since-ever`: from then on a dock is a dock."""
    early = log.now_ns() - 3600 * 10**9
    log.append([DoorObserved(door_id=sl.DoorId(2), state=sl.DoorState.CLOSED, happened_ns=early)])
    log.close()

    since_ns = before_first_ns(LogReader(path))
    assert since_ns is not None
    with sl.append(path) as again:
        doors = [sl.DoorId(number) for number in range(1, 5)]
        again.append(backdated(LogReader(path), doors, since_ns))

    assert {
        "front": ("door", "UNKNOWN"), "west": ("dock", "taken"),
        "bay": ("shutter", "UNKNOWN"), "spill 4": ("spill", "UNKNOWN"),
    } == what(sl.read(path), at=f"@{early + 1}")  # fmt: skip


def test_a_word_of_door_0_is_no_class(path: Path) -> None:
    """Whatever its key: classes stand under one that nobody types."""
    with sl.create(path, tz="UTC", clock=SteadyClock()) as log:
        log.add_door(door_id=sl.DoorId(0))
        log.annotate(0, "class:x", "segment\nA,B\nA")

        assert {} == log.replay().classes
        assert {"class:x"} == set(log.replay().doors[sl.DoorId(0)].annotations)


def test_what_was_said_before_an_object_came_is_not_said_of_it(log: sl.DoorLogWriter) -> None:
    """Not in the map, and not where all objects are listed."""
    early = log.now_ns() - 10**9
    new = log.add_door(name="new")
    log.append([DoorAnnotated(door_id=new, key="class", value="dock", happened_ns=early)])

    assert ("door", "UNKNOWN") == what(log)["new"]
    assert new not in log.objects()
    assert new in log.ids_of_class("door")


def test_a_command_that_comes_again_is_stored_once(log: sl.DoorLogWriter) -> None:
    again = bytes(16)
    first = log.add_door(object_class="dock", x=1.0, y=2.0, command_id=again)

    assert first == log.add_door(object_class="dock", x=1.0, y=2.0, command_id=again)
    assert log.define_class("gate", command_id=b"1" * 16).first_event == (
        log.define_class("gate", command_id=b"1" * 16).first_event
    )


def test_a_diff_tells_what_was_said(log: sl.DoorLogWriter) -> None:
    begin = log.end_ns()
    log.annotate("bay", "class", "")

    found: Diff = log.diff(f"@{begin}", "now")

    assert ["annotations", "object_class"] == [change.field for change in found.changed]
    made = found.applied_to(log.replay(at=f"@{begin}")).doors
    assert [str(door.object_class) for door in log.replay().doors.values()] == [
        str(door.object_class) for door in made.values()
    ]

    begin = log.end_ns()
    log.define_class("dock", geometry="point", states="empty,full")
    (changed,) = log.diff(f"@{begin}", "now").changed
    assert ("object_class", "dock (point; free,taken; taken blocks)") == (
        changed.field, str(changed.before)
    )  # fmt: skip


def test_who_only_tells_facts_may_tell_what_an_object_is(log: sl.DoorLogWriter) -> None:
    """An import, or a recorder: what its words mean is found when it is asked."""
    log.append([DoorAnnotated(door_id=sl.DoorId(1), key="class", value="dock")])

    assert ("dock", "free") == what(log)["front"]


def test_classes_are_no_words_of_a_door_that_the_thesis_calls_0(path: Path) -> None:
    """In a state they stand beside what is said of that door."""
    with sl.create(path, tz="UTC", clock=SteadyClock()) as log:
        log.define_class("dock")
        log.add_door(door_id=sl.DoorId(0), name="first", object_class="dock")
        log.define_class("gate")

        assert {"class": "dock", "name": "first"} == log.replay().doors[sl.DoorId(0)].annotations


@pytest.mark.parametrize(
    "do",
    [
        lambda log: log.annotate("bay", "class", "spill"),
        lambda log: log.annotate(4, "outline", "0,0 1,0 1,1"),
        lambda log: log.define_class("dock", geometry="point", states="free,taken", blocks=""),
    ],
)
def test_who_follows_sees_that_an_object_is_another(
    log: sl.DoorLogWriter, do: Callable[[sl.DoorLogWriter], object]
) -> None:
    """What is drawn of it must be drawn anew, though no field of it has changed."""
    before = log.replay().doors
    number = log.last_event() + 1
    do(log)
    now = log.replay().doors
    assert isinstance(before, DoorsPresent)
    assert isinstance(now, DoorsPresent)

    changed, gone = now.others_than(before)

    meant = {"class": [3], "outline": [4], "": [2]}
    assert (meant[getattr(log.event(number).event, "key", "")], []) == (changed, gone)
