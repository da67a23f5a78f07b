"""Intervals contain the truth nine times of ten, however long a door stays as it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from eval_sim_doors import intervals, told

from door_sim.kinds import without_hours

DOORS = range(16)


def forgets_in(hours: float) -> Callable[[np.random.Generator], object]:
    return lambda rng: without_hours(rng, hours)


@pytest.mark.slow
@pytest.mark.parametrize("forgets_h", [4.0, 48.0])
@pytest.mark.parametrize("patrolled", [False, True])
def test_intervals_of_slow_doors_hold(forgets_h: float, *, patrolled: bool) -> None:
    """
    Twelve weeks; a door that stays as it is for hours, or for two days.
    """
    doors = (told(forgets_in(forgets_h), 12, seed, patrolled=patrolled) for seed in DOORS)

    found = intervals(doors)

    assert found["count"] >= 0.8
    assert found["schedule"] >= 0.8
