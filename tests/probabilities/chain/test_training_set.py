"""What rates are learnt from: as little as says the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from semmap_log.probabilities.chain import forgetting
from semmap_log.probabilities.chain.forgetting import forgettings_of
from semmap_log.probabilities.chain.nodes import Looks, looks, training_set
from semmap_log.probabilities.local_clock import LocalClock
from tests.probabilities.known import evidence, hours_ns

UTC = LocalClock("UTC")


def test_a_visit_is_one_lesson_however_long_one_looked() -> None:
    """
    Three sightings of a pass are one look, at the last of them, of what they add up to.
    """
    told = evidence(visits=[(0.50, True), (0.51, False), (0.52, True), (0.9, False)])
    told = replace(told, visit=np.array([0, 0, 0, 1]))

    found = training_set(told, UTC, int(hours_ns(0)), int(hours_ns(1.5)))

    seen = found.only(found.llr != 0)
    assert hours_ns([0.52, 0.9]).tolist() == seen.times_ns.tolist()
    assert [told.llr[:3].sum(), told.llr[3]] == pytest.approx(seen.llr.tolist())


def test_visits_of_two_sensors_may_mix() -> None:
    """
    Each is one look, at its own last sighting; looks stay in order of time.
    """
    told = evidence(visits=[(0.50, True), (0.51, True), (0.52, True), (0.53, True)])
    told = replace(told, visit=np.array([0, 1, 1, 0]))

    found = training_set(told, UTC, int(hours_ns(0)), int(hours_ns(1)))

    seen = found.only(found.llr != 0)
    assert hours_ns([0.52, 0.53]).tolist() == seen.times_ns.tolist()


def test_of_times_without_a_look_only_changes_of_the_hour_are_left() -> None:
    """
    There the rates change; half hours in between say nothing to who learns.
    """
    told = evidence(visits=[(0.2, True)])

    found = training_set(told, UTC, int(hours_ns(0)), int(hours_ns(2.9)))

    assert hours_ns([0.0, 0.2, 1.0, 2.0]).tolist() == found.times_ns.tolist()


def test_doors_learnt_in_groups_learn_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """
    However many go side by side: also none, and one that was never seen among others.
    """
    rng = np.random.default_rng(2)
    doors: list[Looks] = []
    for _ in range(4):
        times = np.sort(rng.uniform(0, 24 * 9, 150))
        visits = list(zip(times.tolist(), (rng.random(150) < 0.4).tolist(), strict=True))
        doors.append(training_set(evidence(visits=visits), UTC, *map(int, hours_ns([0, 24 * 9]))))
    doors.insert(2, looks(evidence(), UTC, int(hours_ns(0)), int(hours_ns(48))))
    together = forgettings_of(doors)

    monkeypatch.setattr(forgetting, "SIDE_BY_SIDE", 1)
    in_groups = forgettings_of(doors)

    assert [] == forgettings_of([])
    assert forgetting.START is together[2] is in_groups[2]
    for one, other in zip(together, in_groups, strict=True):
        np.testing.assert_allclose(one.rates.opening, other.rates.opening, rtol=1e-6)
        np.testing.assert_allclose(one.rates.closing, other.rates.closing, rtol=1e-6)
