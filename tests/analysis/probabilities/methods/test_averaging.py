"""Which table is believed: who foretold the past well, at that distance, and nobody for ever."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.day_tables import DayRows, DayTables
from semmap_log.analysis.probabilities.methods.habits import (
    HALF_LIVES_D,
    RATE,
    SHARE,
    GapSums,
    Habits,
    KindTables,
    weights,
)

TABLES = len(HALF_LIVES_D)


def told(p_open: np.ndarray, days: DayTables) -> Habits:
    """Return tables that say the same at every hour.

    Args:
        p_open: (rows, tables).
        days: Of which they are.
    """
    nowhere = GapSums(*np.zeros((3, 0)))
    return Habits(KindTables([p_open]), KindTables([np.ones_like(p_open)]), HALF_LIVES_D, nowhere)


def always(state: float, days: int) -> DayTables:
    return DayTables(DayRows.since(0, days), np.ones((days, 24)), np.full((days, 24), state))


def test_before_any_day_tables_that_remember_longer_are_for_what_is_far() -> None:
    """Two months ahead a table of one day's memory weighs 57 times less than one without end."""
    tables = told(np.full((1, TABLES), 0.5), always(1.0, 0))

    near, far = (weights(tables, always(1.0, 0), lead_d)[0] for lead_d in (0, 56))

    np.testing.assert_allclose(near, 1 / TABLES)
    assert far[-1] == pytest.approx(57 * far[0])
    assert (np.diff(far) > 0).all()


def test_a_table_gains_by_a_quarter_of_each_hours_likelihood() -> None:
    """One table said .6 of an open day and all others .5: 24 hours at a quarter."""
    days = always(1.0, 1)
    p_open = np.full((2, TABLES), 0.5)
    p_open[:, 2] = 0.6

    found = weights(told(p_open, days), days, 0)[1]

    gain = (0.6 / 0.5) ** (24 * RATE)
    expected = (1 - SHARE) * gain / (gain + TABLES - 1) + SHARE / TABLES
    assert 0.25 == RATE
    assert expected == pytest.approx(found[2])


def test_no_table_is_lost() -> None:
    """After a year in which one was always wrong, it still has what is handed out anew each day."""
    days = always(1.0, 365)
    p_open = np.full((366, TABLES), 0.9)
    p_open[:, 3] = 0.01

    found = weights(told(p_open, days), days, 0)[-1]

    assert 0.02 == SHARE
    assert SHARE / TABLES == pytest.approx(found[3], rel=1e-6)


def test_a_table_is_scored_as_old_as_its_forecasts_are() -> None:
    """A table that was wrong until a week ago is right about today, not about a week ahead."""
    days = always(1.0, 20)
    p_open = np.full((21, TABLES), 0.5)
    p_open[:, 1] = np.where(np.arange(21) < 13, 0.45, 0.95)

    today, week = (weights(told(p_open, days), days, lead_d)[-1, 1] for lead_d in (0, 7))

    assert today > 0.5
    assert week < 0.1


def test_days_of_which_nothing_is_known_move_little() -> None:
    """Only what is handed out anew drifts back; there is nothing to be right about."""
    days = DayTables(DayRows.since(0, 1), np.zeros((1, 24)), np.zeros((1, 24)))
    p_open = np.tile(np.linspace(0.1, 0.9, TABLES), (2, 1))

    found = weights(told(p_open, days), days, 0)

    np.testing.assert_allclose(found[1], found[0])
