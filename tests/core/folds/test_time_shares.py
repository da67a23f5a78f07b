"""Shares of slots of time, against a count nanosecond by nanosecond."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.core.folds.timeline import Timeline, time_shares
from semmap_log.core.model.doors import DoorId, DoorState

lengths = st.lists(
    st.tuples(st.integers(0, 5), st.sampled_from(list(DoorState))), min_size=0, max_size=8
)


def timeline_of(start: int, parts: list[tuple[int, DoorState]]) -> Timeline:
    """Return intervals that follow each other, each of its length and state."""
    ends = start + np.cumsum([0, *(length for length, _ in parts)])
    states = np.array([state for _, state in parts], np.uint8)
    numbers = np.arange(len(parts))
    return Timeline(DoorId(1), ends[:-1], ends[1:], states, numbers, numbers)


@given(st.integers(0, 10), lengths, st.lists(st.integers(0, 40), min_size=2, unique=True))
def test_each_slot_counts_each_nanosecond_once(
    start: int, parts: list[tuple[int, DoorState]], cuts: list[int]
) -> None:
    """Slots of any length, before, across and behind what is known of the door."""
    edges = np.array(sorted(cuts))
    told = [state for length, state in parts for _ in range(length)]

    found = time_shares(timeline_of(start, parts), edges)

    for slot, (first, last) in enumerate(pairwise(edges.tolist())):
        states = [told[ns - start] for ns in range(first, last) if 0 <= ns - start < len(told)]
        opened, closed = states.count(DoorState.OPEN), states.count(DoorState.CLOSED)
        assert len(states) / (last - first) == found.there[slot]
        assert (opened + closed) / (last - first) == found.known[slot]
        if opened + closed:
            assert opened / (opened + closed) == found.opened[slot]
        else:
            assert np.isnan(found.opened[slot])
