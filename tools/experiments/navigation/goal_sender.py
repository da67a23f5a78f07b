"""The thesis's GoalSender: goals one after the other, until so many were reached (E.1)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import islice

from navigation.goal_orders import GoalOrder
from navigation.goals import Goal
from navigation.move_base import MoveBase
from navigation.records import Outcome, RunRecorder
from navigation.robot import Robot


def outcome_of(took_s: float, rejected_within_s: float, *, reached: bool) -> Outcome:
    """Return how a goal counts.

    The thesis tells by the time alone whether the robot had to drive to find that a goal cannot be
    reached: "any unreached goal that took longer to be reject is counted for this figure".
    """
    if reached:
        return Outcome.REACHED
    return Outcome.AFTER_DRIVING if took_s > rejected_within_s else Outcome.REJECTED


class GoalSender:
    """Sends goals, waits for each, and keeps the records."""

    def __init__(
        self, robot: Robot, move_base: MoveBase, order: GoalOrder, recorder: RunRecorder, *,
        rejected_within_s: float, most_tries: int,
    ) -> None:  # fmt: skip
        """Send a robot about.

        Args:
            robot: Whose clock counts.
            move_base: Which gets the robot there.
            order: Which goal is next.
            recorder: Where it is written.
            rejected_within_s: See `outcome_of`.
            most_tries: It ends then.
        """
        self._robot, self._move_base = robot, move_base
        self._order, self._recorder = order, recorder
        self._rejected_within_s, self._most_tries = rejected_within_s, most_tries

    def send(
        self, goals: Iterable[Goal], wanted: int, progress: Callable[[int], None] = lambda _: None
    ) -> int:
        """Send goals until so many were reached; return how many were.

        Args:
            goals: Where to; there are always more.
            wanted: So many are to be reached.
            progress: Told how many were, after each goal.
        """
        coming = iter(goals)
        known = list(islice(coming, self._order.window))
        reached = 0
        for _ in range(self._most_tries):
            goal = self._order.choose(known)
            known.remove(goal)
            known.append(next(coming))
            reached += self._try(goal) is Outcome.REACHED
            progress(reached)
            if reached >= wanted:
                break
        return reached

    def _try(self, goal: Goal) -> Outcome:
        sent_s = self._robot.now_s
        self._recorder.goal_sent(sent_s, goal.number, *goal.place, kind=goal.kind)
        drive = self._move_base.go(goal.place)
        took_s = self._robot.now_s - sent_s
        outcome = outcome_of(took_s, self._rejected_within_s, reached=drive.reached)
        self._recorder.goal_ended(self._robot.now_s, goal.number, outcome, drive.figures())
        return outcome
