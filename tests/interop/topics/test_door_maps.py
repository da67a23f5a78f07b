"""A server's DoorMap: its differences as events, whatever it does with its ids."""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import (
    Changed,
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorRemoved,
    DoorUpdated,
    LevelAdded,
)
from semmap_log.interop.topics.topic_reader import Known
from semmap_log.interop.topics.topic_rules import ReadDoorMap, ReadSensor
from tests.interop.topics.robots import ENTRY, START, Listener, Robot, S

TOPIC = "/doors"
KEY = "id in /doors"
ROBOT = Robot()


def _listener(known: Known | None = None, **rule: Any) -> Listener:
    return Listener({TOPIC: ReadDoorMap(**rule)}, known or Known())


def _door(door_id: int, **values: Any) -> dict[str, Any]:
    return {"door_id": door_id, **values}


def test_new_doors_are_added_with_the_servers_ids() -> None:
    """With all that the message says; NaN probabilities are not given."""
    listener = _listener()

    events = listener.hear(TOPIC, ROBOT.door_map([_door(7, prob_open=0.25)]), 3)

    at_ns = START + 3 * S
    added, noted = events
    assert isinstance(added, DoorAdded)
    assert (7, 1.0, 2.0, 0.5, 0.9) == (added.door_id, added.x, added.y, added.theta, added.width)
    assert (DoorState.OPEN, 0.25, at_ns) == (added.state, added.prob_open, added.happened_ns)
    assert math.isnan(added.prob_closed)
    assert DoorAnnotated(door_id=added.door_id, key=KEY, value="7", happened_ns=at_ns) == noted


@pytest.mark.parametrize(
    ("values", "changed"),
    [
        ({"pos_x": 5.0}, Changed.POSE),
        ({"pos_theta": -0.5}, Changed.POSE),
        ({"width": 1.5}, Changed.WIDTH),
        ({"door_state": "CLOSED"}, Changed.STATE),
        ({"prob_open": 0.5}, Changed.PROB_OPEN),
        ({"prob_closed": 0.5}, Changed.PROB_CLOSED),
        ({"door_state": "UNKNOWN", "width": 2.0}, Changed.STATE | Changed.WIDTH),
    ],
)
def test_what_differs_is_updated_and_nothing_else(values: dict[str, Any], changed: Changed) -> None:
    """Only the fields that changed are set; said again, they are no event."""
    listener = _listener()
    listener.hear(TOPIC, ROBOT.door_map([_door(1)]))

    events = listener.hear(TOPIC, ROBOT.door_map([_door(1, **values)]), 1)
    again = listener.hear(TOPIC, ROBOT.door_map([_door(1, **values)]), 2)

    (updated,) = events
    assert isinstance(updated, DoorUpdated)
    assert (1, changed) == (updated.door_id, updated.changed)
    assert [] == again


def test_an_id_that_is_used_again_is_another_door() -> None:
    """It gets a new id here, the annotation remembers the server's, and later messages mean it."""
    listener = _listener()
    listener.hear(TOPIC, ROBOT.door_map([_door(1), _door(2)]))

    gone = listener.hear(TOPIC, ROBOT.door_map([_door(1)]), 1)
    back = listener.hear(TOPIC, ROBOT.door_map([_door(1), _door(2, pos_x=9.0)]), 2)
    later = listener.hear(TOPIC, ROBOT.door_map([_door(1), _door(2, pos_x=8.0)]), 3)

    assert [DoorRemoved] == [type(event) for event in gone]
    assert [3, 3] == [event.door_id for event in back]  # type: ignore[attr-defined]
    assert (KEY, "2") == (back[1].key, back[1].value)  # type: ignore[attr-defined]
    assert [3] == [event.door_id for event in later]  # type: ignore[attr-defined]


def test_a_new_id_is_none_that_the_same_message_wants() -> None:
    """Of two new doors the one whose number is free keeps it, whichever comes first."""
    listener = _listener()
    listener.hear(TOPIC, ROBOT.door_map([_door(1)]))
    listener.hear(TOPIC, ROBOT.door_map([]), 1)

    events = listener.hear(TOPIC, ROBOT.door_map([_door(1), _door(2)]), 2)

    added = [event.door_id for event in events if isinstance(event, DoorAdded)]
    assert [3, 2] == added


def test_a_server_may_count_from_zero() -> None:
    """0 is an id as others: the thesis's map has ints for keys."""
    listener = _listener()

    came = listener.hear(TOPIC, ROBOT.door_map([_door(0), _door(1)]))
    moved = listener.hear(TOPIC, ROBOT.door_map([_door(0, pos_x=9.0), _door(1)]), 1)
    listener = _listener(listener.known)
    gone = listener.hear(TOPIC, ROBOT.door_map([_door(1)]), 2)

    assert {0: "0", 1: "1"} == {e.door_id: e.value for e in came if isinstance(e, DoorAnnotated)}
    assert [(0, 9.0)] == [(event.door_id, event.x) for event in moved]  # type: ignore[attr-defined]
    assert [DoorRemoved(door_id=sl.DoorId(0), happened_ns=START + 2 * S)] == gone


def test_a_number_that_is_anothers_id_here_is_a_new_door() -> None:
    """Our door 3 is the server's 2: its own 3, when it comes, is not ours."""
    listener = _listener()
    for at_s, numbers in enumerate(([1, 2], [1], [1, 2])):
        listener.hear(TOPIC, ROBOT.door_map([_door(n) for n in numbers]), at_s)

    events = listener.hear(TOPIC, ROBOT.door_map([_door(n) for n in (1, 2, 3)]), 3)

    assert [4, 4] == [event.door_id for event in events]  # type: ignore[attr-defined]


def test_doors_of_other_levels_are_not_the_servers_to_remove() -> None:
    """Of `removes: all`: a server knows one level."""
    known = Known()
    for level in (0, 1):
        known.apply(LevelAdded(level=level, name=f"L{level}"))
        known.apply(
            DoorAdded(door_id=sl.DoorId(level + 1), level=level, x=1.0, y=1.0, theta=0.0,
                      width=1.0, happened_ns=START)
        )  # fmt: skip

    events = _listener(known, removes="all", level="0").hear(TOPIC, ROBOT.door_map([]), 1)

    assert [1] == [event.door_id for event in events]  # type: ignore[attr-defined]


def test_a_door_cannot_be_gone_before_it_came() -> None:
    """By a clock that went back: it stays, which is told, until a map of later lacks it."""
    listener = _listener()
    listener.hear(TOPIC, ROBOT.door_map([_door(1)]), 10)

    early = listener.hear(TOPIC, ROBOT.door_map([]), 5)
    late = listener.hear(TOPIC, ROBOT.door_map([]), 11)

    assert ([], [DoorRemoved]) == (early, [type(event) for event in late])
    assert "gone before it came" in listener.told[0]


def test_a_sensor_without_a_place_is_not_the_servers_door() -> None:
    """An unplaced door that bears the number by chance stays as it is."""
    known = Known()
    known.apply(DoorAdded(door_id=sl.DoorId(1), happened_ns=START))
    listener = _listener(known)

    events = listener.hear(TOPIC, ROBOT.door_map([_door(1)]))

    assert [2, 2] == [event.door_id for event in events]  # type: ignore[attr-defined]


@pytest.mark.parametrize("removes", ["own", "all"])
def test_a_dock_is_not_the_servers_door(removes: str) -> None:
    """One that bears the number by chance stays where and as it is, whenever its class was told."""
    known = Known()
    known.apply(DoorAdded(door_id=sl.DoorId(1), x=9.0, y=9.0, theta=0.0, width=0.0,
                          happened_ns=START))  # fmt: skip
    known.apply(DoorAnnotated(door_id=sl.DoorId(1), key="class", value="dock", happened_ns=START))
    assert known.doors[1].object_class.is_door
    known.apply(ClassDefined(class_name="dock", geometry="point", happened_ns=START))
    listener = _listener(known, removes=removes)

    events = listener.hear(TOPIC, ROBOT.door_map([_door(1)]))
    gone = listener.hear(TOPIC, ROBOT.door_map([]), 1)

    assert [2, 2] == [event.door_id for event in events]  # type: ignore[attr-defined]
    assert [2] == [event.door_id for event in gone]  # type: ignore[attr-defined]


@pytest.mark.parametrize(("removes", "removed"), [("own", [2]), ("all", [1, 2]), ("none", [])])
def test_the_mapping_says_which_doors_are_removed(removes: str, removed: list[int]) -> None:
    """Those that came with the topic, also before a restart; all that have a place; or none."""
    known = Known()
    for number in (1, 2, 3):
        place = {} if number == 3 else {"x": 1.0, "y": 1.0, "theta": 0.0, "width": 1.0}
        known.apply(DoorAdded(door_id=sl.DoorId(number), happened_ns=START, **place))
    known.apply(DoorAnnotated(door_id=sl.DoorId(2), key=KEY, value="2", happened_ns=START))

    events = _listener(known, removes=removes).hear(TOPIC, ROBOT.door_map([]), 1)

    assert removed == [event.door_id for event in events]  # type: ignore[attr-defined]
    assert all(isinstance(event, DoorRemoved) for event in events)


@pytest.mark.parametrize(
    ("doors", "says"),
    [
        ([_door(1), _door(1)], "has a door twice"),
        ([_door(1, pos_x=math.inf)], "impossible value"),
        ([_door(1, pos_y=math.nan)], "impossible value"),
        ([_door(1, width=-1.0)], "impossible value"),
        ([_door(1, prob_open=1.2)], "impossible value"),
    ],
)
def test_what_cannot_be_is_told_once_and_counted(doors: list[dict[str, Any]], says: str) -> None:
    """It never becomes an event; the other doors of the message do."""
    listener = _listener()
    message = ROBOT.door_map([*doors, _door(9)])

    listener.hear(TOPIC, message)
    listener.hear(TOPIC, message, 1)

    assert 1 == len(listener.told)
    assert says in listener.told[0]
    assert "(2 times)" in listener.complaints.lines()[0]
    has_others = "twice" not in says
    assert ([9] if has_others else []) == list(listener.known.doors)


def test_a_door_with_an_impossible_value_is_not_gone() -> None:
    """What the log knows of it stays, until a message says something that can be."""
    listener = _listener()
    listener.hear(TOPIC, ROBOT.door_map([_door(1)]))

    events = listener.hear(TOPIC, ROBOT.door_map([_door(1, width=-1.0)]), 1)

    assert [] == events
    assert 0.9 == listener.known.doors[1].width


def test_another_state_text_is_unknown_and_told() -> None:
    """As the thesis has it (4.2.2)."""
    listener = _listener()

    events = listener.hear(TOPIC, ROBOT.door_map([_door(1, door_state="ajar")]))

    assert DoorState.UNKNOWN == events[0].state  # type: ignore[attr-defined]
    assert "'ajar'" in listener.told[0]


def test_a_moving_door_is_unknown_to_the_server() -> None:
    """MOVING and OFFLINE, which the message cannot say, differ from its UNKNOWN in nothing."""
    known = Known()
    known.apply(
        DoorAdded(door_id=sl.DoorId(1), x=1.0, y=2.0, theta=0.5, width=0.9,
                  state=DoorState.MOVING, happened_ns=START)
    )  # fmt: skip

    events = _listener(known).hear(TOPIC, ROBOT.door_map([_door(1, door_state="UNKNOWN")]))

    assert [] == events


def test_an_unplaced_door_gets_its_place_later() -> None:
    """All NaN is no place; pose and width come together, and are not taken away again."""
    nowhere = {"pos_x": math.nan, "pos_y": math.nan, "pos_theta": math.nan, "width": math.nan}
    listener = _listener()

    listener.hear(TOPIC, ROBOT.door_map([_door(1, **nowhere)]))
    (placed,) = listener.hear(TOPIC, ROBOT.door_map([_door(1)]), 1)
    taken = listener.hear(TOPIC, ROBOT.door_map([_door(1, **nowhere)]), 2)

    assert isinstance(placed, DoorUpdated)
    assert Changed.POSE | Changed.WIDTH == placed.changed
    assert [] == taken
    assert "lost its place" in listener.told[0]


def test_what_a_server_only_repeats_does_not_undo_what_a_sensor_saw() -> None:
    """A door that it still calls CLOSED, as before, stays OPEN."""
    readings = {TOPIC: ReadDoorMap(), "/contact": ReadSensor("1")}
    listener = Listener(readings)
    closed = _door(1, door_state="CLOSED")
    listener.hear(TOPIC, ROBOT.door_map([closed]))
    listener.hear("/contact", ROBOT.said("Bool", True), 1)

    repeated = listener.hear(TOPIC, ROBOT.door_map([closed, _door(2)]), 2)
    opened = listener.hear(TOPIC, ROBOT.door_map([_door(1), _door(2)]), 3)
    anew = listener.hear(TOPIC, ROBOT.door_map([closed, _door(2)]), 4)

    assert {2} == {event.door_id for event in repeated}  # type: ignore[attr-defined]
    assert [] == opened  # as the contact said
    assert [(1, DoorState.CLOSED)] == [(e.door_id, e.state) for e in anew]  # type: ignore[attr-defined]


_VALUES = st.fixed_dictionaries(
    {},
    optional={
        "pos_x": st.sampled_from([1.0, 3.0, -2.5]),
        "width": st.sampled_from([0.8, 1.2]),
        "door_state": st.sampled_from(["OPEN", "CLOSED", "UNKNOWN"]),
        "prob_open": st.sampled_from([0.25, 0.75]),
    },
)
_MAPS = st.lists(st.dictionaries(st.integers(1, 5), _VALUES, max_size=4), min_size=1, max_size=8)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(maps=_MAPS, restart=st.integers(0, 7))
def test_the_log_has_the_servers_doors_after_every_message(
    maps: list[dict[int, dict[str, Any]]], restart: int
) -> None:
    """A replay at each message shows just its doors; said again after a restart, it is no event."""
    with (
        TemporaryDirectory() as folder,
        sl.create(Path(folder) / "log", tz="UTC", durability="none", compact=False) as log,
    ):
        listener = _listener(Known.of(log))
        for second, doors in enumerate(maps):
            message = ROBOT.door_map([_door(n, **values) for n, values in doors.items()])
            if second == restart:
                listener = _listener(Known.of(log))
            events = listener.hear(TOPIC, message, second)
            if events:
                log.append(events)
            assert [] == _listener(Known.of(log)).hear(TOPIC, message, second)

        for second, doors in enumerate(maps):
            there = log.replay(at=START + second * S).doors.values()
            assert _said(doors) == sorted(map(_seen, there), key=str)


def _said(doors: dict[int, dict[str, Any]]) -> list[Any]:
    entries = [(number, ENTRY | values) for number, values in doors.items()]
    return sorted(
        (
            (str(n), e["pos_x"], e["pos_y"], e["pos_theta"], e["width"], e["door_state"])
            for n, e in entries
        ),
        key=str,
    )


def _seen(door: Any) -> Any:
    number = door.annotations[KEY]
    return (number, door.x, door.y, door.theta, door.width, door.state.name)
