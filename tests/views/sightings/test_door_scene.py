"""What is to be seen of a sighting: where beams ended, which visits are shown, in what words."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.analysis.scans.visit import KeptVisit
from semmap_log.core.model.doors import DoorState
from semmap_log.views.sightings.visit_words import (
    Fate,
    door_scene,
    grounds,
    in_door_frame,
    on_the_map,
    verdict,
    when,
    worth_a_look,
)
from tests.analysis.scans.some_scans import LINE, SHUT, seen_visit, some_scan
from tests.analysis.scans.some_visits import some_visit

BAR = (2.3, 0.3, 2.7, 0.3)
"""Somebody before the door."""


def _kept(leaf: tuple[float, ...] | None) -> KeptVisit:
    visit, scans = seen_visit(leaf=leaf)
    return KeptVisit(visit, 0, LINE, tuple(scans))


@pytest.mark.parametrize(
    ("leaf", "fate"), [(SHUT, Fate.stopped), (None, Fate.through), (BAR, Fate.short)]
)
def test_beams_end_on_the_line_behind_it_or_before(
    leaf: tuple[float, ...] | None, fate: Fate
) -> None:
    """And most do what the leaf makes them do."""
    beams = door_scene(_kept(leaf)).beams

    toward = beams.toward()
    assert len(toward.fates) > 20
    assert np.mean(toward.fates == fate) > (0.25 if fate is Fate.short else 0.95)
    assert len(beams.of(Fate.aside).fates) > len(toward.fates)


def test_ends_are_where_the_beams_met_something() -> None:
    """In the frame of the door: a shut leaf lies on the line, the far wall 3 m behind it."""
    shut, wide = (door_scene(_kept(leaf)).beams for leaf in (SHUT, None))

    np.testing.assert_allclose(shut.of(Fate.stopped).ends[:, 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(wide.of(Fate.through).ends[:, 1].max(), 3.0, atol=1e-9)


def test_the_leaf_and_the_way_of_the_laser_are_in_the_frame_of_the_door() -> None:
    """The robot goes by a metre before the door, on its right."""
    scene = door_scene(_kept(SHUT))

    np.testing.assert_allclose(scene.leaves, [[0, 0], [1, 0]], atol=1e-9)
    np.testing.assert_allclose(scene.track[:, 1], -1.0)
    assert scene.width == 1.0


def test_a_beam_that_is_lost_is_drawn_on_the_line_and_one_not_measured_nowhere() -> None:
    """Nobody knows where it went."""
    visit, (scan, *_) = seen_visit(leaf=None)
    toward = np.flatnonzero(np.abs(scan.bearings - math.atan2(1.0, 1.5)) < 0.1)
    ranges = scan.ranges.copy()
    ranges[toward[:2]], ranges[toward[2]], ranges[0] = math.inf, math.nan, math.inf
    seen = door_scene(KeptVisit(visit, 0, LINE, (replace(scan, ranges=ranges),))).beams

    assert len(seen.fates) == len(ranges) - 1
    np.testing.assert_allclose(seen.of(Fate.lost).ends[:, 1], 0.0, atol=1e-9)
    assert len(seen.of(Fate.lost).ends) == 2
    assert np.isnan(seen.of(Fate.aside).ends).any()


def test_a_visit_without_scans_has_nothing_to_draw() -> None:
    """Where the robot drove through, say."""
    scene = door_scene(KeptVisit(some_visit(passed=True), 0, LINE, ()))

    assert (len(scene.beams.ends), len(scene.track), len(scene.leaves)) == (0, 0, 0)


@given(st.tuples(*[st.floats(-50, 50)] * 3), st.lists(st.tuples(*[st.floats(-9, 9)] * 2)))
def test_the_door_frame_and_back(
    place: tuple[float, float, float], points: list[tuple[float, float]]
) -> None:
    """Every point of the map is one of the door's frame, at the same distance from its start."""
    line, where = (*place, 0.9), np.array(points).reshape(-1, 2)

    inside = in_door_frame(where, line)

    np.testing.assert_allclose(on_the_map(inside, line), where, atol=1e-9)
    np.testing.assert_allclose(
        np.hypot(*inside.T), np.hypot(*(where - np.array(place[:2])).T), atol=1e-9
    )


def test_half_of_what_is_shown_is_doubtful() -> None:
    """The rest is spread over all others; passages have no scans."""
    visits = [some_visit(at_s=n, accuracy=0.99) for n in range(100)]
    visits[7] = replace(visits[7], state=DoorState.UNKNOWN)
    visits[50] = replace(visits[50], accuracy=0.81)
    visits[99] = replace(visits[99], passed=True)

    chosen = worth_a_look(visits, 4)

    assert {7, 50} <= set(chosen)
    assert chosen == sorted(chosen)
    assert (len(chosen), chosen[0], chosen[-1]) == (4, 0, 98)
    assert worth_a_look(visits[98:], 4) == [0]


@given(st.integers(0, 30), st.integers(1, 30))
def test_no_more_are_shown_than_there_are(visits: int, most: int) -> None:
    chosen = worth_a_look([some_visit(at_s=n) for n in range(visits)], most)

    assert len(chosen) == len(set(chosen)) == min(visits, most)


def test_a_visit_in_words() -> None:
    """What is said, on what grounds, when."""
    visit = some_visit(accuracy=0.987, looks=12.3, through=0.0, stopped=5.25, behind_m=0.034)
    shut = replace(visit, state=DoorState.CLOSED)

    assert verdict(visit) == "OPEN .99"
    assert verdict(replace(visit, accuracy=0.9962)) == "OPEN .996"
    assert verdict(replace(visit, accuracy=1.0)) == "OPEN 1.000"
    assert verdict(replace(visit, state=DoorState.UNKNOWN, why="ajar")) == "UNKNOWN: ajar"
    assert verdict(replace(visit, passed=True)) == "OPEN, driven through"
    assert grounds(shut) == "12 looks: 0.0 through, 5.2 on the line, +0.03 m"
    assert grounds(visit) == grounds(replace(shut, behind_m=math.nan))
    assert grounds(visit).endswith("on the line")
    assert when(visit, "UTC") == "2025-12-29 09:20:04"


def test_scans_of_thousands_of_beams_are_told_at_once() -> None:
    """Nothing is lost of a large one."""
    visit, _ = seen_visit()
    scan = some_scan(visit.first_ns, 2.5, 0.0, leaf=SHUT, beams=200_000)

    beams = door_scene(KeptVisit(visit, 0, LINE, (scan,))).beams

    assert len(beams.fates) == 200_000
    assert np.mean(beams.toward().fates == Fate.stopped) == 1.0


def test_what_is_nearly_sure_does_not_look_sure() -> None:
    """However many digits that takes."""
    said = [verdict(replace(some_visit(), state=DoorState.OPEN, accuracy=accuracy))
            for accuracy in (0.98, 0.996, 0.9996)]  # fmt: skip

    assert ["OPEN .98", "OPEN .996", "OPEN .9996"] == said
