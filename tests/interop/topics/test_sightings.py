"""Open-RMF's messages and sensors: which door, which state, how often."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorRequested,
    Event,
    FloorMap,
    LevelAdded,
    RobotPose,
)
from semmap_log.interop.topics.topic_reader import Known
from semmap_log.interop.topics.topic_rules import (
    Accuracy,
    ReadPose,
    ReadRmfRequest,
    ReadRmfState,
    ReadSensor,
    RosMapping,
)
from tests.interop.topics.robots import START, Listener, Robot, S

ROBOT = Robot()
CLOSED, MOVING, OPEN, OFFLINE, UNKNOWN = range(5)
"""rmf_door_msgs/DoorMode."""


def _states(**rule: Any) -> Listener:
    return Listener({"/door_states": ReadRmfState(**rule)}, _front())


def _front(level: int = 0) -> Known:
    known = Known()
    _add(known, 1, "front", level)
    return known


def _add(known: Known, number: int, name: str, level: int) -> None:
    door = DoorId(number)
    known.apply(DoorAdded(door_id=door, level=level, happened_ns=START))
    known.apply(DoorAnnotated(door_id=door, key="name", value=name, happened_ns=START))


def _sensor(**rule: Any) -> Listener:
    return Listener({"/s": ReadSensor("front", **rule)}, _front())


def _said(events: list[Event]) -> list[tuple[int, str]]:
    return [(e.door_id, e.state.name) for e in events if isinstance(e, DoorObserved)]


def test_the_five_modes_are_the_five_states() -> None:
    """And a sixth is told, and left out."""
    listener = _states()

    said = [_said(listener.hear("/door_states", ROBOT.door_state("front", mode), mode))
            for mode in (CLOSED, MOVING, OPEN, OFFLINE, UNKNOWN, 5)]  # fmt: skip

    names = ["CLOSED", "MOVING", "OPEN", "OFFLINE", "UNKNOWN"]
    assert [*([(1, name)] for name in names), []] == said
    assert [
        "/door_states: a door mode that Open-RMF does not have; passed over: 5"
    ] == listener.told


def test_a_sighting_that_repeats_is_left_out_for_a_while() -> None:
    """Within 60 s the same is not said again; another state is, at once, and so is going back."""
    listener = _states()

    kept = [
        second
        for second, mode in [(0, OPEN), (1, OPEN), (59.9, OPEN), (60, OPEN), (61, CLOSED),
                             (61.5, OPEN), (62, OPEN), (122, OPEN)]
        if listener.hear("/door_states", ROBOT.door_state("front", mode), second)
    ]  # fmt: skip

    assert [0, 60, 61, 61.5, 122] == kept


def test_no_limit_keeps_every_sighting() -> None:
    """`repeats: 0`."""
    listener = Listener({"/s": ReadSensor("front")}, _front(), RosMapping(repeats_s=0))
    said = [listener.hear("/s", ROBOT.said("Bool", True), 0.001 * n) for n in range(3)]

    assert [1, 1, 1] == [len(events) for events in said]


def test_two_sources_do_not_repeat_each_other() -> None:
    """What one topic said is news from another."""
    known = _front()
    readings = {"/a": ReadSensor("front"), "/b": ReadSensor("front")}
    listener = Listener(readings, known)

    said = [len(listener.hear(topic, ROBOT.said("Bool", True))) for topic in ("/a", "/b", "/a")]

    assert [1, 1, 0] == said


def test_a_number_as_a_robots_name_is_no_id_of_ours() -> None:
    """Doors "2" and "1" of Open-RMF are two doors, whatever ids they got."""
    listener = Listener({"/door_states": ReadRmfState(), "/mapped": ReadRmfState({"east": "1"})})

    for name in ("2", "1"):
        listener.hear("/door_states", ROBOT.door_state(name, OPEN))
    again = listener.hear("/door_states", ROBOT.door_state("1", CLOSED), 1)
    mapped = listener.hear("/mapped", ROBOT.door_state("east", CLOSED), 1)

    assert {1: "2", 2: "1"} == {number: d.name for number, d in listener.known.doors.items()}
    assert [(2, "CLOSED")] == _said(again)
    assert [(2, "CLOSED")] == _said(mapped)


@pytest.mark.parametrize(
    ("unknown", "door", "told"), [("add", 2, 0), ("ignore", None, 0), ("error", None, 1)]
)
def test_the_mapping_says_what_becomes_of_unknown_doors(
    unknown: str, door: int | None, told: int
) -> None:
    """A new unplaced door of that name, once; nothing; or a complaint."""
    listener = _states(unknown=unknown)

    first = listener.hear("/door_states", ROBOT.door_state("back", OPEN))
    second = listener.hear("/door_states", ROBOT.door_state("back", CLOSED), 1)

    assert ([] if door is None else [(door, "OPEN")]) == _said(first)
    assert ([] if door is None else [(door, "CLOSED")]) == _said(second)
    assert told == len(listener.told)
    added = [event for event in first if isinstance(event, DoorAdded)]
    assert [math.isnan(event.x) for event in added] == ([] if door is None else [True])
    named = [event.value for event in first if isinstance(event, DoorAnnotated)]
    assert ([] if door is None else ["back"]) == named


def test_doors_are_found_by_name_by_level_and_name_and_by_table() -> None:
    """A name on two levels is not clear; with the level, or in the table, it is."""
    known = Known()
    for number, level in ((1, 1), (2, 2)):
        known.apply(LevelAdded(level=level, name=f"L{level}", happened_ns=START))
        _add(known, number, "lab", level)
    rule = ReadRmfState(doors={"rmf_lab": "L2/lab", "seven": "1"})
    listener = Listener({"/d": rule}, known)

    names = ["L1/lab", "2/lab", "rmf_lab", "seven", "lab"]
    said = [
        _said(listener.hear("/d", ROBOT.door_state(name, OPEN), s)) for s, name in enumerate(names)
    ]

    assert [[(1, "OPEN")], [(2, "OPEN")], [], [], []] == said  # 3 and 4 say the same again
    (told,) = listener.told
    assert "lab can mean doors 1, 2" in told


def test_a_new_door_with_a_known_level_in_its_name_is_put_there() -> None:
    """`L2/attic` is the door attic on L2; a level that nobody knows is a part of the name."""
    known = _front()
    known.apply(LevelAdded(level=2, name="L2", happened_ns=START))
    listener = Listener({"/d": ReadRmfState(level="2")}, known)

    listener.hear("/d", ROBOT.door_state("L2/attic", OPEN))
    listener.hear("/d", ROBOT.door_state("wing/door", OPEN))
    again = listener.hear("/d", ROBOT.door_state("wing/door", CLOSED), 1)

    doors = listener.known.doors
    assert ("attic", 2) == (doors[2].name, doors[2].level)
    assert "wing/door" == doors[3].name
    assert [(3, "CLOSED")] == _said(again)


def test_a_request_says_who_asked() -> None:
    """It changes no state; repeated within the limit it is left out, by another not."""
    listener = Listener({"/door_requests": ReadRmfRequest()}, _front())

    made = [listener.made("/door_requests", ROBOT.door_request("front", OPEN, who), second)
            for second, who in enumerate(["tug1", "tug1", "tug2"])]  # fmt: skip

    requested = DoorRequested(door_id=DoorId(1), state=DoorState.OPEN, happened_ns=START)
    assert [requested] == made[0].events
    assert ["tug1", "", "tug2"] == [each.actor for each in made]
    assert DoorState.UNKNOWN == listener.known.doors[1].state


@pytest.mark.parametrize(
    ("kind", "value", "rule", "state"),
    [
        ("Bool", True, {}, "OPEN"),
        ("Bool", False, {}, "CLOSED"),
        ("String", "closed", {}, "CLOSED"),
        ("String", " Moving ", {}, "MOVING"),
        ("String", "ajar", {}, None),
        ("Bool", True, {"states": {True: DoorState.CLOSED}}, "CLOSED"),
        ("Bool", False, {"states": {True: DoorState.CLOSED}}, None),
        ("UInt8", 3, {"states": {3: DoorState.OFFLINE}}, "OFFLINE"),
        ("UInt8", 1, {}, None),
        ("Float64", 1.5, {"open_above": 1.2, "closed_below": 0.4}, "OPEN"),
        ("Float64", 0.3, {"open_above": 1.2, "closed_below": 0.4}, "CLOSED"),
        ("Float64", 0.8, {"open_above": 1.2, "closed_below": 0.4}, None),
        ("Float64", math.nan, {"open_above": 1.2, "closed_below": 0.4}, None),
    ],
)
def test_a_sensors_value_means_a_state(
    kind: str, value: Any, rule: dict[str, Any], state: str | None
) -> None:
    """As the mapping says, or plainly; a value that means none is told, and left out."""
    listener = _sensor(accuracy=Accuracy(0.9, 0.95), **rule)

    events = listener.hear("/s", ROBOT.said(kind, value))

    assert {(0.9, 0.95)} >= {
        (e.accuracy_open, e.accuracy_closed) for e in events if isinstance(e, DoorObserved)
    }

    assert ([] if state is None else [(1, state)]) == _said(events)
    assert (1 if state is None else 0) == len(listener.told)


def test_a_field_can_lie_deep_and_must_be_there() -> None:
    """A path with dots; one that leads nowhere is told."""
    name, data = ROBOT.door_state("any", OPEN)
    deep = _sensor(path="current_mode.value", states={2: DoorState.OPEN})
    nowhere = _sensor(path="current_mode.colour")

    assert [(1, "OPEN")] == _said(deep.hear("/s", (name, data)))
    assert [] == nowhere.hear("/s", (name, data))
    assert "has no attribute 'colour'" in nowhere.told[0]


@pytest.mark.parametrize(
    ("stamp_s", "happened_s"),
    [(99, 99), (40, 40), (39, 100), (100, 100), (101, 100), (None, 100)],
)
def test_a_stamp_counts_if_it_can_be_believed(stamp_s: int | None, happened_s: int) -> None:
    """From a minute before the message came up to then; zero, older and later ones do not."""
    listener = _states()
    at_ns = 0 if stamp_s is None else START + stamp_s * S

    (event,) = listener.hear("/door_states", ROBOT.door_state("front", OPEN, at_ns), 100)

    assert START + happened_s * S == event.happened_ns


def test_where_the_robot_was_is_kept_with_a_sighting() -> None:
    """Its last pose, though it moved less than the filter lets through; once."""
    readings = {"/p": ReadPose(), "/s": ReadSensor("front")}
    listener = Listener(readings, _front())
    listener.hear("/p", ROBOT.pose(1.0, 1.0, 0.0))
    listener.hear("/p", ROBOT.pose(1.1, 1.0, 0.0), 1)

    first = listener.hear("/s", ROBOT.said("Bool", True), 2)
    second = listener.hear("/s", ROBOT.said("Bool", False), 3)

    assert [RobotPose, DoorObserved] == [type(event) for event in first]
    assert 1.1 == first[0].x  # type: ignore[attr-defined]
    assert [DoorObserved] == [type(event) for event in second]


@pytest.mark.parametrize("version", [1, 2])
def test_bytes_that_are_no_such_message_are_told(version: Any) -> None:
    """Cut short at any place: never an event but of the whole message, never a crash."""
    robot = Robot(version)
    name, data = robot.door_state("front", OPEN)

    for size in range(len(data)):
        listener = Listener({"/d": ReadRmfState()}, _front(), version=version)
        assert [] == listener.hear("/d", (name, data[:size]))
        assert 1 == len(listener.told)


def test_a_message_of_another_type_is_told() -> None:
    """What somebody else publishes under the topic's name is not read as what was expected."""
    listener = _states()

    assert [] == listener.hear("/door_states", ROBOT.said("String", "front"))
    assert "rmf_door_msgs/DoorState" in listener.told[0]


def test_what_is_known_is_what_the_log_would_say(tmp_path: Path) -> None:
    """Doors, levels, rounds and floor plans, taken from a log and followed event by event."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        known = Known.of(log)
        listener = Listener({"/d": ReadRmfState()}, known)
        for second, (name, mode) in enumerate([("a", OPEN), ("b", CLOSED), ("a", CLOSED)]):
            log.append(listener.hear("/d", ROBOT.door_state(name, mode), second))
        log.start_patrol()

        after = Known.of(log)

    assert after.doors.keys() == known.doors.keys()
    assert [(d.name, d.state) for d in after.doors.values()] == [
        (d.name, d.state) for d in known.doors.values()
    ]
    assert (1, 0) == (after.last_started, after.last_finished)
    assert after.next_id == known.next_id
    assert not any(isinstance(each, FloorMap) for each in after.floor_maps.values())
