"""Which points of a belief's curve are drawn."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.core.model.doors import DoorId
from semmap_log.views.rerun.belief_curves import (
    EVERY_NS,
    MOST_STEPS,
    TOLERANCE,
    curve,
    telling,
    times_of_curve,
)

DAY_NS = 86_400 * 10**9
NOTHING = DoorEvidence.nothing(DoorId(1), 2**62)


@given(st.lists(st.tuples(st.integers(1, 10**12), st.floats(0, 1)), min_size=1, max_size=60))
def test_no_point_that_is_left_out_lies_off_the_line(steps: list[tuple[int, float]]) -> None:
    """Whatever the curve: both ends are kept, and the line misses no point by more than .01."""
    times_ns = np.cumsum([length for length, _ in steps])
    values = np.array([value for _, value in steps])

    kept = telling(times_ns, values)

    drawn = np.interp(times_ns, times_ns[kept], values[kept])
    assert (0, len(steps) - 1) == (kept[0], kept[-1])
    assert np.abs(drawn - values).max() <= TOLERANCE + 1e-6


def test_a_straight_line_needs_two_points() -> None:
    """However long it is."""
    times_ns = np.arange(1000) * EVERY_NS

    kept = telling(times_ns, np.linspace(0.2, 0.8, 1000))

    assert [0, 999] == kept.tolist()


def test_a_jump_keeps_its_two_ends() -> None:
    """The line goes straight up, not from ten minutes before."""
    times_ns = np.array([0, 10, 19, 20, 30]) * EVERY_NS

    kept = telling(times_ns, np.array([0.2, 0.2, 0.2, 0.9, 0.9]))

    assert [0, 2, 3, 4] == kept.tolist()


def test_a_jump_after_years_is_still_a_jump() -> None:
    """Its two ends are a nanosecond apart, which floats of seconds cannot tell by then."""
    times_ns = np.array([0, 1095 * DAY_NS, 1095 * DAY_NS + 1, 1096 * DAY_NS])

    kept = telling(times_ns, np.array([0.2, 0.2, 0.9, 0.9]))

    assert [0, 1, 2, 3] == kept.tolist()


def test_what_is_not_known_is_a_gap() -> None:
    """Nothing before it is known, NaN between known stretches."""
    times_ns = np.arange(6) * EVERY_NS
    known = np.array([False, True, True, False, False, True])

    points = curve(times_ns, np.full(6, 0.5), known)

    assert [1, 2, 3, 5] == (points["folds_ns"] // EVERY_NS).tolist()
    np.testing.assert_array_equal([0.5, 0.5, np.nan, 0.5], points["p_open"])


def test_nothing_known_draws_nothing() -> None:
    """Not even a gap."""
    assert 0 == len(curve(np.arange(5), np.full(5, 0.5), np.zeros(5, bool)))


def test_times_are_those_of_the_evidence_and_ten_minutes() -> None:
    """Just before and at a look, and both ends; nothing outside."""
    looks = np.array([5, 3 * EVERY_NS + 7, 20 * EVERY_NS])
    seen = DoorEvidence(
        DoorId(1), 2**62, *(np.empty(0, kind) for kind in (np.int64, np.int64, bool)), looks,
        *(np.ones(3),) * 3, *(np.ones(3, bool),) * 2, np.arange(3),
    )  # fmt: skip

    times_ns = times_of_curve(seen, 100, 4 * EVERY_NS)

    assert times_ns.tolist() == sorted([
        *range(100, 4 * EVERY_NS, EVERY_NS), 4 * EVERY_NS, 3 * EVERY_NS + 6, 3 * EVERY_NS + 7,
    ])  # fmt: skip


def test_a_long_recording_takes_longer_steps() -> None:
    """Three years of nothing are about 4096 points."""
    times_ns = times_of_curve(NOTHING, 0, 1095 * DAY_NS)

    assert MOST_STEPS <= len(times_ns) <= MOST_STEPS + 2


def test_a_recording_of_a_moment_is_a_point() -> None:
    """Its first time is its last."""
    assert [7] == times_of_curve(NOTHING, 7, 7).tolist()
