"""The different numbers of a column."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.core.batches.event_batch import distinct


@given(st.lists(st.integers(0, 40)), st.sampled_from(["u1", "u2", "u4", "i8"]))
def test_they_are_those_that_numpy_finds(numbers: list[int], dtype: str) -> None:
    """As many, of the same type, in the same order; of no numbers none."""
    column = np.array(numbers, dtype)

    found = distinct(column)

    expected = np.unique(column)
    assert expected.dtype == found.dtype
    assert expected.tolist() == found.tolist()
    assert numbers == column.tolist()
