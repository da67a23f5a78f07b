"""Each compiled loop does what numpy does, and refuses what lies outside of what it was given."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from semmap_log.core.batches.columnar_events import places_by_kind
from semmap_log.core.loops import compiled
from semmap_log.core.loops.compiled_loops import CompiledLoops
from semmap_log.store.record_scan import gather_after

SEEDS = range(200)


@pytest.fixture
def loops(turn: Callable[[bool], None]) -> CompiledLoops:
    turn(True)
    found = compiled()
    assert found is not None
    return found


def test_places_are_sorted_by_kind(turn: Callable[[bool], None]) -> None:
    """The kinds that are there, ascending, each with its places."""
    drawn = [np.random.default_rng(seed).integers(0, 2 + seed, 50 + seed) for seed in SEEDS]
    kinds = [one.astype(np.uint8) for one in (*drawn, np.empty(0))]
    turn(False)
    expected = [_listed(places_by_kind(one)) for one in kinds]
    turn(True)

    assert expected == [_listed(places_by_kind(one)) for one in kinds]


def _listed(places: dict[int, np.ndarray]) -> list[tuple[int, list[int]]]:
    return [(kind, mine.tolist()) for kind, mine in places.items()]


def test_structs_are_gathered(turn: Callable[[bool], None]) -> None:
    """Whatever their size, from wherever they lie; none from outside of the bytes."""
    draw = np.random.default_rng(1)
    records, dtype = draw.bytes(500), np.dtype([("id", "<u4"), ("x", "<f8")])
    offsets, places = draw.integers(0, 480, 20), draw.integers(0, 20, 40)
    turn(False)
    expected = gather_after(records, offsets, 8, places, dtype)
    turn(True)

    assert expected.tobytes() == gather_after(records, offsets, 8, places, dtype).tobytes()
    with pytest.raises(IndexError):
        gather_after(records, np.array([490]), 8, np.array([0]), dtype)


@pytest.mark.parametrize(
    ("offsets", "places"), [([-1], [0]), ([489], [0]), ([2**63 - 1], [0]), ([0], [1]), ([0], [-1])]
)
def test_nothing_is_copied_from_outside(
    loops: CompiledLoops, offsets: list[int], places: list[int]
) -> None:
    """A struct that lies partly outside, and a record that is not there."""
    into = np.zeros(12, np.uint8)

    assert not loops.gather(bytes(500), np.array(offsets), 0, np.array(places), 12, into)


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ([3, 4, 5, 9, 10], True),
        ([3, 4, 5, 9], False),
        ([3, 4, 5, 9, 10, 11], False),
        ([3, 4, 6, 9, 10], False),
        ([], False),
    ],
)
def test_numbers_are_those_of_spans(
    loops: CompiledLoops, numbers: list[int], expected: bool
) -> None:
    """Each of them, in order, and no more."""
    firsts, ends = np.array([3, 7, 9]), np.array([6, 7, 11])

    assert expected is loops.are_numbered(np.array(numbers, np.int64), firsts, ends)


def test_spans_of_any_numbers_end(loops: CompiledLoops) -> None:
    """The end of one before its beginning, or as far from it as can be."""
    firsts, ends = np.array([2**63 - 1, -(2**63)]), np.array([-(2**63), 2**63 - 1])

    assert not loops.are_numbered(np.arange(3), firsts, ends)


def test_each_row_keeps_its_greatest(loops: CompiledLoops) -> None:
    """As `np.maximum.at`; -1 is the last row."""
    for seed in SEEDS:
        draw = np.random.default_rng(seed)
        kept, rows = draw.integers(-1, 9, 7), draw.integers(-1, 7, 30)
        values, expected = draw.integers(-3, 30, 30), kept.copy()
        np.maximum.at(expected, rows, values)

        loops.keep_greatest(kept, rows, values)

        assert expected.tolist() == kept.tolist()


@pytest.mark.parametrize("row", [7, -8, 2**63 - 1, -(2**63)])
def test_rows_that_are_not_there_are_refused(loops: CompiledLoops, row: int) -> None:
    """And what a loop works with is as it was."""
    scratch, one = np.full(7, -1), np.array([1])

    with pytest.raises(IndexError):
        loops.keep_greatest(np.zeros(7, np.int64), np.array([row]), one)
    with pytest.raises(IndexError):
        loops.settle(
            np.arange(2), np.array([0, row]), np.arange(2), np.arange(2),
            np.full(7, -1), np.full(7, -1), scratch, np.zeros(2, np.int64),
        )  # fmt: skip
    assert [-1] * 7 == scratch.tolist()


def test_columns_of_different_lengths_are_refused(loops: CompiledLoops) -> None:
    """Of those that must be as long as each other."""
    one, two = np.zeros(1, np.int64), np.zeros(2, np.int64)

    with pytest.raises(ValueError, match="different lengths"):
        loops.keep_greatest(one, one, two)
    with pytest.raises(ValueError, match="different lengths"):
        loops.are_numbered(one, one, two)
    with pytest.raises(ValueError, match="different lengths"):
        loops.sort_places(np.zeros(2, np.uint8), one, np.zeros(256, np.int64))
    with pytest.raises(ValueError, match="no room"):
        loops.settle(two, two, two, two, two, two, two, one)
    with pytest.raises(ValueError, match="no room"):
        loops.gather(bytes(50), one, 0, one, 4, np.zeros(3, np.uint8))
