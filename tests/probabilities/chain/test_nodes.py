"""A door's evidence as looks: each half hour of a stretch, each sighting, and where hours begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from semmap_log.probabilities.chain.nodes import CERTAIN_LLR, Looks, held_at, looks
from semmap_log.probabilities.local_clock import LocalClock
from tests.probabilities.known import evidence, hours_ns

UTC = LocalClock("UTC")


def said(found: Looks) -> list[tuple[float, float]]:
    """Return (hours since that Monday, log-likelihood ratio) of each look."""
    hours = (found.times_ns - hours_ns(0)) / 3.6e12
    return list(zip(hours.tolist(), found.llr.tolist(), strict=True))


def test_a_stretch_is_a_look_each_half_hour_and_one_at_its_end() -> None:
    """
    Open from 0:10 to 1:40, then nothing: certain looks in it, one when it ends, none behind it.
    """
    told = evidence([(1 / 6, 5 / 3, True)])

    found = looks(told, UTC, int(hours_ns(0)), int(hours_ns(2)))

    sure = CERTAIN_LLR
    expected = [(0.0, 0.0), (0.5, sure), (1.0, sure), (1.5, sure), (5 / 3, sure), (2.0, 0.0)]
    assert [llr for _, llr in expected] == [llr for _, llr in said(found)]
    assert [hour for hour, _ in expected] == pytest.approx([hour for hour, _ in said(found)])


def test_a_change_that_was_watched_is_no_look_of_its_own() -> None:
    """
    Where one stretch begins as another ends, only the half hours look: openings of minutes between
    them are none, as they are for a patrol.
    """
    told = evidence([(0.0, 0.6, False), (0.6, 0.8, True), (0.8, 2.0, False)])

    found = looks(told, UTC, int(hours_ns(0)), int(hours_ns(1.75)))

    expected = [(0.0, -CERTAIN_LLR), (0.5, -CERTAIN_LLR), (1.0, -CERTAIN_LLR), (1.5, -CERTAIN_LLR)]
    assert expected == said(found)


def test_sightings_count_when_they_were_and_prove_no_more_than_a_certain_one() -> None:
    """
    They stand between the half hours by what they tell, clipped on both sides.
    """
    told = evidence(visits=[(0.25, True), (0.75, False), (0.8, True)])
    told = replace(told, llr=np.array([2.0, -1e6, 1e6]))

    found = looks(told, UTC, int(hours_ns(0)), int(hours_ns(0.9)))

    expected = [(0.0, 0.0), (0.25, 2.0), (0.5, 0.0), (0.75, -CERTAIN_LLR), (0.8, CERTAIN_LLR)]
    assert expected == said(found)


def test_both_ends_are_included_and_nothing_else() -> None:
    """
    A sighting at the first or the last moment counts, one a nanosecond beside does not.
    """
    told = evidence(visits=[(1.0, True), (1.25, False), (1.5, True)])
    from_ns, until_ns = (int(ns) for ns in hours_ns([1.0, 1.5]))

    whole = looks(told, UTC, from_ns, until_ns)
    inner = looks(told, UTC, from_ns + 1, until_ns - 1)

    assert [0.0, np.log(9), -np.log(9), 0.0, np.log(9)] == pytest.approx(whole.llr.tolist())
    assert [(1.25, pytest.approx(-np.log(9)))] == said(inner)


def test_hours_are_the_buildings() -> None:
    """
    In Eucla, 8:45 ahead of UTC, hours begin at a quarter past; looks and their bins follow.
    """
    eucla = LocalClock("Australia/Eucla")

    found = looks(evidence(), eucla, int(hours_ns(0)), int(hours_ns(1.5)))

    assert [0.25, 0.75, 1.25] == pytest.approx([hour for hour, _ in said(found)])
    assert [9, 9, 10] == found.hour.tolist()


def test_as_nodes_they_are_one_sequence() -> None:
    """
    Gaps are in seconds, the first is none, and only there a sequence begins.
    """
    found = looks(evidence(visits=[(0.4, True)]), UTC, int(hours_ns(0)), int(hours_ns(1))).nodes()

    assert [0.0, 1440.0, 360.0, 1800.0] == pytest.approx(found.gap_s.tolist())
    assert [True, False, False, False] == found.begins.tolist()
    assert [0, 0, 0, 1] == found.bin.tolist()


@pytest.mark.parametrize(
    ("hour", "expected"),
    [
        (0.99, (False, False)), (1.0, (True, True)), (1.99, (True, True)), (2.0, (True, False)),
        (3.0, (False, False)), (4.0, (True, True)), (4.5, (True, True)), (4.6, (False, False)),
    ],
)  # fmt: skip
def test_a_stretch_holds_from_its_start_to_before_its_end(
    hour: float, expected: tuple[bool, bool]
) -> None:
    """
    But for one that holds on: it is known at the last moment of the evidence, too.
    """
    told = evidence([(1.0, 2.0, True), (2.0, 3.0, False), (4.0, 9.0, True)])

    held, is_open = held_at(told.up_to(int(hours_ns(4.5))), hours_ns([hour]))

    assert expected == (bool(held[0]), bool(is_open[0]))


def test_without_stretches_nothing_is_held() -> None:
    """
    Of a door that was only visited no state is known for sure at any time.
    """
    held, is_open = held_at(evidence(visits=[(1.0, True)]), hours_ns([0.5, 1.0, 1.5]))

    assert not held.any()
    assert not is_open.any()
