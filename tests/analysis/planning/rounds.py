"""Rounds made up at random, and what is said of them without any cleverness."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from semmap_log.analysis.planning.round_task import Orders, RoundTask


def a_round(seed: int, count: int, *, times: int = 1, budget_s: float | None = None) -> RoundTask:
    """Return stops somewhere in 60 m x 40 m, as the crow flies; P changes at so many times."""
    random = np.random.default_rng([seed, count, times])
    places = random.random((count + 1, 2)) * (60, 40)
    apart_s = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) / 0.7
    return RoundTask(
        apart_s[0, 1:], apart_s[1:, 1:], random.random((count, times)),
        enter_s=np.full(count, 17.0), fail_s=random.uniform(3, 60, count),
        step_s=300.0, budget_s=budget_s,
    )  # fmt: skip


def all_orders(count: int) -> Orders:
    """Return each order of so many stops."""
    return np.array(list(permutations(range(count))), np.intp)


def plain_cost(task: RoundTask, order: list[int]) -> float:
    """Return the sum of P x time of arrival of an order, stop after stop; P does not change."""
    now = total = 0.0
    for place, stop in enumerate(order):
        now += float(task.leg_s[order[place - 1], stop] if place else task.from_start_s[stop])
        p = float(task.p_passes[stop, 0])
        total += p * now
        now += p * float(task.enter_s[stop]) + (1 - p) * float(task.fail_s[stop])
    return total
