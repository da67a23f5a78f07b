"""Scans and doors that make no sense: no error, no warning, no claim; drops are counted."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from math import inf, nan, pi

import numpy as np
import pytest

from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.visit import DoorPlaces, PlacedScan, Visit
from tests.analysis.scans.scenes import (
    LINE,
    WIDTH,
    joined,
    leaf,
    past,
    places,
    replaced,
    seen,
    the_visit,
)

SCANS = past(leaf(90)).scans()
SHUT = past(leaf(0)).scans()
BEAMS = len(SCANS[0].ranges)


@pytest.fixture(autouse=True)
def no_warnings() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def nothing_said(scans: Sequence[PlacedScan], doors: DoorPlaces | None = None) -> bool:
    return not any(visit.state for visit in seen(scans, doors or places()))


@pytest.mark.parametrize("value", [nan, inf, -inf, 0.0, -1.0, 30.0, 81.91, 1e300, 0.01])
def test_ranges_that_are_none_say_nothing(value: float) -> None:
    assert nothing_said([replaced(s, ranges=np.full(BEAMS, value)) for s in SCANS])


@pytest.mark.parametrize("value", [nan, inf, 0.0, -1.0, 81.91])
def test_ranges_that_are_none_among_others_change_no_word(value: float) -> None:
    """Every third beam of a laser in a room smaller than its range is lost."""
    third = np.arange(BEAMS) % 3 == 0
    some = [replaced(s, ranges=np.where(third, value, s.ranges)) for s in SHUT]

    assert "CLOSED" == the_visit(some, places()).state.name


def test_beams_that_are_lost_in_a_doorway_alone_do_not_open_it() -> None:
    """A leaf that is black, or a mirror; the laser sees no farther than four metres."""
    gone = [replaced(s, ranges=np.where(s.ranges < 30, inf, s.ranges), max_range=4.0) for s in SHUT]

    assert nothing_said(gone)


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"ranges": np.empty(0), "bearings": np.empty(0), "origins": np.empty((0, 2))}, "no beams"),
        ({"ranges": np.ones(5)}, "ranges, bearings and origins differ in number"),
        ({"origins": np.zeros((5, 2))}, "ranges, bearings and origins differ in number"),
        ({"origins": np.full((BEAMS, 2), nan)}, "a place or a bearing is not finite"),
        ({"bearings": np.full(BEAMS, inf)}, "a place or a bearing is not finite"),
        ({"origins": np.full((BEAMS, 2), 1e200)}, "a place or a bearing is too large"),
        ({"bearings": np.linspace(0, 1e200, BEAMS)}, "a place or a bearing is too large"),
        ({"bearings": np.zeros(BEAMS)}, "bearings are not in order"),
        ({"bearings": np.abs(np.linspace(-1, 1, BEAMS))}, "bearings are not in order"),
        ({"max_range": nan}, "no largest range"),
        ({"max_range": 0.0}, "no largest range"),
    ],
)
def test_scans_that_cannot_be_used_are_dropped_and_counted(fields: dict, why: str) -> None:
    watcher = DoorWatcher()
    bad = [replaced(scan, stamp_ns=scan.stamp_ns + 1000, **fields) for scan in SHUT]
    mixed = [scan for two in zip(SHUT, bad, strict=True) for scan in two]

    visits = watcher.take(mixed, places()) + watcher.close()

    assert {why: len(bad)} == watcher.dropped
    assert [the_visit(SHUT, places())] == visits


def test_one_beam_is_a_scan() -> None:
    one = [
        replaced(s, origins=s.origins[:1], bearings=np.array([pi / 2]), ranges=np.array([1.0]))
        for s in SHUT
    ]

    (visit,) = seen(one, places())

    assert "OPEN" != visit.state.name
    assert visit.looks <= visit.scans


def test_a_million_beams_are_a_scan_worth_no_more_than_others() -> None:
    count = 1_000_000
    many = PlacedScan(
        stamp_ns=1,
        level=0,
        laser="",
        origins=np.broadcast_to([WIDTH / 2, 0.0], (count, 2)),
        bearings=np.linspace(0.01, pi - 0.01, count),
        ranges=1 / np.sin(np.linspace(0.01, pi - 0.01, count)),
        max_range=30,
    )

    visit = the_visit([many], places())

    assert "CLOSED" == visit.state.name
    assert visit.looks == pytest.approx(4)


@pytest.mark.parametrize("max_range", [inf, 1e300, 1e-9])
def test_a_largest_range_that_nobody_believes(max_range: float) -> None:
    visits = seen([replaced(s, max_range=max_range) for s in SHUT], places())

    assert [] == [visit for visit in visits if visit.state.name == "OPEN"]


@pytest.mark.parametrize("sd", [0.0, -1.0, 5.0, 1e9, inf, nan])
def test_standard_deviations_that_nobody_believes(sd: float) -> None:
    """A robot that does not know where it is says nothing; no told one is believed to be exact."""
    visits = seen([replaced(s, sd_xy=sd, sd_theta=sd) for s in SHUT], places())

    assert [] == [visit for visit in visits if visit.state.name == "OPEN"]
    if sd >= 5:
        assert not any(visit.state for visit in visits)


@pytest.mark.parametrize("width", [1e-300, 1e-6, 0.1, 0.2, 0.0, -0.9, nan, inf, 1e300])
def test_doors_of_no_width_or_of_any_are_not_met(width: float) -> None:
    assert [] == seen(SCANS, places((0.0, 1.0, 0.0, width)))


@pytest.mark.parametrize("where", [nan, inf, 1e300])
@pytest.mark.parametrize("column", range(3))
def test_doors_that_are_nowhere_are_not_met_and_leave_others_alone(
    where: float, column: int
) -> None:
    line = list(LINE)
    line[column] = where
    nowhere = places(line, door=3)

    visits = seen(SHUT, joined([nowhere, places()]))

    assert the_visit(SHUT, places()) in visits
    if where != 1e300 or column < 2:
        assert 1 == len(visits)


def test_a_gate_of_ten_metres_is_a_door() -> None:
    wall = past((-20, 1, 20, 1)).scans()

    assert "CLOSED" == the_visit(wall, places((-5.0, 1.0, 0.0, 10.0))).state.name


def test_a_laser_on_the_line_and_one_in_the_leaf_say_nothing() -> None:
    on_line = [replaced(s, origins=s.origins + np.array([0, 1.0])) for s in SHUT]

    assert [] == seen(on_line, places())


def test_random_scans_among_random_doors_raise_no_error() -> None:
    rng = np.random.default_rng(8)
    doors = joined([
        places(rng.uniform((-6, -6, -4, 0.05), (6, 6, 4, 4)).tolist(), kind=kind, door=1 + i)
        for i, kind in enumerate(["", "double", "sliding", "folding", "x"] * 20)
    ])  # fmt: skip
    scans = []
    for i in range(60):
        beams = int(rng.integers(1, 400))
        steps = np.cumsum(rng.uniform(1e-9, 0.05, beams)) * rng.choice((-1, 1))
        odd = rng.choice([nan, inf, 0.0, 1e-3, 29.9, 1e9, -5.0], beams)
        ranges = np.where(rng.random(beams) < 0.2, odd, rng.exponential(3, beams))
        origins = rng.uniform(-6, 6, 2) + rng.normal(0, 0.05, (beams, 2))
        scans.append(PlacedScan(i * 10**8, 0, "", origins, steps, ranges, max_range=30))

    visits: list[Visit] = seen(scans, doors)

    assert visits
    for visit in visits:
        assert 0.5 <= visit.accuracy <= 1
        assert 0 <= visit.opening <= 1
        assert 0 <= visit.ajar <= 1
        assert bool(visit.state) != bool(visit.why)
