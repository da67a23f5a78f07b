"""Beliefs in words."""

from __future__ import annotations

import pytest

from semmap_log.views.belief_words import moment_text, with_interval


@pytest.mark.parametrize(
    ("expected", "numbers"),
    [
        (".83 (.71-.92)", (0.83, 0.71, 0.92)),
        ("<.01 (0-.48)", (0.004, 0.001, 0.48)),
        (">.99 (.95-1)", (0.999, 0.95, 0.999)),
        ("<.01", (0.001, 0.001, 0.001)),
    ],
)
def test_a_probability_stands_before_its_interval(
    expected: str, numbers: tuple[float, float, float]
) -> None:
    """No probability is 0 or 1, but an interval may reach them."""
    assert expected == with_interval(*numbers)


def test_a_moment_is_told_to_the_second() -> None:
    """As the building's clocks show it."""
    assert "2026-03-08 22:30:41" == moment_text(1_773_005_441_049_000_000, "Europe/Vienna")
