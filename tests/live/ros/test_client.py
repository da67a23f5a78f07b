"""The client of the four actions, and `call`, with our server on a node without a network."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.errors import CommandError, RosError, UnknownDoorError
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import RosVersion
from semmap_log.live.ros import client as client_module
from semmap_log.live.ros import joining
from semmap_log.live.ros.client import DoorClient, DoorFields
from semmap_log.live.ros.ros_node import DEFAULTS, Goal, Outcome
from semmap_log.live.ros.serving.door_server import DoorServer
from semmap_log.live.ros.serving.saving import DoorSaver
from semmap_log.live.ros.serving.served_topics import (
    LevelNames,
    ServedDoors,
    ServedTopics,
    levels_of,
)
from tests.live.ros.collecting_node import CollectingNode
from tests.verbs import Ran, Verb

DOOR = DoorFields(x=1.0, y=2.0, theta=0.5, width=0.9, state=DoorState.CLOSED)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[DoorServer]:
    sl.create(tmp_path / "log", tz="UTC", durability="none").close()
    made = DoorServer(
        lambda: sl.append(tmp_path / "log", durability="none"), DoorSaver(None, tmp_path / "log")
    )
    yield made
    made.close()


def _node(server: DoorServer, version: RosVersion = 2) -> CollectingNode:
    """Return a node that offers a server's map, as it is now, and its actions."""
    node = CollectingNode(version)
    for name in DEFAULTS.values():
        node.serve_action("", name, server.run)
    doors = server.door_map()
    ServedDoors(ServedTopics(node), LevelNames(levels_of(doors))).show(doors, 1)
    return node


def test_a_place_that_is_given_in_part_is_completed(server: DoorServer) -> None:
    """From the map that the server publishes; what was given counts, nothing else is changed."""
    DoorClient(_node(server)).add(DOOR)

    parts = [DoorFields(x=-4.0), DoorFields(y=-5.0), DoorFields(theta=0.25)]
    answers = [DoorClient(_node(server)).update(1, part) for part in parts]

    door = server.door_map().doors[DoorId(1)]
    assert [("SUCCEEDED", {"door_updated": True})] * 3 == [(a.status, a.result) for a in answers]
    assert (-4.0, -5.0, 0.25, 0.9) == (door.x, door.y, door.theta, door.width)
    assert DoorState.CLOSED == door.state


def test_what_is_not_given_is_not_set(server: DoorServer) -> None:
    """The goal's flags name what is given alone."""
    node = _node(server)
    client = DoorClient(node)
    client.add(DOOR)
    client.update(1, DoorFields(prob_open=0.25))

    added, updated = (goal.values for goal in node.goals)
    flags = {name: value for name, value in updated.items() if name.startswith("change")}
    assert math.isnan(added["prob_open"])
    assert math.isnan(added["prob_closed"])
    assert ["change_prob_open"] == [name for name, value in flags.items() if value]
    assert 5 == len(flags)
    assert [] == [value for value in updated.values() if value != value]  # noqa: PLR0124  no NaN


NO_DOOR = Outcome(succeeded=True, result={"door_id": 4})


@pytest.mark.parametrize(
    ("given", "asked"),
    [
        ({}, "--prob-open and --prob-closed"),
        ({"prob_open": 0.25}, "expected --prob-closed, got none"),
        ({"prob_closed": 0.25}, "expected --prob-open, got none"),
    ],
)
def test_a_server_of_others_is_never_sent_a_nan(
    given: dict[str, float], asked: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would keep it for a probability: what the goal cannot say is asked for."""
    monkeypatch.setattr(client_module, "KNOWN_WITHIN_S", 0.05)
    node = CollectingNode()
    node.serve_action("", DEFAULTS["AddDoor"], lambda _: NO_DOOR)

    with pytest.raises(CommandError, match=f"is not semmap-log's.*{asked}.*Nothing was sent"):
        DoorClient(node).add(replace(DOOR, **given))
    assert [] == node.goals
    answer = DoorClient(node).add(replace(DOOR, prob_open=0.25, prob_closed=0.75))
    assert (0.25, 0.75) == (node.goals[0].values["prob_open"], node.goals[0].values["prob_closed"])
    assert {"door_id": 4} == answer.result

    for name in ("semmap/doors", "/robot1/semmap/doors/level_2"):
        node.topics = {name: BagTopic(name, "", is_latched=True)}
        DoorClient(node).add(DOOR)
        assert math.isnan(node.goals[-1].values["prob_open"])


def test_without_a_server_it_is_not_known_whose_it_is() -> None:
    """An error in time, and nothing is sent to one that comes later."""
    node = CollectingNode()

    with pytest.raises(RosError, match=r"no action server lta_semantic_map/add_door was found"):
        DoorClient(node, timeout_s=0.05).add(DOOR)


def test_the_same_call_twice_is_two_goals(server: DoorServer) -> None:
    """Each has an id of its own: a person who adds two doors alike has two."""
    client = DoorClient(_node(server))

    ids = [client.add(DOOR).result["door_id"] for _ in range(2)]

    assert [1, 2] == ids


def test_a_door_that_is_not_in_the_map_cannot_be_moved_in_part(server: DoorServer) -> None:
    """Said by the client: it has nothing to complete the place from."""
    client = DoorClient(_node(server))
    client.add(DOOR)

    with pytest.raises(UnknownDoorError, match="door 7: expected a door of"):
        DoorClient(_node(server)).update(7, DoorFields(x=1.0))


def test_without_a_map_a_place_in_part_is_an_error() -> None:
    """In time, with what would do without."""
    node = CollectingNode()

    with pytest.raises(RosError, match=r"no door map came on .* within 0\.05 s"):
        DoorClient(node, timeout_s=0.05).update(1, DoorFields(x=1.0))

    assert [] == node.goals


@pytest.mark.parametrize("version", [1, 2])
def test_why_a_goal_was_aborted_is_told(server: DoorServer, version: RosVersion) -> None:
    """In ROS 1 by the result; in ROS 2 by the line of /rosout that names this goal, not another."""
    answer = DoorClient(_node(server, version)).remove(5)

    assert ("ABORTED", {"door_removed": False}) == (answer.status, answer.result)
    assert "door_id: door 5 is not in the map." == answer.text


def test_who_does_not_say_why_is_not_waited_for_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    """A server of others may log nothing."""
    monkeypatch.setattr(client_module, "REASON_WITHIN_S", 0.05)
    node = CollectingNode()
    nothing = Outcome(succeeded=False, result={"door_removed": False})
    node.serve_action("", DEFAULTS["RemoveDoor"], lambda _: nothing)

    answer = DoorClient(node).remove(5)

    assert ("ABORTED", "") == (answer.status, answer.text)


def test_another_servers_name_can_be_said(server: DoorServer) -> None:
    """In place of ours."""
    node = CollectingNode()
    node.serve_action("", "/doors/add", server.run)

    door = replace(DOOR, prob_open=0.25, prob_closed=0.75)
    answer = DoorClient(node, server="/doors/add").add(door)

    assert {"door_id": 1} == answer.result


@pytest.fixture
def call(server: DoorServer, monkeypatch: pytest.MonkeyPatch, run_verb: Verb) -> Verb:
    """`call` as a person types it."""
    nodes: list[CollectingNode] = []

    def open_node(version: RosVersion, *_: object) -> CollectingNode:
        nodes.append(_node(server, version))
        return nodes[-1]

    monkeypatch.setattr(joining, "open_node", open_node)

    def call(*words: object) -> Ran:
        done = run_verb("call", *words)
        assert nodes[-1].is_closed
        return done

    return call


def test_what_was_done_is_printed(call: Verb) -> None:
    """Exit code 0; the id of a new door alone, for a script."""
    added = call("add", "--ros2", "--from", "1,2", "--to", "1,3", "--state", "closed")
    updated = call("update", 1, "--ros2", "--x", "4")
    removed = call("remove", 1, "--ros1")

    assert (0, "1\n", "") == added
    assert (0, "door 1 updated\n", "") == updated
    assert (0, "door 1 removed\n", "") == removed


@pytest.mark.parametrize("ros", ["--ros1", "--ros2"])
def test_what_was_refused_is_exit_code_1(call: Verb, ros: str) -> None:
    """With why, on standard error; as JSON, too."""
    plain = call("remove", 5, ros)
    code, out, err = call("save", "/etc/doors.yaml", ros, "--json")

    why = "door_id: door 5 is not in the map."
    assert (1, "", f"semmap-log: removal of door 5: ABORTED: {why}\n") == plain
    said = json.loads(out)
    assert (1, "ABORTED", {"stored_successful": False}) == (code, said["status"], said["result"])
    assert "lies outside; files are saved in " in said["text"]
    assert "saving /etc/doors.yaml: ABORTED" in err


def test_the_first_door_of_a_server_that_counts_from_0_is_done(
    monkeypatch: pytest.MonkeyPatch, run_verb: Verb
) -> None:
    """The id 0 is no refusal."""
    node = CollectingNode(1)
    node.serve_action("", DEFAULTS["AddDoor"], lambda _: Outcome(True, {"door_id": 0}))
    monkeypatch.setattr(joining, "open_node", lambda *_: node)

    words = ["--from", "1,2", "--to", "1,3", "--prob-open", "0.5", "--prob-closed", "0.5"]

    assert (0, "0\n") == run_verb("call", "add", "--ros1", *words)[:2]


@pytest.mark.parametrize(
    ("is_done", "text", "printed"),
    [
        (False, "no such door", (1, "", "removal of door 5: SUCCEEDED: no such door\n")),
        (False, "", (1, "", "removal of door 5: SUCCEEDED: the server did not say why\n")),
        (True, "it was open", (0, "door 5 removed\n", "warning: it was open\n")),
    ],
)
def test_servers_of_others_may_succeed_otherwise(
    is_done: bool,
    text: str,
    printed: tuple[int, str, str],
    monkeypatch: pytest.MonkeyPatch,
    run_verb: Verb,
) -> None:
    """With a result that says no, which is a failure; with a warning, which is none."""

    def run(_goal: Goal) -> Outcome:
        return Outcome(succeeded=True, result={"door_removed": is_done}, text=text)

    node = CollectingNode(1)
    node.serve_action("", DEFAULTS["RemoveDoor"], run)
    monkeypatch.setattr(joining, "open_node", lambda *_: node)

    code, out, err = run_verb("call", "remove", 5, "--ros1")

    assert printed == (code, out, err.removeprefix("semmap-log: "))
