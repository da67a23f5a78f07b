"""In which order: exact where it is said to be, and near to the best elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from semmap_log.analysis.planning.best_order import (
    MOST_EXACT,
    best_order,
    exact_order,
    greedy_order,
    improved,
    nearest_order,
)
from semmap_log.analysis.planning.round_task import RoundTask
from semmap_log.errors import PlanError
from tests.analysis.planning.rounds import a_round, all_orders, plain_cost


@pytest.mark.parametrize("count", range(8))
def test_the_exact_order_is_that_of_brute_force(count: int) -> None:
    """No other order of up to seven stops has a lower mean time to visit."""
    for seed in range(12 if count < 7 else 4):
        task = a_round(seed, count)

        found = exact_order(task)

        assert sorted(found.tolist()) == list(range(count))
        least = min(plain_cost(task, order) for order in all_orders(count).tolist())
        assert plain_cost(task, found.tolist()) == pytest.approx(least)


def test_few_stops_of_fixed_p_are_in_the_exact_order() -> None:
    """Up to twelve; with more the search has to do."""
    task = a_round(3, MOST_EXACT)

    found = best_order(task)

    assert found.tolist() == exact_order(task).tolist()
    assert len(best_order(a_round(3, MOST_EXACT + 1))) == MOST_EXACT + 1


@pytest.mark.parametrize("count", [5, 9, 12])
def test_the_search_comes_near_to_the_best(count: int) -> None:
    """Within 1 % of the mean time to visit on average, 10 % at worst."""
    gaps = []
    for seed in range(60 if count < 12 else 15):
        task = a_round(seed, count)
        starts = [greedy_order(task), nearest_order(task), np.arange(count)]
        costs = [plain_cost(task, improved(task, start).tolist()) for start in starts]
        gaps.append(min(costs) / plain_cost(task, exact_order(task).tolist()) - 1)

    assert min(gaps) > -1e-9
    assert np.mean(gaps) <= 0.01
    assert max(gaps) <= 0.10


def test_no_single_move_makes_the_found_order_better() -> None:
    """Of twenty stops: no pair changes places, no piece is turned round, to gain anything."""
    task = a_round(8, 20)
    found = improved(task, np.arange(20)).tolist()
    cost = plain_cost(task, found)

    for low in range(20):
        for high in range(low + 1, 20):
            turned = found[:low] + found[low : high + 1][::-1] + found[high + 1 :]
            moved = found[:low] + found[low + 1 : high + 1] + [found[low]] + found[high + 1 :]
            assert plain_cost(task, turned) >= cost - 1e-6
            assert plain_cost(task, moved) >= cost - 1e-6


@pytest.mark.parametrize("budget_s", [None, 150.0])
def test_p_at_arrival_against_all_orders(budget_s: float | None) -> None:
    """Where doors open and close in the course of the round: six stops, each of the 720 orders."""
    gaps = []
    for seed in range(40):
        task = a_round(seed, 6, times=4, budget_s=budget_s)
        costs = task.cost(all_orders(6))
        found = float(task.cost(best_order(task)[None])[0])
        assert found >= costs.min() - 1e-9
        gaps.append((found - costs.min()) / abs(costs.min()))

    assert np.mean(gaps) <= 0.01
    assert max(gaps) <= 0.10


def test_a_door_that_opens_late_is_visited_late() -> None:
    """P is that at the time of arrival, not that of now: the near door opens in ten minutes."""
    near_opens_late = np.array([[0.0, 0.0, 1.0], [0.9, 0.9, 0.9]])
    task = RoundTask(
        np.array([5.0, 400.0]), np.array([[0.0, 400.0], [400.0, 0.0]]), near_opens_late,
        np.full(2, 17.0), np.full(2, 13.0), step_s=300.0,
    )  # fmt: skip

    assert best_order(task).tolist() == [1, 0]
    times_s, chances = task.arrivals(np.array([[1, 0]]))
    assert times_s[0, 1] == pytest.approx(400 + 0.9 * 17 + 0.1 * 13 + 400)
    assert chances[0].tolist() == [0.9, 1.0]
    assert best_order(replace(task, p_passes=near_opens_late[:, 2:])).tolist() == [0, 1]


def test_p_between_two_times_lies_between_theirs() -> None:
    """And stays what it is after the last."""
    task = replace(a_round(0, 1), p_passes=np.array([[0.2, 0.6]]), step_s=300.0)

    found = task.p_at(np.zeros(4, np.intp), np.array([0.0, 75.0, 300.0, 9e4]))

    assert found == pytest.approx([0.2, 0.3, 0.6, 0.6])


def test_what_the_budget_cuts_off_counts_as_not_visited() -> None:
    """The far stop, reached after the budget, is worth nothing; so the near one comes first."""
    task = a_round(5, 9, budget_s=200.0)
    order = best_order(task)

    times_s, chances = task.arrivals(order[None])

    in_time = times_s[0] < 200.0
    gained = (chances[0] * (200.0 - times_s[0]))[in_time].sum()
    assert task.cost(order[None])[0] == pytest.approx(-gained)


def test_a_round_of_nothing_and_of_one_stop() -> None:
    """Both are orders."""
    assert best_order(a_round(0, 0)).tolist() == []
    assert best_order(a_round(0, 1, times=2)).tolist() == [0]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("leg_s", np.zeros((2, 3))),
        ("from_start_s", np.array([1.0, np.inf, 1.0])),
        ("fail_s", np.array([1.0, -1.0, 1.0])),
        ("p_passes", np.full((3, 1), 1.5)),
        ("p_passes", np.zeros((3, 0))),
    ],
)
def test_what_is_no_round_is_refused(field: str, value: np.ndarray) -> None:
    """Shapes that do not fit, times that never end, probabilities beyond 0..1."""
    with pytest.raises(PlanError, match=r"a round: expected"):
        replace(a_round(0, 3), **{field: value})
