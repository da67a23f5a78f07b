"""The GoalSender: the rule of 20 seconds, where goals lie, how many are sent."""

from __future__ import annotations

import random
from itertools import islice
from pathlib import Path

import pytest

from navigation.goal_orders import AsGiven
from navigation.goal_sender import GoalSender, outcome_of
from navigation.goals import Goals
from navigation.move_base import Drive, MoveBase
from navigation.records import Outcome, RunKey
from navigation.runs import read_run
from navigation.streams import Streams
from navigation.tests.world_of_three_rooms import ALL_OPEN, Scene, floor


@pytest.mark.parametrize(
    ("took_s", "outcome"),
    [(0.0, "rejected"), (17.56, "rejected"), (20.0, "rejected"), (20.5, "after_driving")],
)
def test_longer_than_about_twenty_seconds_is_after_driving(took_s: float, outcome: str) -> None:
    assert outcome_of(took_s, 20.0, reached=False).value == outcome
    assert outcome_of(took_s, 20.0, reached=True) is Outcome.REACHED


class Scripted(MoveBase):
    """Needs so long for each goal, and reaches it or not."""

    def __init__(self, scene: Scene, *ends: tuple[float, bool]) -> None:
        self._robot, self._ends = scene.robot, list(ends)

    def go(self, goal: object) -> Drive:
        seconds, reached = self._ends.pop(0)
        self._robot.wait(seconds)
        return Drive(reached=reached)


def test_a_run_counts_its_goals_by_the_clock(tmp_path: Path) -> None:
    """
    Goals are sent until two were reached; how each ended is told by how long it took.
    """
    scene = Scene(tmp_path, "no_map_star", ALL_OPEN)
    ends = [(17.56, False), (20.01, False), (0.5, True), (20.0, False), (33.0, True)]
    with scene.recorder as recorder:
        sender = GoalSender(
            scene.robot, Scripted(scene, *ends), AsGiven(), recorder, rejected_within_s=20.0,
            most_tries=100,
        )  # fmt: skip
        assert sender.send(Goals(floor(), random.Random(1)), 2) == 2

    run = read_run(RunKey("corridor", "no_map_star", "fixed", 1).folder(tmp_path))
    assert [goal.outcome.value for goal in run.goals] == [
        "rejected", "after_driving", "reached", "rejected", "reached",
    ]  # fmt: skip
    assert [goal.number for goal in run.goals] == [1, 2, 3, 4, 5]


def test_a_run_ends_after_the_most_tries(tmp_path: Path) -> None:
    scene = Scene(tmp_path, "no_map_star", ALL_OPEN)
    with scene.recorder as recorder:
        sender = GoalSender(
            scene.robot, Scripted(scene, *[(1.0, False)] * 3), AsGiven(), recorder,
            rejected_within_s=20.0, most_tries=3,
        )  # fmt: skip
        assert sender.send(Goals(floor(), random.Random(1)), 2) == 0


def test_goals_lie_anywhere_on_the_map() -> None:
    """
    In walls and outside, too; each where its kind says.
    """
    goals = list(islice(Goals(floor(), random.Random(1)), 2000))

    shares = {kind: sum(g.kind == kind for g in goals) / 2000 for kind in ("free", "occupied")}
    assert 0.5 < shares["free"] < 0.9
    assert 0.05 < shares["occupied"] < 0.4
    assert {goal.kind for goal in goals} == {"free", "occupied", "outside"}
    assert max(goal.place[0] for goal in goals) > 14.5
    assert min(goal.place[0] for goal in goals) < 0.5


def test_fixed_seeds_share_goals_between_setups_random_ones_do_not() -> None:
    def goals(setup: str, series: str, seed: int) -> list[object]:
        rng = Streams("corridor 1", setup, series, seed).of("goals")
        return list(islice(Goals(floor(), rng), 20))

    assert goals("map", "fixed", 1) == goals("no_map", "fixed", 1)
    assert goals("map", "fixed", 1) != goals("map", "fixed", 2)
    assert goals("map", "random", 1) != goals("no_map", "random", 1)
    assert goals("map", "random", 1) == goals("map", "random", 1)
