"""What is believed right after a sighting, whatever was seen just before it."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.belief_fold import Beliefs, by_name
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.telling import DOOR, Told, added, ns_of, passed, seen, told_of

H = 3600.0


def p_open(*told: Told, at_s: float) -> float:
    """Return P(open) at the last of what was told."""
    beliefs = Beliefs(by_name("filter"), LocalClock("UTC"), told_of(added(), *told))
    return float(beliefs.predict(DOOR, np.array([ns_of(at_s)])).p_open[0])


@pytest.mark.parametrize("sightings", [1, 2, 100, 3000])
def test_how_often_a_pass_looks_does_not_matter(sightings: int) -> None:
    """Ten seconds of looking at 90 % say .9, however many looks."""
    told = [seen("open", H + 10 * i / sightings) for i in range(sightings)]

    found = p_open(*told, at_s=H + 10)

    assert found == pytest.approx(0.9, abs=0.005)


@pytest.mark.parametrize("every_s", [0.0, 0.001, 1.0, 600.0])
def test_what_is_certain_gainsays_all_that_was_certain_before(every_s: float) -> None:
    """A sensor that never errs saw the door open, again and again, and now closed: it is closed."""
    told = [seen("open", H + every_s * i, 1.0) for i in range(50)]
    last_s = H + every_s * 50

    found = p_open(*told, seen("closed", last_s, 1.0), at_s=last_s)

    assert found == pytest.approx(0.001)


def test_what_is_certain_is_believed_before_what_comes_next() -> None:
    """As above, and then a sensor that hardly tells reads open: it is still closed, most likely."""
    told = [seen("open", H + 0.01 * i, 1.0) for i in range(50)]

    found = p_open(*told, seen("closed", H + 1, 1.0), seen("open", H + 2, 0.6), at_s=H + 2)

    assert found < 0.01


def test_who_went_through_a_door_saw_it_open_whatever_was_read() -> None:
    """Though a sure sensor had called it closed a moment before."""
    told = [seen("closed", H + i, 1.0) for i in range(5)]

    found = p_open(*told, passed(H + 5), at_s=H + 5)

    assert found == pytest.approx(0.999)
