"""Calls the thesis's four actions, of whatever server offers them (thesis 4.5)."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any
from uuid import uuid4

from semmap_log.core.model.doors import DoorState
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError, RosError, UnknownDoorError
from semmap_log.interop.formats.ros.ros_types import decoded, log_type
from semmap_log.live.ros.ros_node import GoalAnswer, Received, RosNode, Values, action_name
from semmap_log.live.ros.serving.served_topics import DOOR_DB, MARKERS_NAME

REASON_WITHIN_S = 3.0
"""How long to listen for why a goal was aborted, where results do not say it (ROS 2)."""

KNOWN_WITHIN_S = 2.0
"""How long the topics of a server may take to become known, where it is (ROS 2)."""

PROBABILITIES = ("prob_open", "prob_closed")

_OURS = re.compile(rf"(^|/){MARKERS_NAME}(/|$)")
"""What our server publishes, and no other."""


@dataclass(frozen=True, slots=True)
class DoorFields:
    """The message about a door; None: there is none."""

    x: float | None = None
    y: float | None = None
    theta: float | None = None
    width: float | None = None
    state: DoorState | None = None
    prob_open: float | None = None
    prob_closed: float | None = None

    @property
    def place(self) -> tuple[float | None, float | None, float | None]:
        """Start of its line, metres, and its direction, radians."""
        return self.x, self.y, self.theta


@dataclass(frozen=True, slots=True)
class DoorClient:
    """A client of the four actions."""

    node: RosNode
    timeout_s: float = 10.0
    """For a server to be found, and again for its answer."""
    server: str | None = None
    """Its name; None: see `action_names`."""

    def add(self, door: DoorFields) -> GoalAnswer:
        """Add a door, of which place and width are given; the result has `door_id`.

        A probability that is not given goes to our own server as NaN. The thesis's goal cannot say
        it, and a server of others would keep the NaN: to such a one nothing is sent.

        Raises:
            RosError: No server, or no answer, in time.
            CommandError: A probability is not given, and the server is not ours.
        """
        lacking = [name for name in PROBABILITIES if getattr(door, name) is None]
        if lacking and not self._is_ours("AddDoor"):
            options = " and ".join(f"--{name.replace('_', '-')}" for name in lacking)
            raise CommandError(
                f"the server {self._name_of('AddDoor')} is not semmap-log's, and its goal cannot "
                f"say that a probability is not given: expected {options}, got none. Nothing was "
                "sent."
            )
        return self._call("AddDoor", _values(door) | dict.fromkeys(lacking, math.nan))

    def update(self, door_id: int, door: DoorFields) -> GoalAnswer:
        """Set what is given of a door; the result has `door_updated`.

        The thesis's goal sets a place whole: what is not given of one comes from the door map that
        the server publishes.

        Raises:
            RosError: No server, no answer, or no door map to complete the place from, in time.
            UnknownDoorError: The door map does not have that door.
        """
        given = [value for value in door.place if value is not None]
        if given and len(given) < len(door.place):
            door = _completed(door, self._entry(door_id))
        values = {
            "door_id": door_id,
            "change_pos": bool(given),
            "change_width": door.width is not None,
            "change_open": door.state is not None,
            "change_prob_open": door.prob_open is not None,
            "change_prob_closed": door.prob_closed is not None,
        }
        return self._call("UpdateDoor", values | _values(door))

    def remove(self, door_id: int) -> GoalAnswer:
        """Remove a door; the result has `door_removed`.

        Raises:
            RosError: No server, or no answer, in time.
        """
        return self._call("RemoveDoor", {"door_id": door_id})

    def save(self, file_name: str) -> GoalAnswer:
        """Have the server write its database; the result has `stored_successful`.

        Raises:
            RosError: No server, or no answer, in time.
        """
        return self._call("SaveDoorDB", {"file_name": file_name})

    def doors(self) -> Mapping[int, Any]:
        """Return the entries of the door map that is published, by their ids.

        Raises:
            RosError: None came in time.
        """
        got: list[Received] = []
        self.node.subscribe(DOOR_DB.name, DOOR_DB.ros_type, got.append)
        _run_until(self.node, lambda: bool(got), self.timeout_s)
        if not got:
            raise RosError(
                f"no door map came on {DOOR_DB.name} within {self.timeout_s:g} s, to complete the "
                "place from; is the server running? With x, y and theta none is needed."
            )
        message = decoded(self.node.ros_version, got[-1].data, DOOR_DB.ros_type)
        return {int(entry.door_id): entry for entry in message.door_db}

    def _entry(self, door_id: int) -> Any:
        doors = self.doors()
        if door_id not in doors:
            raise UnknownDoorError(
                f"door {door_id}: expected a door of {DOOR_DB.name}, to complete its place from; "
                f"{counted(len(doors), 'door')} there."
            )
        return doors[door_id]

    def _name_of(self, action: str) -> str:
        return self.server or action_name(self.node, action)

    def _is_ours(self, action: str) -> bool:
        """Return whether the node that serves an action also publishes the topics of `serve`.

        Raises:
            RosError: Nobody serves it in time.
        """
        name = self._name_of(action)

        def topics() -> set[str]:
            return self.node.topics_of_server(name)

        def is_ours() -> bool:
            return any(_OURS.search(topic) for topic in topics())

        _run_until(self.node, lambda: bool(topics()), self.timeout_s)
        if not topics():
            raise RosError(
                f"no action server {name} was found within {self.timeout_s:g} s; is it running?"
            )
        _run_until(self.node, is_ours, KNOWN_WITHIN_S)
        return is_ours()

    def _call(self, action: str, values: Values) -> GoalAnswer:
        name = self._name_of(action)
        goal_id = uuid4().bytes
        reasons = _Reasons(self.node, goal_id) if self.node.ros_version == 2 else None
        answer = self.node.call_action(
            action, name, values, goal_id=goal_id, timeout_s=self.timeout_s
        )
        if reasons is not None and answer.status != "SUCCEEDED":
            answer = replace(answer, text=reasons.wait())
        return answer


class _Reasons:
    """The text about a goal on /rosout: results of ROS 2 have none."""

    def __init__(self, node: RosNode, goal_id: bytes) -> None:
        self._node = node
        self._goal_id = goal_id.hex()
        self._said = ""
        node.subscribe("/rosout", log_type(2), self._take)

    def wait(self) -> str:
        """Return why a goal was aborted, as far as its server says so and names the goal."""
        _run_until(self._node, lambda: bool(self._said), REASON_WITHIN_S)
        return self._said

    def _take(self, received: Received) -> None:
        if self._goal_id.encode() in received.data:
            line = decoded(2, received.data, received.ros_type).msg
            self._said = line.partition(f"{self._goal_id}: ")[2] or line


def _run_until(node: RosNode, is_there: Callable[[], bool], timeout_s: float) -> None:
    deadline = time.monotonic() + timeout_s
    node.run(lambda: is_there() or time.monotonic() > deadline)


def _completed(door: DoorFields, entry: Any) -> DoorFields:
    """Return the fields with a whole place."""
    return replace(
        door,
        x=entry.pos_x if door.x is None else door.x,
        y=entry.pos_y if door.y is None else door.y,
        theta=entry.pos_theta if door.theta is None else door.theta,
    )


def _values(door: DoorFields) -> dict[str, Any]:
    """Return the fields as goals name them; what is not given is ROS's default."""
    return {
        "pos_x": _number(door.x),
        "pos_y": _number(door.y),
        "pos_theta": _number(door.theta),
        "width": _number(door.width),
        "door_state": (door.state or DoorState.UNKNOWN).name,
        "prob_open": _number(door.prob_open),
        "prob_closed": _number(door.prob_closed),
    }


def _number(value: float | None) -> float:
    return 0.0 if value is None else float(value)
