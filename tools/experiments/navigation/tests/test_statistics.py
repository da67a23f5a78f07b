"""Intervals: against tables that are printed, and against drawing many times."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navigation.tables.statistics import (
    Interval,
    mean_of,
    most_behind,
    ratio_of,
    share_of,
    t_quantile,
)


@pytest.mark.parametrize(
    ("freedom", "printed"),
    [(1, 12.7062), (2, 4.3027), (4, 2.7764), (9, 2.2622), (29, 2.0452), (120, 1.9799)],
)
def test_students_t_is_that_of_printed_tables(freedom: int, printed: float) -> None:
    """
    Two-sided, 95 %.
    """
    assert printed == pytest.approx(t_quantile(freedom), abs=6e-5)


def test_a_mean_by_hand() -> None:
    """
    1, 2, 3: standard error 1 / sqrt(3), two degrees of freedom. NaN is nobody's value.
    """
    mean = mean_of([1.0, 2.0, math.nan, 3.0])

    assert (mean.value, mean.half) == (2.0, pytest.approx(4.30265 / math.sqrt(3), rel=1e-4))
    assert (mean.low, mean.high) == (2.0 - mean.half, 2.0 + mean.half)


@pytest.mark.parametrize("values", [[], [5.0]], ids=["none", "one"])
def test_one_value_tells_nothing_of_others(values: list[float]) -> None:
    """
    And nothing is clear.
    """
    mean = mean_of(values)

    assert math.isnan(mean.half)
    assert not mean.is_clear
    assert values == [v for v in [mean.value] if not math.isnan(v)]


@pytest.mark.parametrize(
    ("interval", "is_clear"),
    [((1.0, 0.5), True), ((-1.0, 0.5), True), ((1.0, 1.0), False), ((0.0, 0.0), False)],
)
def test_clear_is_what_leaves_out_nothing(interval: tuple[float, float], *, is_clear: bool) -> None:
    """
    On either side of 0.
    """
    assert is_clear is Interval(*interval).is_clear


def test_a_share_is_of_all_goals_and_its_interval_of_seeds() -> None:
    """
    One run of 1,000 goals is one run: its goals weigh, but count as one draw.
    """
    share = share_of([1, 2, 300], [10, 10, 1000])

    assert share.value == 303 / 1020
    spread = [(1 - 10 * share.value), (2 - 10 * share.value), (300 - 1000 * share.value)]
    error = math.sqrt(sum(s * s for s in spread) * 3 / 2) / 1020
    assert share.half == pytest.approx(4.30265 * error, rel=1e-4)
    assert math.isnan(share_of([1], [10]).half)
    assert math.isnan(share_of([], []).value)


def test_intervals_of_shares_hold_as_often_as_they_say() -> None:
    """
    Of a thousand experiments of 30 runs with lives of their own, 93 to 97 in a hundred.
    """
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(1000):
        whole = rng.integers(100, 400, 30)
        part = rng.binomial(whole, rng.beta(2, 18, 30))
        share = share_of(part.tolist(), whole.tolist())
        held += share.low <= 0.1 <= share.high

    assert 925 <= held <= 975


def test_a_ratio_of_pairs_is_narrower_than_of_strangers() -> None:
    """
    Where good and bad seeds are the same for both.
    """
    one = [(k, 100) for k in (10, 20, 30, 40, 50)]
    other = [(k // 5, 100) for k in (10, 20, 30, 40, 50)]

    paired, strangers = (ratio_of(one, other, paired=pairs) for pairs in (True, False))

    assert paired.value == paired.low == paired.high == pytest.approx(5)
    assert strangers.value == pytest.approx(5)
    assert strangers.low < 4
    assert strangers.high > 6


def test_none_seen_is_not_none_there() -> None:
    """
    The rule of three: none of 600 may be one in 200.
    """
    share = share_of([0, 0], [200, 400])

    assert (share.value, share.high) == (0, pytest.approx(3 / 600, rel=0.02))


@pytest.mark.parametrize(("count", "printed"), [(0, 2.996), (1, 4.744), (5, 10.513), (9, 15.705)])
def test_what_a_count_may_stand_for_is_that_of_printed_tables(count: int, printed: float) -> None:
    """
    Poisson's upper limit, one-sided, 95 %.
    """
    assert printed == pytest.approx(most_behind(count), rel=0.01)


def test_a_ratio_to_one_case_is_no_more_certain_than_that_case() -> None:
    """
    One in a thousand may be five; a hundred in 100,000 are not 500.
    """
    one = [(100, 1000)] * 3

    few = ratio_of(one, [(1, 1000), (0, 1000), (0, 1000)], paired=True)
    many = ratio_of(one, [(100, 100_000)] * 3, paired=True)

    assert few.low == pytest.approx(0.1 / (4.744 / 3000), rel=0.01)
    assert many.low == pytest.approx(100)


def test_a_ratio_to_nothing_has_no_end() -> None:
    """
    But a lower one, as far as nothing may be something; 0 of both says nothing.
    """
    some, none = [(2, 10), (2, 10)], [(0, 30), (0, 30)]
    ratio = ratio_of(some, none, paired=True)

    assert (ratio.value, ratio.high) == (math.inf, math.inf)
    assert ratio.low == pytest.approx(0.2 / (3 / 60), rel=0.02)
    assert math.isnan(ratio_of(none, none, paired=True).low)
    assert ratio_of(none, some, paired=True).value == 0
    assert math.isnan(ratio_of(some[:1], some[:1], paired=True).low)
