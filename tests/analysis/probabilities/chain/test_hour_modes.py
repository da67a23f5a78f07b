"""In which mode each hour of the week is: by what its own looks and those of other hours say."""

from __future__ import annotations

import numpy as np

from semmap_log.analysis.probabilities.chain import hour_modes
from semmap_log.analysis.probabilities.chain.hour_modes import PRIOR, likely_modes

OPENS_PER_H = hour_modes.SHARE * hour_modes.PER_H


def told_of(passed: np.ndarray, waited_h: np.ndarray) -> np.ndarray:
    """Return what passages to open tell: a Poisson count in each hour of the week."""
    return passed[..., None] * np.log(OPENS_PER_H) - waited_h[..., None] * OPENS_PER_H


def mean_per_h(likely: np.ndarray) -> np.ndarray:
    found: np.ndarray = likely @ OPENS_PER_H
    return found


def test_of_nothing_each_mode_is_as_likely_as_before() -> None:
    """No hour says anything: the prior stands."""
    found = likely_modes(np.zeros((7, 24, len(PRIOR))))

    np.testing.assert_allclose(found, np.broadcast_to(PRIOR, found.shape), rtol=1e-9)


def test_quiet_hours_say_how_quiet_each_is() -> None:
    """Never opened in six weeks: alone an hour may open once a week; a week of them hardly does."""
    quiet = np.zeros((7, 24))
    alone = np.full((7, 24), 0.0)
    alone[2, 3] = 6.0

    found = mean_per_h(likely_modes(told_of(quiet, np.full((7, 24), 6.0))))
    one = mean_per_h(likely_modes(told_of(quiet, alone)))

    assert found.max() < 0.002
    assert one[2, 3] > 5 * found[2, 3]


def test_a_slot_says_nothing_about_the_other_days() -> None:
    """Opened each Wednesday at ten: Thursday at ten stays as quiet as Thursday at nine."""
    passed, waited_h = np.zeros((7, 24)), np.full((7, 24), 6.0)
    passed[2, 10:12], waited_h[2, 10:12] = 6.0, 2.0

    found = mean_per_h(likely_modes(told_of(passed, waited_h)))

    assert found[2, 10:12].min() > 1.5
    others = np.delete(found[:, 10], 2)
    assert others.max() < 0.02


def test_hours_of_such_days_are_alike() -> None:
    """A Monday of which little was seen is like the other working days."""
    passed, waited_h = np.zeros((7, 24)), np.full((7, 24), 6.0)
    passed[:5, 9:17], waited_h[:5, 9:17] = 3.0, 1.0
    passed[0, 12], waited_h[0, 12] = 0.0, 0.1

    found = mean_per_h(likely_modes(told_of(passed, waited_h)))

    assert 2 < found[0, 12] < 4
    assert found[5:, 12].max() < 0.1


def test_modes_of_all_hours_are_drawn_together_not_to_a_mean() -> None:
    """Half of the hours open once a week, half each ten minutes: none is in between."""
    passed, waited_h = np.zeros((7, 24)), np.full((7, 24), 8.0)
    passed[:, 8:20], waited_h[:, 8:20] = 24.0, 4.0

    found = mean_per_h(likely_modes(told_of(passed, waited_h)))

    assert found[:, 8:20].min() > 4.5
    assert found[:, :8].max() < 0.02
