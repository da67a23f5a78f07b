"""A door's evidence as looks: each half hour of a stretch, and sightings by the five minutes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from semmap_log.analysis.probabilities.chain.looks import (
    CERTAIN_LLR,
    Looks,
    held_at,
    is_certain,
    looks,
)
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import evidence, hours_ns

UTC = LocalClock("UTC")


def said(found: Looks) -> list[tuple[float, float]]:
    """Return (hours since that Monday, log-likelihood ratio) of each look."""
    hours = (found.times_ns - hours_ns(0)) / 3.6e12
    return list(zip(hours.tolist(), found.llr.tolist(), strict=True))


SURE = CERTAIN_LLR


@pytest.mark.parametrize(
    ("stretches", "until_h", "expected"),
    [
        (
            [(1 / 6, 5 / 3, True)],
            2,
            [(1 / 6, 0.0), (0.5, SURE), (1.0, SURE), (1.5, SURE), (5 / 3, SURE)],
        ),
        (
            [(0.0, 0.6, False), (0.6, 0.8, True), (0.8, 2.0, False)],
            1.75,
            [(0.0, 0.0), (0.0, -SURE), (0.5, -SURE), (1.0, -SURE), (1.5, -SURE)],
        ),
    ],
    ids=["from 0:10 to 1:40", "open for minutes between half hours"],
)
def test_a_stretch_is_a_look_each_half_hour_and_one_at_its_end(
    stretches: list[tuple[float, float, bool]], until_h: float, expected: list[tuple[float, float]]
) -> None:
    """Before all one that saw nothing; a change that was watched is no look of its own."""
    found = looks(evidence(stretches), UTC, int(hours_ns(until_h)))

    assert [llr for _, llr in expected] == [llr for _, llr in said(found)]
    assert [hour for hour, _ in expected] == pytest.approx([hour for hour, _ in said(found)])
    assert [llr != 0 for _, llr in expected] == is_certain(found.llr).tolist()


def test_a_certain_sighting_is_a_look_of_its_own() -> None:
    """They stand by what they tell, clipped on both sides; none proves more than a certain one."""
    told = evidence(visits=[(0.25, True), (0.75, False), (0.76, True), (0.77, True)])
    told = replace(told, llr=np.array([2.0, -1e6, 1e6, 1.0]))

    found = looks(told, UTC, int(hours_ns(0.9)))

    sure = CERTAIN_LLR
    assert [(0.25, 0.0), (0.25, 2.0), (0.75, -sure), (0.76, sure), (0.77, 1.0)] == said(found)
    assert [0, 1, 2, 3, 4] == found.sightings.tolist()


def test_sightings_of_five_minutes_are_one_look() -> None:
    """At the last of them, of what they add up to; however many agree, there is still a doubt."""
    told = evidence(visits=[(0.01, True), (0.02, True), (0.08, False), (0.09, True)])
    told = replace(told, llr=np.array([2.0, 1.5, -1.0, 3.0]))
    many = evidence(visits=[(i / 1e5, True) for i in range(1000)])

    found, of_many = looks(told, UTC, int(hours_ns(1))), looks(many, UTC, int(hours_ns(1)))

    assert [(0.01, 0.0), (0.08, 2.5), (0.09, 3.0)] == said(found)
    assert [0, 3, 4] == found.sightings.tolist()
    assert 2 == len(of_many)
    assert not is_certain(of_many.llr).any()
    assert CERTAIN_LLR == pytest.approx(of_many.llr[1])


def test_the_last_moment_is_included_and_nothing_later() -> None:
    """A sighting at that moment counts, one a nanosecond behind it does not."""
    told = evidence(visits=[(1.0, True), (1.25, False), (1.5, True)])
    until_ns = int(hours_ns(1.5))

    whole, inner = looks(told, UTC, until_ns), looks(told, UTC, until_ns - 1)

    assert [0.0, np.log(9), -np.log(9), np.log(9)] == pytest.approx(whole.llr.tolist())
    assert whole.llr[:3].tolist() == inner.llr.tolist()


def test_half_hours_without_a_look_are_the_buildings() -> None:
    """In Eucla, 8:45 ahead of UTC, hours begin at a quarter past; they are there if asked for."""
    eucla = LocalClock("Australia/Eucla")
    told = evidence(visits=[(0.3, True)])

    found = looks(told, eucla, int(hours_ns(1.5)), blind_from_ns=0)

    assert [0.25, 0.3, 0.3, 0.75, 1.25] == pytest.approx([h for h, _ in said(found)])


def test_the_last_of_them() -> None:
    """From a time on, that one included."""
    told = evidence(visits=[(0.4, True), (0.9, True)])

    def since(from_ns: int) -> list[float]:
        return [h for h, _ in said(looks(told, UTC, int(hours_ns(1)), blind_from_ns=from_ns))]

    assert [0.4, 0.4, 0.5, 0.9, 1.0] == since(int(hours_ns(0.4)))
    assert [0.5, 0.9, 1.0] == since(int(hours_ns(0.4)) + 1)


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
    """But for one that holds on: it is known at the last moment of the evidence, too."""
    told = evidence([(1.0, 2.0, True), (2.0, 3.0, False), (4.0, 9.0, True)])

    held, is_open = held_at(told.up_to(int(hours_ns(4.5))), hours_ns([hour]))

    assert expected == (bool(held[0]), bool(is_open[0]))


def test_without_stretches_nothing_is_held() -> None:
    """Of a door that was only visited no state is known for sure at any time."""
    held, is_open = held_at(evidence(visits=[(1.0, True)]), hours_ns([0.5, 1.0, 1.5]))

    assert not held.any()
    assert not is_open.any()
