"""What actionlib lacks: patience with clocks, answers to goals sent again, given ids."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


def patient_server_class() -> Any:
    """Return actionlib's server, less two of its habits.

    It takes a cancel to be for all older goals to come, too: so a client whose clock is behind is
    never served once anybody has cancelled anything. And a goal that is sent again within five
    seconds of its answer is never answered.
    """
    import actionlib
    import rospy
    from actionlib_msgs.msg import GoalStatus

    ended = (GoalStatus.SUCCEEDED, GoalStatus.ABORTED)

    class PatientActionServer(actionlib.ActionServer):  # type: ignore[misc]
        def internal_cancel_callback(self, goal_id: Any) -> None:
            with self.lock:
                super().internal_cancel_callback(goal_id)
                self.last_cancel = rospy.Time()

        def internal_goal_callback(self, goal: Any) -> None:
            """Forget a goal of that id which has ended: the log knows what was asked and done."""
            with self.lock:
                self.status_list[:] = [
                    each
                    for each in self.status_list
                    if each.status.goal_id.id != goal.goal_id.id or each.status.status not in ended
                ]
                super().internal_goal_callback(goal)

    return PatientActionServer


def caller_of(handle: Any) -> str:
    """Return the node that sent a goal: its connection says it."""
    header = getattr(handle.status_tracker.goal, "_connection_header", None) or {}
    return str(header.get("callerid", ""))


@contextmanager
def given_id(client: Any, goal_id: bytes | None) -> Iterator[None]:
    """Let a client's goal have that id; actionlib itself draws one for each."""
    if goal_id is None:
        yield
        return
    import rospy
    from actionlib_msgs.msg import GoalID

    given = GoalID(id=goal_id.hex(), stamp=rospy.get_rostime())
    client.manager._generate_id = lambda: given  # noqa: SLF001
    try:
        yield
    finally:
        del client.manager._generate_id  # noqa: SLF001  its class has one
