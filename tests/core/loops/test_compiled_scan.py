"""What the compiled scan finds is what numpy finds, on right records and on damaged ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.core.loops.random_records import are_same, by_loop, by_numpy, random_chunks

SEEDS = 2000


@pytest.fixture(autouse=True)
def _on(turn: Callable[[bool], None]) -> None:
    turn(True)


@pytest.mark.parametrize("first", range(0, SEEDS, SEEDS // 4))
def test_the_scan_finds_what_numpy_finds(first: int) -> None:
    """Offsets, chunks and events of random chunks, half of them damaged; or neither finds any."""
    cases = map(random_chunks, range(first, first + SEEDS // 4))

    different = [chunks for chunks in cases if not are_same(by_numpy(chunks), by_loop(chunks))]

    assert [] == different


@pytest.mark.parametrize("expected", [0, 1, 10**4])
def test_how_many_messages_are_expected_is_a_hint_alone(expected: int) -> None:
    """A message index that is damaged may say anything."""
    whole = next(c for c in map(random_chunks, range(100)) if by_numpy(c) and c.expected > 9)

    assert are_same(by_numpy(whole), by_loop(replace(whole, expected=expected)))


@pytest.mark.parametrize("first_event", [2**62, 2**63 - 1])
def test_event_numbers_beyond_any_log_are_left_to_numpy(first_event: int) -> None:
    """The loop's own would overflow."""
    whole = next(c for c in map(random_chunks, range(100)) if by_numpy(c))

    assert by_loop(replace(whole, first_event=first_event)) is None


@pytest.mark.parametrize(
    ("start", "end"),
    [(-1, 10), (0, 10**9), (5, 5), (9, 3), (2**63 - 1, -(2**63)), (-(2**63), 2**63 - 1)],
)
def test_chunks_outside_of_the_bytes_are_not_read(start: int, end: int) -> None:
    """Whoever asks is told of damage, whatever the places."""
    whole = next(c for c in map(random_chunks, range(100)) if by_numpy(c))

    assert by_loop(replace(whole, starts=np.array([start]), ends=np.array([end]))) is None
