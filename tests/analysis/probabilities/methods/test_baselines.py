"""The constant and plain hour tables: shares of the known time, by hand and by brute force."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from semmap_log.analysis.probabilities.estimator import Estimator
from semmap_log.analysis.probabilities.methods.baselines import CONSTANT, HOUR_OF_DAY, HOUR_OF_WEEK
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import DOOR, evidence, hours_ns, random_stretches

UTC = LocalClock("UTC")


def p_of(method: Estimator, known: object, at_h: list[float], known_h: list[float]) -> list[float]:
    found = method.learn({DOOR: known}, UTC).predict(DOOR, hours_ns(at_h), hours_ns(known_h))
    return found.p_open.tolist()


def test_knowledge_ends_within_a_stretch() -> None:
    """Of a stretch that goes on, what was before counts."""
    known = evidence([(0, 3, False), (3, 9, True)])

    assert pytest.approx([0.25, 0.5]) == p_of(CONSTANT, known, [20, 20], [4, 6])


def test_an_hour_table_has_an_entry_for_each_hour() -> None:
    """Half of the hour from eight on open on one day of two; an hour never seen has the mean."""
    known = evidence([(8, 8.5, True), (8.5, 9, False), (32, 33, False)])

    assert pytest.approx([0.25, 0.25, 0.25]) == p_of(
        HOUR_OF_DAY, known, [48 + 8.1, 48 + 8.9, 48 + 20], [48] * 3
    )
    assert pytest.approx([0.5, 0.001, 0.25]) == p_of(
        HOUR_OF_WEEK, known, [168 + 8.1, 168 + 32.1, 168 + 20], [168] * 3
    )


def test_visits_count_like_minutes() -> None:
    """As read: two of three said open."""
    known = evidence(visits=[(8.1, True), (8.2, False), (32.1, True)])

    assert pytest.approx([2 / 3, 0.5]) == p_of(CONSTANT, known, [50, 50], [50, 9])
    assert pytest.approx([0.5, 0.999]) == p_of(HOUR_OF_WEEK, known, [168 + 8, 168 + 32], [168] * 2)


@pytest.mark.parametrize(("method", "hours"), [(HOUR_OF_DAY, 24), (HOUR_OF_WEEK, 168)])
def test_tables_equal_plain_counting(method: Estimator, hours: int) -> None:
    """At any time of knowledge the entry is the share of all minutes before it in that hour."""
    rng = np.random.default_rng(4)
    stretches = random_stretches(rng, 20 * 24)
    known_min = rng.integers(24 * 60, 24 * 60 * 25, 200)
    asked_min = rng.integers(0, 24 * 60 * 25, 200)

    found = p_of(method, evidence(stretches), (asked_min / 60).tolist(), (known_min / 60).tolist())

    minutes = np.concatenate([np.arange(round(a * 60), round(b * 60)) for a, b, _ in stretches])
    is_open = np.concatenate([np.full(round(b * 60) - round(a * 60), o) for a, b, o in stretches])
    for p, asked, known in zip(found, asked_min, known_min, strict=True):
        before = minutes < known
        same = before & (minutes // 60 % hours == asked // 60 % hours)
        expected = is_open[same].mean() if same.any() else is_open[before].mean()
        assert pytest.approx(np.clip(expected, 0.001, 0.999), abs=1e-6) == p


def test_hours_are_those_of_the_buildings_clocks() -> None:
    """A door that opens at nine does so after the clocks were put forward, too."""
    vienna = LocalClock("Europe/Vienna")
    days = np.arange(20_500, 20_560)  # February to April 2026
    opens, closes = (vienna.instants_ns(days * 86_400.0 + h * 3600) for h in (9, 10))
    midnights = vienna.instants_ns(np.append(days, days[-1] + 1) * 86_400.0)
    edges = (np.stack([midnights[:-1], opens, closes], axis=1) - hours_ns(0)).ravel() / 3.6e12
    edges = np.append(edges, (midnights[-1] - hours_ns(0)) / 3.6e12)
    stretches = [(a, b, i % 3 == 1) for i, (a, b) in enumerate(pairwise(edges))]

    found = HOUR_OF_DAY.learn({DOOR: evidence(stretches)}, vienna).predict(
        DOOR, opens[-1:] + 60 * 10**9, midnights[-1:]
    )

    assert pytest.approx([0.999]) == found.p_open


def test_the_interval_narrows_with_days_not_with_minutes() -> None:
    """A day of minutes is one proof."""
    day = [(0, 12, True), (12, 24, False)]
    long = [(24 * d + a, 24 * d + b, o) for d in range(160) for a, b, o in day]

    short_one, long_one = (
        CONSTANT.learn({DOOR: evidence(known)}, UTC).predict(
            DOOR, hours_ns([9000]), hours_ns([9000])
        )
        for known in (long[:20], long)
    )

    assert ([0.5], [0.5]) == (short_one.p_open.tolist(), long_one.p_open.tolist())
    assert pytest.approx(0.5 + 1.6449 * 0.5 / np.sqrt(160), abs=0.001) == long_one.high[0]
    assert pytest.approx(3.8, abs=0.3) == (
        (short_one.high - short_one.low)[0] / (long_one.high - long_one.low)[0]
    )


@pytest.mark.parametrize("method", [CONSTANT, HOUR_OF_DAY, HOUR_OF_WEEK])
def test_before_the_first_word_nothing_is_known(method: Estimator) -> None:
    """P is a half and said to be unknown; so it is of a door never heard of."""
    learnt = method.learn({DOOR: evidence([(10, 20, True)])}, UTC)

    early = learnt.predict(DOOR, hours_ns([30, 30]), hours_ns([9, 11]))
    stranger = learnt.predict(2, hours_ns([30]), hours_ns([30]))

    assert [False, True] == early.is_known.tolist()
    assert [0.5, 0.999] == early.p_open.tolist()
    assert not stranger.is_known.any()
