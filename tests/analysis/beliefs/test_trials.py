"""Samples of stretches, held against going through every second."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.analysis.beliefs.trials import StateIntervals


@st.composite
def stretches(draw: st.DrawFn) -> StateIntervals:
    edges = sorted(draw(st.sets(st.integers(0, 300), max_size=12)))
    edges = edges[: len(edges) // 2 * 2]
    start, end = np.array(edges[::2], np.int64), np.array(edges[1::2], np.int64)
    is_open = draw(st.lists(st.booleans(), min_size=len(start), max_size=len(start)))
    return StateIntervals(start, end, np.array(is_open, np.bool_))


def states(known: StateIntervals) -> dict[int, bool]:
    """Return the state at each whole time at which it is known."""
    return {
        time: is_open
        for start, end, is_open in zip(
            known.start_ns.tolist(), known.end_ns.tolist(), known.is_open.tolist(), strict=True
        )
        for time in range(start, end)
    }


@given(stretches(), st.integers(1, 40))
def test_samples_are_the_multiples_within(known: StateIntervals, step: int) -> None:
    """Each multiple of the step at which the state is known, with that state; half-open."""
    times, is_open = known.sampled(step)

    expected = {time: state for time, state in states(known).items() if time % step == 0}
    assert expected == dict(zip(times.tolist(), is_open.tolist(), strict=True))
    assert sorted(expected) == times.tolist()


@given(stretches())
def test_a_time_is_known_inside_of_a_stretch(known: StateIntervals) -> None:
    """From its start on, and no longer at its end."""
    times = np.arange(-1, 302)

    found = known.known_at(times)

    assert [time in states(known) for time in times.tolist()] == found.tolist()


@given(stretches(), st.integers(0, 300), st.integers(0, 300))
def test_a_range_cuts_stretches(known: StateIntervals, since: int, until: int) -> None:
    """What is left is what was known in it."""
    found = known.between(since, until)

    assert {
        time: state for time, state in states(known).items() if since <= time < until
    } == states(found)
