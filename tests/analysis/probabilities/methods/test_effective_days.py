"""How many independent days a door's evidence is worth, and so how wide its intervals are."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.day_tables import day_tables
from semmap_log.analysis.probabilities.methods.effective_days import Variances, lasting_of
from semmap_log.analysis.probabilities.methods.habits import (
    WeekCells,
    habits,
    slowest_habit,
    weights,
)
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule, noise_of
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import HOUR_NS, evidence, hours_ns

UTC = LocalClock("UTC")


def test_the_longer_states_last_the_less_a_day_proves() -> None:
    """Two doors, each half of the time open, over eight weeks: by hours, and by days."""
    found = []
    for lasts_h in (1.0, 36.0):
        edges = np.arange(0.0, 56 * 24, lasts_h)
        door = evidence([(a, a + lasts_h, i % 2 == 1) for i, a in enumerate(edges.tolist())])
        now_ns = int(hours_ns(56 * 24))
        said = DoorSchedule(door.up_to(now_ns - 1), UTC).predict(
            now_ns + HOUR_NS * np.arange(24), np.full(24, now_ns)
        )
        found.append(float((said.high - said.low).mean()))

    quick, slow = found
    assert slow > 1.5 * quick


def test_a_day_of_noisy_readings_proves_less_than_a_known_one() -> None:
    """The same door, told and seen: what errs is less sure."""
    stretches = [(24.0 * d + h, 24.0 * d + h + 12, h == 12) for d in range(28) for h in (0, 12)]
    visits = [(h + 0.5, h % 24 >= 12) for h in range(28 * 24)]
    now_ns = int(hours_ns(28 * 24))
    widths = []
    for door in (evidence(stretches), evidence(visits=visits)):
        said = DoorSchedule(door.up_to(now_ns - 1), UTC).predict(
            now_ns + HOUR_NS * np.arange(24), np.full(24, now_ns)
        )
        widths.append(float((said.high - said.low).mean()))

    assert widths[0] < widths[1]


@pytest.mark.parametrize(("a_visit_h", "noise"), [(1.0, 0.09), (0.5, 0.045)])
def test_readings_err_by_chance(a_visit_h: float, noise: float) -> None:
    """A corrected reading of an accuracy of .9 errs by .09 / .64, and counts as .64 of an hour."""
    visits = [(h * a_visit_h + 0.25, h % 3 == 0) for h in range(round(14 * 24 / a_visit_h))]
    known = evidence(visits=visits).up_to(int(hours_ns(14 * 24)) - 1)
    tables = day_tables(known, UTC)

    found = noise_of(known, tables, UTC)

    assert 0 == found[0]
    assert noise == pytest.approx(found[-1])
    by_table = habits(tables)
    lasting = lasting_of(slowest_habit(tables), tables, found)
    cells = WeekCells(*np.array([[len(tables)] * 24, [3] * 24, range(24)]))
    worth = weights(by_table, tables, 0)[cells.row]
    wide, narrow = (
        Variances(by_table, tables, lasting._replace(noise=of)).at(cells, worth)
        for of in (found, 0 * found)
    )
    assert (wide > narrow).all()


def test_what_is_known_has_no_errors() -> None:
    """Stretches alone; and beside them as many visits: noise, but less."""
    stretches = [(24.0 * d, 24.0 * d + 12, False) for d in range(14)]
    visits = [(24.0 * d + h + 0.5, False) for d in range(14) for h in range(12, 24)]
    alone, both = (evidence(stretches, of).up_to(int(hours_ns(14 * 24)) - 1) for of in ((), visits))

    assert not noise_of(alone, day_tables(alone, UTC), UTC).any()
    assert 0 < noise_of(both, day_tables(both, UTC), UTC)[-1] < 0.06
