"""What visits tell of an hour in each mode, against sums over every path of the door."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from semmap_log.analysis.probabilities.chain import hour_modes
from semmap_log.analysis.probabilities.chain.looks import HourLooks, Looks
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import hours_ns

UTC = LocalClock("UTC")
HOURS = np.array([0.2, 0.6, 0.9, 1.4, 1.45, 2.3, 2.4, 2.8])
BY_HOUR = ((0, 0.2), (0, 0.6), (0, 0.9), (1, 1.4), (1, 1.45), (1, 2.3), (2, 2.4), (2, 2.8))
"""Each look, and the hour in which the middle of the time before it lies."""
MODES = (3, 29, 41)


def some_looks(seed: int = 2) -> Looks:
    llr = np.random.default_rng(seed).normal(0, 2, len(HOURS))
    return Looks(hours_ns(HOURS), llr, np.arange(1, len(HOURS) + 1))


def log_likelihood(looks: Looks, modes: list[int], first: float) -> float:
    """Return that of all looks, each passage to one in a mode of its own, by all paths."""
    sees = 1 / (1 + np.exp(-looks.llr))
    gaps_h = np.diff(HOURS, prepend=HOURS[:1])
    total = 0.0
    for path in product((0, 1), repeat=len(looks) + 1):
        weight = first if path[0] else 1 - first
        for i, mode in enumerate(modes):
            share = hour_modes.SHARE[mode]
            kept = np.exp(-hour_modes.PER_H[mode] * gaps_h[i])
            p_open = share + kept * (path[i] - share)
            weight *= p_open * sees[i] if path[i + 1] else (1 - p_open) * (1 - sees[i])
        total += weight
    return float(np.log(total))


def test_hours_are_those_of_the_middle_between_looks() -> None:
    """From 1.45 to 2.3 most is of the hour from one to two; an hour without looks is none."""
    found = HourLooks(some_looks(), UTC)

    assert (found.hour - found.hour[0]).tolist() == [0, 1, 2]


@pytest.mark.parametrize("mode", MODES)
def test_an_hour_alone_begins_in_its_long_run(mode: int) -> None:
    """Each hour's likelihood is that of a door of which nothing was seen before, nor after."""
    looks = some_looks()

    found = HourLooks(looks, UTC).explained(None)

    for row in range(3):
        inside = [i for i, (hour, _) in enumerate(BY_HOUR) if hour == row]
        part = _log_likelihood_of(looks, inside, mode)
        assert part == pytest.approx(found[row, mode], rel=1e-9)


def _log_likelihood_of(looks: Looks, inside: list[int], mode: int) -> float:
    share, per_h = hour_modes.SHARE[mode], hour_modes.PER_H[mode]
    gaps_h = np.diff(HOURS, prepend=HOURS[:1])
    sees = 1 / (1 + np.exp(-looks.llr))
    total = 0.0
    for path in product((0, 1), repeat=len(inside) + 1):
        weight = share if path[0] else 1 - share
        for step, i in enumerate(inside):
            p_open = share + np.exp(-per_h * gaps_h[i]) * (path[step] - share)
            weight *= p_open * sees[i] if path[step + 1] else (1 - p_open) * (1 - sees[i])
        total += weight
    return float(np.log(total))


@pytest.mark.parametrize("row", range(3))
def test_what_was_seen_before_and_after_speaks_too(row: int) -> None:
    """The difference of two modes of one hour is that of all looks."""
    looks, modes = some_looks(), np.array(MODES)
    likely = np.zeros((3, len(hour_modes.SHARE)))
    likely[np.arange(3), modes] = 1.0

    found = HourLooks(looks, UTC).explained(likely)[row]

    other = modes.copy()
    other[row] = 50
    said = [
        log_likelihood(looks, [int(each[hour]) for hour, _ in BY_HOUR], 0.5)
        for each in (modes, other)
    ]
    assert said[0] - said[1] == pytest.approx(found[modes[row]] - found[50], rel=1e-9)
