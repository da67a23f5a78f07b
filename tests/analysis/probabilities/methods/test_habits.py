"""Tables of habits: each worked out by hand, from the coarse to the fine."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.day_tables import DayRows, DayTables
from semmap_log.analysis.probabilities.methods.habits import (
    HALF_LIVES_D,
    KINDS,
    NEIGHBOURS_H,
    habits,
)

MONDAY = 70
MEAN, HOUR, TYPE, WEEKDAY = range(len(KINDS))
LAST = slice(-1, None)
FOREVER = len(HALF_LIVES_D) - 1


def table(opened: dict[tuple[int, int], float], *, days: int, known: float = 1.0) -> DayTables:
    """Return days from a Monday on of which each hour was known; open where told (day, hour)."""
    known_h, open_h = np.full((days, 24), known), np.zeros((days, 24))
    for place, hours in opened.items():
        open_h[place] = hours
    return DayTables(DayRows.since(MONDAY, len(known_h)), known_h, open_h)


def of_kind(tables: DayTables, kind: int, half_life: int = FOREVER) -> np.ndarray:
    """Return (7, 24), as known when all the days are over."""
    return habits(tables).p_open.of_weeks(LAST)[0, half_life * len(KINDS) + kind]


def shrunk(opened: float, known: float, coarser: float, weight: float) -> float:
    return (opened + weight * coarser) / (known + weight)


def test_the_mean_is_that_of_the_days_and_soon_forgets_the_prior() -> None:
    """Open for 6 of 48 hours: a tenth of a day at the share of all days, that one at one half."""
    tables = table({(0, hour): 1.0 for hour in range(6)}, days=2)

    found = of_kind(tables, MEAN)

    of_all_days = (6 / 24 + 0.1 * 0.5) / (48 / 24 + 0.1)
    np.testing.assert_allclose(found, (6 / 24 + 0.1 * of_all_days) / (48 / 24 + 0.1))


def test_an_hour_is_drawn_to_those_beside_it_and_these_to_the_mean() -> None:
    """Two days of an hour weigh against two days of its neighbours'."""
    tables = table({(day, 12): 1.0 for day in range(4)}, days=4)
    mean = shrunk(4 / 24, 4, shrunk(4 / 24, 4, 0.5, 0.1), 0.1)
    beside = np.exp(-np.minimum(np.arange(24), 24 - np.arange(24)) / NEIGHBOURS_H)
    known = 4 * beside.sum()

    found = of_kind(tables, HOUR)[0]

    near_noon = shrunk(4.0, known, mean, 2.0)
    assert shrunk(4.0, 4.0, near_noon, 2.0) == pytest.approx(found[12])
    near_ten = shrunk(4 * beside[2], known, mean, 2.0)
    assert shrunk(0.0, 4.0, near_ten, 2.0) == pytest.approx(found[10])


def test_saturday_is_no_working_day() -> None:
    """Open at noon from Monday to Friday: not on Saturday or Sunday."""
    weeks = {(7 * week + day, 12): 1.0 for week in range(6) for day in range(5)}

    found = of_kind(table(weeks, days=42), TYPE)[:, 12]

    assert found[:5].min() > 0.8
    assert found[5:].max() < 0.3
    assert 2 == len(set(found.round(12).tolist()))


def test_a_weekday_is_drawn_to_its_kind_of_day_by_four_days() -> None:
    """Tuesdays alone are open at nine: after three of them, three days weigh against four."""
    tables = table({(7 * week + 1, 9): 1.0 for week in range(3)}, days=21)
    working_day = of_kind(tables, TYPE)[1, 9]

    found = of_kind(tables, WEEKDAY)[:, 9]

    assert shrunk(3.0, 3.0, working_day, 4.0) == pytest.approx(found[1])
    assert shrunk(0.0, 3.0, working_day, 4.0) == pytest.approx(found[2])


def test_old_days_count_less_by_their_half_life() -> None:
    """A day open and a day shut: with a half-life of a day the first counts half."""
    tables = table({(0, hour): 1.0 for hour in range(24)}, days=2)
    undiscounted = shrunk(1.0, 2.0, 0.5, 0.1)

    found = [of_kind(tables, MEAN, half_life)[0, 0] for half_life in (0, FOREVER)]

    assert [1.0, np.inf] == [HALF_LIVES_D[0], HALF_LIVES_D[FOREVER]]
    assert shrunk(0.5, 1.5, undiscounted, 0.1) == pytest.approx(found[0])
    assert shrunk(1.0, 2.0, undiscounted, 0.1) == pytest.approx(found[1])


def test_what_is_hardly_known_hardly_counts() -> None:
    """Minutes of an hour are that share of a day, and the days of evidence say so."""
    much, little = (
        habits(table({}, days=10, known=share)).days.of_weeks(LAST)[0, FOREVER * 4]
        for share in (1, 0.1)
    )

    np.testing.assert_allclose(much, 10)
    np.testing.assert_allclose(little, 1)
