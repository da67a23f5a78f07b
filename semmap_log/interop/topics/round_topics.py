"""The robot's rounds, from the status of the action that drives them, or from any marker."""

from __future__ import annotations

from collections.abc import Iterator

from semmap_log.core.model.events import Event, PatrolFinished, PatrolStarted
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.topics.topic_reader import Context, TopicMessage, field_of
from semmap_log.interop.topics.topic_rules import ReadPatrol

_RUNNING = {1: frozenset({1, 6}), 2: frozenset({2, 3})}
"""By the ROS: ACTIVE, PREEMPTING of actionlib_msgs/GoalStatus; EXECUTING, CANCELING of
action_msgs/GoalStatus."""


class Rounds:
    """Reads what marks rounds: a round begins where another began before, and that one is over.

    Of an action's status: a round is a goal that runs, and over once it does not any more, however
    it ended. Nav2's FollowWaypoints and move_base are such actions.
    """

    def __init__(self, rule: ReadPatrol, context: Context) -> None:
        self._rule = rule
        self._context = context
        self._goal: bytes | None = None
        """Whose round is under way; None: nobody's that an action's status told of."""

    def events(self, got: TopicMessage) -> Iterator[Event]:
        """Return the beginning or the end of a round."""
        happened_ns = self._context.happened_ns(got)
        status_list = getattr(got.message, "status_list", None)
        if status_list is not None:
            yield from self._of_status(status_list, happened_ns)
            return
        value = field_of(got.message, self._rule.path)
        if _is_among(value, self._rule.starts):
            yield from self._begin(happened_ns)
        elif _is_among(value, self._rule.finishes):
            yield from self._end(happened_ns)
        else:
            self._context.complaints.add(
                got.topic, "a value that marks no round; passed over", shown(value)
            )

    def actor(self, _got: TopicMessage) -> str:
        """Return nobody."""
        return ""

    def _of_status(self, status_list: object, happened_ns: int | None) -> Iterator[Event]:
        running = set()
        for each in status_list:  # type: ignore[attr-defined]
            is_ros2 = hasattr(each, "goal_info")
            goal = bytes(each.goal_info.goal_id.uuid) if is_ros2 else each.goal_id.id.encode()
            if each.status in _RUNNING[2 if is_ros2 else 1]:
                running.add(goal)
        if self._goal is not None and self._goal not in running:
            self._goal = None
            yield from self._end(happened_ns)
        if self._goal is None and running:
            self._goal = min(running)
            yield from self._begin(happened_ns)

    def _begin(self, happened_ns: int | None) -> Iterator[Event]:
        yield from self._end(happened_ns)
        yield PatrolStarted(patrol=self._context.known.last_started + 1, happened_ns=happened_ns)

    def _end(self, happened_ns: int | None) -> Iterator[Event]:
        known = self._context.known
        if known.last_started > known.last_finished:
            yield PatrolFinished(patrol=known.last_started, happened_ns=happened_ns)


def _is_among(value: object, marks: tuple[object, ...]) -> bool:
    """Tell whether a value is one of the marks: true is not 1."""
    kind = isinstance(value, bool)
    return any(value == mark and kind == isinstance(mark, bool) for mark in marks)
