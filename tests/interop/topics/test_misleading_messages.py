"""What readers of messages must not be fooled by, case by case."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import Changed, DoorAdded, DoorObserved, DoorUpdated, Event
from semmap_log.interop.formats.ros.ros_types import DOOR_MAP
from semmap_log.interop.topics.topic_reader import Known, happened_ns
from semmap_log.interop.topics.topic_rules import (
    ReadPose,
    ReadRmfState,
    ReadSensor,
    ReadTransforms,
    RosMapping,
)
from semmap_log.interop.topics.transforms import TransformTree
from tests.interop.topics.robots import START, Listener, Robot, S

ROBOT = Robot()


def test_a_sighting_of_before_is_no_repeat() -> None:
    """Where the clock went back nothing is left out until it has caught up."""
    listener = Listener({"/s": ReadRmfState()})
    listener.hear("/s", ROBOT.door_state("front", 2), 10)

    events = listener.hear("/s", ROBOT.door_state("front", 2), 5)

    assert [DoorObserved] == [type(event) for event in events]


@pytest.mark.parametrize("name", ["", "a\0b"])
def test_a_door_without_a_name_is_told(name: str) -> None:
    """And is none: not a new door each time."""
    listener = Listener({"/s": ReadRmfState()})

    events = listener.hear("/s", ROBOT.door_state(name, 2))

    assert [] == events
    assert "a door without a name; passed over" in listener.told[0]


def test_a_flag_is_not_measured() -> None:
    """True is 1 to Python, and above a half; but the mapping says what it means."""
    rule = ReadSensor("front", states={True: DoorState.CLOSED}, open_above=0.5)
    listener = Listener({"/contact": rule})

    *_, seen = listener.hear("/contact", ROBOT.said("Bool", True))

    assert isinstance(seen, DoorObserved)
    assert DoorState.CLOSED == seen.state


DOOR = sl.DoorId(1)
EARLIER = START + 5 * S


@pytest.mark.parametrize(
    "earlier",
    [
        DoorObserved(door_id=DOOR, state=DoorState.CLOSED, happened_ns=EARLIER),
        DoorUpdated(
            door_id=DOOR, changed=Changed.STATE, state=DoorState.CLOSED, happened_ns=EARLIER
        ),
    ],
)
def test_what_was_said_earlier_does_not_undo_what_was_seen_later(earlier: Event) -> None:
    """In what messages are compared with, as in the log's own map."""
    known = Known()
    known.apply(DoorAdded(door_id=DOOR, happened_ns=START))

    known.apply(DoorObserved(door_id=DOOR, state=DoorState.OPEN, happened_ns=START + 10 * S))
    known.apply(earlier)

    assert DoorState.OPEN == known.doors[DOOR].state


def test_what_was_said_without_a_time_undoes_what_was_seen_before() -> None:
    """It happens when it is recorded: last of all."""
    known = Known()
    known.apply(DoorAdded(door_id=DOOR, happened_ns=START))
    known.apply(DoorObserved(door_id=DOOR, state=DoorState.OPEN, happened_ns=EARLIER))

    known.apply(DoorObserved(door_id=DOOR, state=DoorState.CLOSED))

    assert DoorState.CLOSED == known.doors[DOOR].state


def test_a_stamp_of_zero_is_none_in_a_simulation_too() -> None:
    """Whose first minute is the first of 1970."""
    never = SimpleNamespace(sec=0, nanosec=0)

    assert 30 * S == happened_ns(never, 30 * S, within_s=60.0)


def test_a_message_at_time_0_counts_at_time_0() -> None:
    """Before any clock, as in a simulation's first moment: never now. A word says so."""
    listener = Listener({"/s": ReadRmfState()})

    events = [
        *listener.hear("/s", ROBOT.door_state("front", 0), -START / S),
        *listener.hear("/s", ROBOT.door_state("front", 2)),
    ]

    assert [0, 0, 0, START] == [event.happened_ns for event in events]
    (told,) = listener.told
    assert "came at time 0, before" in told


@pytest.mark.parametrize("at_s", [-1, 2**34])
def test_a_message_at_a_time_that_no_log_can_hold_is_passed_over(at_s: int) -> None:
    """And told: it is not of now."""
    listener = Listener({"/s": ReadRmfState()})

    assert [] == listener.hear("/s", ROBOT.door_state("front", 2), at_s - START / S)
    assert "passed over: it came at" in listener.told[0]


def test_transforms_of_other_frames_say_which_there_are() -> None:
    """Only where none ever leads from the map to the robot: the first ones rarely do."""
    listener = Listener({"/tf": ReadTransforms()})
    listener.hear("/tf", ROBOT.transforms(("world", "cart", 1.0, 2.0, 0.0)))
    (why,) = listener.translator.why_no_poses()
    listener.hear("/tf", ROBOT.transforms(("map", "base_link", 1.0, 2.0, 0.0)))

    assert "map to base_link" in why
    assert () == listener.translator.why_no_poses()


def test_a_robot_that_looks_west_has_not_turned_around() -> None:
    """From a little less than half a turn to a little more it is a little."""
    listener = Listener({"/pose": ReadPose()})
    listener.hear("/pose", ROBOT.pose(0.0, 0.0, math.pi - 0.01))

    events = listener.hear("/pose", ROBOT.pose(0.0, 0.0, -math.pi + 0.01), 1)

    assert [] == events


def test_turns_in_space_are_composed_in_their_order() -> None:
    """A quarter around z, and in that frame one around x: the robot still looks along y."""
    half = math.sqrt(0.5)
    tree = TransformTree()
    tree.take(_link("map", "odom", z=half), 1, is_static=False)
    tree.take(_link("odom", "base_link", x=half), 1, is_static=False)
    chain = tree.chain("map", "base_link")
    assert chain is not None

    *_, theta = tree.pose(chain)

    assert pytest.approx(math.pi / 2) == theta


def test_a_shift_that_is_none_leaves_the_tree_as_it_was() -> None:
    """The link that came before it counts on."""
    tree = TransformTree()
    tree.take(_link("map", "base_link", z=math.sqrt(0.5)), 1, is_static=False)
    broken = _link("map", "base_link")
    broken.transform.translation.x = math.nan

    with pytest.raises(ValueError, match="a translation that is not finite"):
        tree.take(broken, 2, is_static=False)

    assert (0.0, 0.0) == tree.pose(("base_link",))[:2]


def test_topics_that_no_mapping_names_are_left_alone() -> None:
    """Unless it says that the well-known ones are read, too."""
    assert RosMapping().rule("/doors", DOOR_MAP) is None
    assert RosMapping(well_known=True).rule("/doors", DOOR_MAP) is not None


def _link(parent: str, child: str, *, x: float = 0.0, z: float = 0.0) -> Any:
    zero = SimpleNamespace(x=0.0, y=0.0, z=0.0)
    turn = SimpleNamespace(x=x, y=0.0, z=z, w=math.sqrt(1 - x * x - z * z))
    return SimpleNamespace(
        child_frame_id=child,
        header=SimpleNamespace(frame_id=parent, stamp=None),
        transform=SimpleNamespace(translation=zero, rotation=turn),
    )
