"""A round under way: what comes next after each door, and when the order is made anew."""

from __future__ import annotations

import numpy as np

from semmap_log.analysis.planning.patrol_round import PatrolRound, PatrolTarget
from semmap_log.analysis.planning.round_task import RoundTask, with_stop
from tests.analysis.planning.rounds import a_round


def in_a_row(p_passes: list[float], **how: float | None) -> RoundTask:
    """Return doors along a corridor, 10 s from one to the next."""
    count = len(p_passes)
    at_s = np.arange(1, count + 1) * 10.0
    return RoundTask(
        at_s, np.abs(at_s[:, None] - at_s), np.array(p_passes)[:, None],
        np.full(count, 17.0), np.full(count, 13.0), **how,
    )  # fmt: skip


def each_alone(count: int) -> list[PatrolTarget]:
    return [PatrolTarget(f"room {door}", (door,)) for door in range(count)]


def walked(round_: PatrolRound, lets_in: set[int]) -> list[int]:
    """Return the doors that are tried, each taking no time."""
    tried = []
    while (planned := round_.next_try()) is not None:
        tried.append(planned.door)
        round_.tell(planned.door, passed=planned.door in lets_in, now_s=planned.arrives_s)
    return tried


def test_every_room_is_visited_once() -> None:
    """And the round ends."""
    round_ = PatrolRound(a_round(1, 9), each_alone(9))

    tried = walked(round_, set(range(9)))

    assert sorted(tried) == list(range(9))


def test_the_other_door_is_tried_where_one_is_shut() -> None:
    """And not where it let the robot in."""
    rooms = [PatrolTarget("two", (0, 2)), PatrolTarget("one", (1,))]

    shut = walked(PatrolRound(in_a_row([0.9, 0.8, 0.7]), rooms), {1, 2})
    fine = walked(PatrolRound(in_a_row([0.9, 0.8, 0.7]), rooms), {0, 1})

    assert (sorted(shut), shut[0]) == ([0, 1, 2], 0)
    assert sorted(fine) == [0, 1]


def test_the_likelier_door_of_a_room_comes_first() -> None:
    """Where both are about as far."""
    rooms = [PatrolTarget("two", (0, 1))]

    assert walked(PatrolRound(in_a_row([0.1, 0.9]), rooms), {1}) == [1]


def test_the_nearer_door_of_a_room_where_that_costs_less() -> None:
    """P is a little lower, and the way much shorter."""
    rooms = [PatrolTarget("two", (0, 5)), *(PatrolTarget(str(n), (n,)) for n in (1, 2, 3, 4))]

    tried = walked(PatrolRound(in_a_row([0.85, 0.9, 0.9, 0.9, 0.9, 0.9]), rooms), set(range(6)))

    assert tried == [0, 1, 2, 3, 4]


def test_the_order_is_made_anew_on_surprise_only() -> None:
    """Nothing new where each door is as expected; once for one that is not."""
    expected = PatrolRound(in_a_row([0.9, 0.9, 0.1, 0.9]), each_alone(4))
    surprised = PatrolRound(in_a_row([0.9, 0.9, 0.1, 0.9]), each_alone(4))

    walked(expected, {0, 1, 3})
    walked(surprised, {0, 3})

    assert (expected.replans, surprised.replans) == (0, 1)


def test_a_door_beside_the_plan_is_taken_in() -> None:
    """What the robot found elsewhere counts, and the rest follows from there."""
    round_ = PatrolRound(in_a_row([0.9] * 5), each_alone(5))

    round_.tell(4, passed=True, now_s=60.0)

    assert walked(round_, set(range(5))) == [3, 2, 1, 0]
    assert round_.replans == 1


def test_skipped_doors_are_not_tried() -> None:
    """A room keeps its other door; one without another is left out, and named."""
    rooms = [PatrolTarget("two", (0, 1)), PatrolTarget("one", (2,))]
    skipped = np.array([True, False, True])

    round_ = PatrolRound(in_a_row([0.9, 0.5, 0.9]), rooms, skipped=skipped)

    assert [left.name for left in round_.left_out] == ["one"]
    assert walked(round_, set()) == [1]


def test_the_budget_ends_the_round() -> None:
    """What it does not reach is named."""
    round_ = PatrolRound(in_a_row([1.0] * 6, budget_s=60.0), each_alone(6))

    assert [planned.door for planned in round_.plan()] == [0, 1]
    assert sorted(target.name for target in round_.cut_off()) == [f"room {n}" for n in range(2, 6)]


def test_a_stop_more_at_each_place() -> None:
    """The rest of the order stays as it was."""
    order = np.array([5, 3, 8])

    assert with_stop(order, 7).tolist() == [[7, 5, 3, 8], [5, 7, 3, 8], [5, 3, 7, 8], [5, 3, 8, 7]]
    assert with_stop(order[:0], 7).tolist() == [[7]]
