"""What is known lies years apart: the clock said 1970 first, or the robot was stored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from semmap_log.analysis.probabilities.belief_fold import ESTIMATORS, by_name
from semmap_log.analysis.probabilities.chain.looks import looks
from semmap_log.analysis.probabilities.estimator import LearntModel, StateModel
from semmap_log.analysis.probabilities.evidence import day_tables as day_tables_module
from semmap_log.analysis.probabilities.evidence.day_tables import DayRows, day_tables
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.methods.effective_days import EvidenceDays
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import DOOR, evidence, hours_ns, random_stretches

VIENNA = LocalClock("Europe/Vienna")


def apart(gaps_d: tuple[int, ...], *, days: int = 12) -> DoorEvidence:
    """Return a door that is watched and visited for some days, again and again, after gaps."""
    rng = np.random.default_rng(7)
    stretches, visits, begin_h = [], [], 0.0
    for gap_d in gaps_d:
        begin_h += 24 * gap_d
        found = random_stretches(rng, 24 * days / 2, mean_h=5.0, hole=0.2)
        stretches += [(begin_h + a, begin_h + b, is_open) for a, b, is_open in found]
        seen = begin_h + np.sort(rng.uniform(24 * days / 2, 24 * days, 40))
        visits += [(h, bool(rng.random() < 0.3)) for h in seen.tolist()]
        begin_h += 24 * days
    ever = replace(evidence(stretches, visits), until_ns=MAX_TIME_NS)
    return ever.up_to(int(hours_ns(begin_h + 30)))


def learnt(name: str, told: DoorEvidence) -> LearntModel:
    return by_name(name).learn({DOOR: told}, VIENNA)


@pytest.mark.parametrize("name", [*ESTIMATORS])
@pytest.mark.parametrize(
    "gaps_d", [(0, 100), pytest.param((0, 95, 700), marks=pytest.mark.slow)], ids=str
)
def test_forecasts_are_those_that_go_through_every_day(
    gaps_d: tuple[int, ...], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In what is known, in the gaps, and after them."""
    told = apart(gaps_d)
    rng = np.random.default_rng(1)
    known_ns = np.sort(rng.integers(told.first_ns, told.until_ns, 300))
    known_ns = np.append(known_ns, rng.choice(np.append(told.start_ns, told.seen_ns), 200) + 60)
    times_ns = known_ns + hours_ns(rng.choice([0.0, 0.3, 30.0, 900.0], 500)) - hours_ns(0)

    sparse = learnt(name, told)
    found = sparse.predict(DOOR, times_ns, known_ns)
    monkeypatch.setattr(day_tables_module, "LONGEST_GAP_D", 10**6)
    dense = learnt(name, told)
    expected = dense.predict(DOOR, times_ns, known_ns)

    for column in ("p_open", "low", "high", "is_known", "effective_days"):
        np.testing.assert_allclose(getattr(found, column), getattr(expected, column), rtol=1e-9)
    if isinstance(sparse, StateModel) and isinstance(dense, StateModel):
        at_ns = int(told.seen_ns[-1])
        assert dense.wait_s(DOOR, at_ns) == pytest.approx(sparse.wait_s(DOOR, at_ns), rel=1e-9)


@pytest.mark.parametrize("years", [56, 290])
def test_what_is_made_of_evidence_goes_by_the_evidence(years: int) -> None:
    """Two weeks make as many rows, steps and looks, whether a week or an age lies between them."""
    near, far = apart((0, 7)), apart((0, 365 * years))

    def sizes(told: DoorEvidence) -> tuple[int, int]:
        return len(day_tables(told, VIENNA)), len(looks(told, VIENNA, told.until_ns))

    for rows, most in zip(sizes(far), sizes(near), strict=True):
        assert rows <= most + day_tables_module.LONGEST_GAP_D
    assert 24 < len(EvidenceDays(far, VIENNA).tables) < 24 + day_tables_module.LONGEST_GAP_D


def test_a_gap_leaves_out_whole_weeks() -> None:
    """So the weekday of each row follows on that of the row before."""
    rows = DayRows.of(np.array([3, 1000, 5001]), np.array([10, 1004, 5001]), weekly=True)

    assert ((np.diff(rows.midnights) - 1) % 7 == 0).all()
    assert [11, 1005] == rows.days[rows.is_gap].tolist()
    assert {*range(3, 12), *range(1000, 1006), 5001} <= {*rows.days.tolist()}
    assert 11 + 5 + 1 <= len(rows) <= 11 + 5 + 1 + 2 * 6
    assert 5002 == rows.midnights[-1]


def test_a_gap_that_is_not_long_has_all_rows() -> None:
    """`LONGEST_GAP_D` days between two; with one more, one row stands for what is left."""
    last = 1 + day_tables_module.LONGEST_GAP_D
    whole, cut = (DayRows.of(ends, ends) for ends in np.array([[0, last], [0, last + 1]]))

    assert list(range(last + 1)) == whole.days.tolist()
    assert [0, 1, last + 1] == cut.days.tolist()
    assert [1, last, 1] == cut.lasts_d.tolist()


def test_visits_alone_have_no_time_that_is_held() -> None:
    """Looks are then where sightings are, be it that years lie between them."""
    told = apart((0, 365 * 56))
    none = slice(0)
    seen = replace(told, start_ns=told.start_ns[none], end_ns=told.end_ns[none],
                   is_open=told.is_open[none], holds_on=False)  # fmt: skip

    assert len(looks(seen, VIENNA, seen.until_ns)) <= 1 + len(seen.seen_ns)
