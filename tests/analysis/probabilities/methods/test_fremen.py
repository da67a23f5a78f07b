"""FreMEn, held against the algorithm of its authors, sample by sample."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.methods import fremen
from semmap_log.analysis.probabilities.methods.fremen import Fremen
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import DOOR, evidence, hours_ns, random_stretches
from tests.calls import calls_of

UTC = LocalClock("UTC")


def published(t: np.ndarray, y: np.ndarray, order: int, s: np.ndarray) -> np.ndarray:
    """Return P(open) at times `s` from samples, as CFrelement.cpp does it: add, update, estimate.

    Seconds of wall clock; periods are whole seconds there, too.
    """
    gain = y.mean()
    components = []
    for i in range(84):
        period = 7 * 24 * 3600 // (i + 1)
        angle = 2 * np.pi * t / period
        re = (y * np.cos(angle)).sum() - gain * np.cos(angle).sum()
        im = (y * np.sin(angle)).sum() - gain * np.sin(angle).sum()
        components.append((np.hypot(re, im) / len(t), period, np.arctan2(im, re)))
    components.sort(key=lambda c: -c[0])
    p = np.full(len(s), gain)
    for amplitude, period, phase in components[:order]:
        p += 2 * amplitude * np.cos(s / period * 2 * np.pi - phase)
    return np.clip(p, 0.01, 0.99)


def minute_samples(stretches: list[tuple[float, float, bool]]) -> tuple[np.ndarray, np.ndarray]:
    """Return (wall seconds, state) of the middle of each minute."""
    t = np.arange(30.0, 3600 * stretches[-1][1], 60.0)
    edges = np.array([s[:2] for s in stretches]) * 3600
    which = np.searchsorted(edges[:, 0], t, "right") - 1
    inside = (which >= 0) & (t < edges[np.maximum(which, 0), 1])
    return t[inside], np.array([s[2] for s in stretches], float)[which[inside]]


@pytest.mark.parametrize("order", [1, 2, 5, 84])
@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_published_algorithm(order: int, seed: int) -> None:
    """Integrals of stretches of whole minutes equal the authors' sums over the minutes."""
    stretches = random_stretches(np.random.default_rng(seed), 21 * 24)
    asked_h = np.arange(0.0, 28 * 24, 0.37)

    found = (
        Fremen(order)
        .learn({DOOR: evidence(stretches)}, UTC)
        .predict(DOOR, hours_ns(asked_h), hours_ns(np.full(len(asked_h), 21 * 24)))
    )

    expected = published(*minute_samples(stretches), order, asked_h * 3600)
    np.testing.assert_allclose(found.p_open, expected, atol=0.0005)


def test_visits_are_samples() -> None:
    """Of a log that holds only visits the figures are the authors' to the last digits."""
    rng = np.random.default_rng(5)
    seen_h = np.sort(rng.uniform(0, 14 * 24, 600))
    reads = np.sin(2 * np.pi * seen_h / 24) + rng.normal(0, 0.5, 600) > 0
    asked_h = np.arange(0.0, 400.0, 1.3)

    found = (
        Fremen(5)
        .learn({DOOR: evidence(visits=list(zip(seen_h, reads, strict=True)))}, UTC)
        .predict(DOOR, hours_ns(asked_h), hours_ns(np.full(len(asked_h), 500.0)))
    )

    expected = published(seen_h * 3600, reads.astype(float), 5, asked_h * 3600)
    np.testing.assert_allclose(found.p_open, expected, atol=1e-6)


@pytest.mark.parametrize("most_hours", [100, 100_000])
def test_what_comes_later_changes_nothing(most_hours: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forecasts with knowledge up to some hours are those of a log that ended then."""
    monkeypatch.setattr(fremen, "MOST_HOURS", most_hours)
    stretches = random_stretches(np.random.default_rng(9), 10 * 24)
    visits = [(float(h) + 0.25, bool(h % 3)) for h in range(0, 240, 7)]
    whole = Fremen(3).learn({DOOR: evidence(stretches, visits)}, UTC)
    known_h = np.array([30.0, 77.0, 200.0, 239.0])

    found = whole.predict(DOOR, hours_ns(known_h + 5), hours_ns(known_h)).p_open

    for p, known in zip(found, known_h, strict=True):
        cut = [(a, min(b, known), o) for a, b, o in stretches if a < known]
        ended = Fremen(3).learn({DOOR: evidence(cut, [v for v in visits if v[0] <= known])}, UTC)
        alone = ended.predict(DOOR, hours_ns([known + 5]), hours_ns([known]))
        assert pytest.approx(alone.p_open[0]) == p


def test_it_goes_by_the_buildings_clocks() -> None:
    """A door that opens at nine does so in summer too."""
    vienna = LocalClock("Europe/Vienna")
    wall_s = np.arange(60 * 48) * 1800.0 + 1_680_000_000 // 86_400 * 86_400  # from March 2023 on
    is_open = (wall_s % 86_400 >= 9 * 3600) & (wall_s % 86_400 < 17 * 3600)
    edges_h = (vienna.instants_ns(np.append(wall_s, wall_s[-1] + 1800)) - hours_ns(0)) / 3.6e12
    stretches = list(zip(edges_h[:-1], edges_h[1:], is_open, strict=True))
    asked_s = wall_s[-1] - 86_400 * 5 + np.array([10.0, 20.0]) * 3600

    found = (
        Fremen(5)
        .learn({DOOR: evidence(stretches)}, vienna)
        .predict(DOOR, vienna.instants_ns(asked_s), hours_ns(edges_h[[-1, -1]]))
    )

    steady = published(wall_s + 900, is_open.astype(float), 5, asked_s)
    np.testing.assert_allclose(found.p_open, steady, atol=0.03)


def test_there_are_84_components() -> None:
    """An order outside of 1..84 is refused."""
    with pytest.raises(ValueError, match=r"expected 1\.\.84, got 85"):
        Fremen(85)


@pytest.mark.slow
def test_three_years_take_no_minutes() -> None:
    """30,000 changes and a forecast for each of half a million minutes, known an hour ago each."""
    stretches = random_stretches(np.random.default_rng(2), 3 * 365 * 24, mean_h=0.87)
    asked_h = np.arange(2 * 365 * 24 * 60, 2 * 365 * 24 * 60 + 500_000) / 60

    learnt = Fremen().learn({DOOR: evidence(stretches)}, UTC)
    calls = calls_of(lambda: learnt.predict(DOOR, hours_ns(asked_h), hours_ns(asked_h - 1)))

    assert calls.total() < 30_000
