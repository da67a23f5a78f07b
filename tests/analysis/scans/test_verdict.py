"""Which sums allow which word."""

from __future__ import annotations

from math import isnan

import numpy as np
import pytest

from semmap_log.analysis.scans.leaves import SHIFTS, leaves_of
from semmap_log.analysis.scans.verdict import Verdict, behind_m
from semmap_log.analysis.scans.visit import ScanModel
from semmap_log.analysis.scans.visit_sums import VisitSums
from semmap_log.core.model.doors import DoorState

MODEL = ScanModel()
HINGED = leaves_of("hinged")


def sums(
    *, open_by: float = 0, ajar_by: float = -20, looks: float = MODEL.most_looks,
    through: float = 4, stopped: float = 4, deep: float = 0, hidden: float = 0,
) -> VisitSums:  # fmt: skip
    """Return sums that speak for open against shut, by so much in the end."""
    table = np.zeros((len(SHIFTS), len(HINGED.clear)))
    table[:, HINGED.open] = open_by * 2
    table[:, HINGED.ajar] = ajar_by * 2
    visit = VisitSums.begun(0, HINGED)
    visit.table += table
    visit.looks = looks
    visit.through += through
    visit.stopped += stopped
    visit.deep += deep
    visit.hidden = hidden
    return visit


def verdict(visit: VisitSums, *, is_glass: bool = False) -> Verdict:
    return Verdict.of(visit, HINGED, MODEL, is_glass=is_glass)


@pytest.mark.parametrize("ratio", [-3.0, -1.0, 0.0, 2.0, 4.0])
def test_the_accuracy_is_the_likelihood_ratio_free_of_the_prior(ratio: float) -> None:
    """But for the share of visits that mean nothing at all."""
    expected = MODEL.lapse / 2 + (1 - MODEL.lapse) / (1 + np.exp(-ratio))

    assert verdict(sums(open_by=ratio)).p_open == pytest.approx(expected)


@pytest.mark.parametrize("ratio", [-1000.0, 1000.0])
def test_no_visit_is_surer_than_visits_are_sound(ratio: float) -> None:
    p_open = verdict(sums(open_by=ratio)).p_open

    assert max(p_open, 1 - p_open) == pytest.approx(1 - MODEL.lapse / 2)


@pytest.mark.parametrize(
    ("visit", "state", "why"),
    [
        (sums(open_by=5), DoorState.OPEN, ""),
        (sums(open_by=-5), DoorState.CLOSED, ""),
        (sums(open_by=1), DoorState.UNKNOWN, "open and shut are nearly as likely"),
        (sums(open_by=-1), DoorState.UNKNOWN, "open and shut are nearly as likely"),
        (sums(open_by=5, through=0.5), DoorState.UNKNOWN, "too few beams went through"),
        (sums(open_by=-5, stopped=0.5), DoorState.UNKNOWN, "too few beams ended on the line"),
        (
            sums(open_by=-5, deep=2),
            DoorState.UNKNOWN,
            "some beams ended on the line, others went through",
        ),
        (sums(open_by=5, hidden=100), DoorState.UNKNOWN, "something before it hides it"),
        (sums(open_by=-5, hidden=100), DoorState.UNKNOWN, "something before it hides it"),
        (sums(open_by=-5, hidden=40), DoorState.CLOSED, ""),
        (sums(open_by=5, ajar_by=5.5), DoorState.UNKNOWN, "it may be ajar"),
        (sums(open_by=-5, ajar_by=1), DoorState.CLOSED, ""),
        (sums(open_by=-5, ajar_by=5), DoorState.UNKNOWN, "it may be ajar"),
    ],
)
def test_words_and_why_there_is_none(visit: VisitSums, state: DoorState, why: str) -> None:
    found = verdict(visit)

    assert (state, why) == (found.state, found.why)


def test_beams_that_go_through_glass_do_not_open_it() -> None:
    assert DoorState.CLOSED is verdict(sums(open_by=-5, deep=2), is_glass=True).state


def test_the_opening_is_what_is_expected_of_it() -> None:
    assert verdict(sums(open_by=-30)).opening == pytest.approx(0, abs=0.02)
    assert verdict(sums(open_by=30)).opening == pytest.approx(1, abs=0.2)
    halves = sums(open_by=0)
    assert 0.4 < verdict(halves).opening < 0.6


def test_a_long_visit_is_worth_no_more_than_its_most() -> None:
    """Twice as much of the same changes little once much was seen."""
    some, more = sums(open_by=-1, looks=12), sums(open_by=-100, looks=1200)

    assert 1 - verdict(some).p_open < 1 - verdict(more).p_open
    joint = more.joint(HINGED, MODEL)
    assert (joint[0, 0] - joint[0, HINGED.open].max()) < 200 * MODEL.most_looks / 1200 + 3


def test_shifts_of_the_pose_are_one_for_the_whole_visit() -> None:
    """What is shut with one shift and open with another, half of the visit each, is neither."""
    visit = sums()
    visit.table[:] = -40
    visit.table[0, HINGED.clear == 0] = 0
    assert verdict(visit).p_open < 0.01
    visit.table[1, HINGED.clear == 1] = 0
    assert 0.2 < verdict(visit).p_open < 0.8


def test_walls_choose_among_the_shifts() -> None:
    visit = sums()
    visit.table[:] = -40
    visit.table[0, HINGED.clear == 0] = 0
    visit.table[5, HINGED.clear == 1] = 0
    assert verdict(visit).p_open < 0.1
    visit.walls[:] = -30
    visit.walls[5] = 0
    assert verdict(visit).p_open > 0.9


def test_where_beams_ended_on_average() -> None:
    visit = sums()
    assert isnan(behind_m(visit))
    visit.near, visit.behind = 4, -0.4
    assert behind_m(visit) == pytest.approx(-0.1)
