"""What every node makes of a goal: its outcome, and what the server's terminal says of it."""

from __future__ import annotations

from semmap_log.live.ros.ros_node import Goal, Outcome, outcome_of
from tests.live.ros.serving.goals import DOOR, goal_of


def _ran(outcome: Outcome | Exception) -> tuple[Outcome, list[str]]:
    def run(_: Goal) -> Outcome:
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    said: list[str] = []
    return outcome_of(run, goal_of("AddDoor", "goal-7", **DOOR), said.append), said


def test_why_a_goal_was_refused_is_logged() -> None:
    """In ROS 1, too, where the client alone was told."""
    refused = Outcome(succeeded=False, result={"door_id": 0}, text="width: expected …")

    assert (refused, ["AddDoor: refused goal goal-7: width: expected …"]) == _ran(refused)


def test_what_is_odd_about_a_goal_is_logged() -> None:
    """It was done all the same; what is not odd is not told."""
    odd = Outcome(succeeded=True, result={"door_id": 1}, text="door_state: …")

    assert (odd, ["AddDoor: warning about goal goal-7: door_state: …"]) == _ran(odd)
    assert [] == _ran(Outcome(succeeded=True, result={"door_id": 1}))[1]


def test_an_error_of_our_own_is_told_with_its_trace() -> None:
    """The client has an answer, the terminal has where it was."""
    outcome, (trace, refused) = _ran(RuntimeError("no such wide door"))

    assert Outcome(False, {}, "RuntimeError: no such wide door") == outcome
    assert "Traceback (most recent call last)" in trace
    assert "AddDoor: refused goal goal-7: RuntimeError: no such wide door" == refused
