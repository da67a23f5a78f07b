"""Registers over time, held against a loop over all that was written."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.folds import door_changes
from semmap_log.core.folds.door_changes import LastWritten

NOTHING = -9
stamps = st.tuples(st.integers(0, 4), st.integers(0, 5), st.integers(0, 30))
"""Key, happened, number: few, so that many are equal."""


def as_columns(rows: Sequence[tuple[int, ...]], width: int) -> list[np.ndarray]:
    return list(np.array(rows, np.int64).reshape(-1, width).T)


def held(writes: Sequence[tuple[tuple[int, int, int], int]], asked: tuple[int, int, int]) -> int:
    """Return what a key held at a stamp."""
    key, *stamp = asked
    before = [(at, value) for (k, *at), value in writes if k == key and at <= stamp]
    return max(before)[1] if before else NOTHING


@pytest.mark.parametrize("most", [2**20, 2])
@settings(deadline=None)
@given(st.dictionaries(stamps, st.integers(0, 3)), st.lists(stamps, max_size=20))
def test_a_key_holds_what_was_written_last(
    most: int, written: dict[tuple[int, int, int], int], asked: list[tuple[int, int, int]]
) -> None:
    """By stamp, not by the order of writing."""
    rows = [(*stamp, value) for stamp, value in written.items()]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(door_changes, "MAX_TABLE", most)
        found = LastWritten(*as_columns(rows, 4), nothing=NOTHING)

    held_then = found.at(*as_columns(asked, 3))

    assert [held(list(written.items()), each) for each in asked] == held_then.tolist()
    assert all((key in found) == any(k == key for k, _, _ in written) for key in range(6))
