"""What a watched door remembers: running means, what they were worth, and that it helps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.methods.filter import DoorFilter
from semmap_log.analysis.probabilities.methods.memory import (
    SPANS_H,
    STEP_H,
    STEPS_A_DAY,
    Memory,
    _averaged,
    _between,
)
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.chains import stretches_of
from tests.analysis.probabilities.known import evidence, hours_ns

UTC = LocalClock("UTC")
DAYS = 120


def kept(known_ns: np.ndarray, gap_ns: np.ndarray) -> np.ndarray:
    """Return what a chain keeps that forgets in two hours."""
    return np.broadcast_to(np.exp(-gap_ns / 7.2e12), (len(known_ns), len(gap_ns)))


class NoMemory:
    """What a door is like that remembers its state alone."""

    def correction(self, _: object, times_ns: np.ndarray, *__: object) -> np.ndarray:
        return np.zeros(len(times_ns))


def memory_of(told: DoorEvidence) -> Memory:
    return Memory(told, DoorSchedule(told, UTC), UTC)


@pytest.fixture(scope="module")
def two_kinds() -> DoorEvidence:
    """Return a door that is shut for four hours, and then open for minutes, or most of a day."""
    rng = np.random.default_rng(12)
    told = stretches_of(24 * DAYS, 4.0, np.array([0.3, 0.3, 0.3, 20.0]), rng)
    return evidence(told).up_to(int(hours_ns(24 * DAYS)))


@pytest.mark.parametrize("count", [0, 1, 95, 96, 97, 400])
@pytest.mark.parametrize("span_h", SPANS_H.tolist())
def test_means_are_those_of_a_plain_loop(count: int, span_h: float) -> None:
    """Days side by side give what one step after the other gives, in part of a day, too."""
    deviation = np.random.default_rng(count).normal(size=count)
    keep = math.exp(-STEP_H / span_h)
    expected, mean = [], 0.0
    for one in deviation.tolist():
        mean = keep * mean + (1 - keep) * one
        expected.append(mean)

    found = _averaged(deviation, np.zeros(-(-count // STEPS_A_DAY), np.int64), span_h)

    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-15)


def test_on_the_first_day_it_says_nothing() -> None:
    """What a day was worth is known at its end: until then there is no correction."""
    told = evidence(stretches_of(48.0, 2.0, 2.0, np.random.default_rng(1)))
    learnt = memory_of(told.up_to(int(hours_ns(48))))
    known_ns = hours_ns([5.0, 23.9, 24.0, 30.0])

    found = learnt.correction(kept, known_ns + int(3.6e12), known_ns, np.full(4, 0.5))

    assert [True, True, False, False] == (found == 0).tolist()


def test_a_patrol_has_no_memory() -> None:
    """A door that was only visited is corrected by nothing: nobody knows how it was in between."""
    visits = [(hour / 2, hour % 7 < 3) for hour in range(48 * 30)]
    known_ns = hours_ns([24.0 * 29])

    found = memory_of(evidence(visits=visits)).correction(kept, known_ns, known_ns, np.ones(1))

    assert [0.0] == found.tolist()


def test_weights_are_a_line_between_the_times_they_were_fitted_for() -> None:
    """From nothing at once over those of 1, 2, 4 … hours to nothing behind twice the last."""
    weights = np.arange(1.0, 7.0)[None, :, None]
    ahead_h = np.array([0.0, 0.5, 1.0, 3.0, 32.0, 48.0, 64.0, 1000.0])

    found = _between(np.repeat(weights, len(ahead_h), axis=0), ahead_h)

    expected = [0.0, 0.5, 1.0, 2.5, 6.0, 3.0, 0.0, 0.0]
    np.testing.assert_allclose(found[:, 0], expected)


def test_it_helps_where_openings_are_of_two_kinds(two_kinds: DoorEvidence) -> None:
    """Openings of minutes and of a day: memory lowers the Brier score an hour ahead."""
    rng = np.random.default_rng(4)
    known_ns = hours_ns(np.sort(rng.uniform(24 * 40, 24 * DAYS - 2, 4000)))
    times_ns = known_ns + int(3.6e12)
    place = np.searchsorted(two_kinds.start_ns, times_ns, "right") - 1
    came = two_kinds.is_open[place]
    learnt, forgetful = DoorFilter(two_kinds, UTC), DoorFilter(two_kinds, UTC)
    forgetful._memory = NoMemory()  # type: ignore[assignment]

    found, alone = (one.predict(times_ns, known_ns).p_open for one in (learnt, forgetful))

    assert np.mean((found - came) ** 2) < 0.95 * np.mean((alone - came) ** 2)
