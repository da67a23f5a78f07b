"""What a robot that stands tells of a door; what two lasers of it tell."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.visit import PlacedScan, Visit
from tests.analysis.scans.scenes import (
    ANGLES,
    WALLS,
    Segment,
    cast,
    leaf,
    past,
    places,
    replaced,
    seen,
    the_visit,
)

SHUT, OPEN = (leaf(0),), (leaf(90),)
HERE = (0.45, -0.3, 1.57)
MINUTE_S = 60


@cache
def _ranges(leaves: tuple[Segment, ...], pose: tuple[float, float, float]) -> NDArray[np.float64]:
    return cast(pose, (*WALLS, *leaves))


def standing(
    minutes: float, leaves: tuple[Segment, ...] = SHUT, *, from_min: float = 0.0,
    pose: tuple[float, float, float] = HERE, tremble: float = 0.0, every_s: float = 2.0,
) -> list[PlacedScan]:  # fmt: skip
    """A robot stands before the door; times are minutes of its day."""
    rng = np.random.default_rng(8)
    ranges = _ranges(leaves, pose)
    found = []
    for i in range(int(minutes * MINUTE_S / every_s)):
        place = np.array(pose[:2]) + rng.normal(0, tremble, 2)
        found.append(
            PlacedScan(
                stamp_ns=round((1000 + from_min * MINUTE_S + i * every_s) * 1e9), level=0,
                laser="front", robot="", origins=np.tile(place, (len(ANGLES), 1)),
                bearings=pose[2] + ANGLES, ranges=ranges + rng.normal(0, 0.01, len(ANGLES)),
                max_range=30.0, sd_xy=0.05, sd_theta=0.02,
            )
        )  # fmt: skip
    return found


def news(visits: list[Visit]) -> list[tuple[str, int]]:
    """What is told, and in which minute."""
    return [(v.state.name, round((v.last_ns / 1e9 - 1000) // MINUTE_S)) for v in visits
            if not v.told_ns and not v.why]  # fmt: skip


@pytest.mark.parametrize("tremble", [0.0, 0.03, 0.05])
def test_from_one_stand_the_same_is_told_once_in_half_an_hour(tremble: float) -> None:
    visits = seen(standing(70, tremble=tremble), places())

    assert len(visits) > 100
    assert [("CLOSED", 0), ("CLOSED", 30), ("CLOSED", 60)] == [
        (state, minute - minute % 10) for state, minute in news(visits)
    ]


def test_another_state_is_told_at_once() -> None:
    """And going back to the first one, too."""
    scans = [*standing(10), *standing(5, OPEN, from_min=10), *standing(10, from_min=15)]

    (first, came), (other, changed), (last, back) = news(seen(scans, places()))
    assert ("CLOSED", "OPEN", "CLOSED") == (first, other, last)
    assert came == 0
    assert changed - 10 in {0, 1}
    assert back - 15 in {0, 1}


def test_how_scans_come_makes_no_difference_to_what_is_news() -> None:
    scans = [*standing(4), *standing(4, OPEN, from_min=4)]

    whole = seen(scans, places())

    assert [v.told_ns for v in whole] == [v.told_ns for v in seen(scans, places(), at_once=7)]
    assert any(v.told_ns for v in whole)


def away() -> list[PlacedScan]:
    """Return a drive elsewhere, from the sixth minute on."""
    return [
        replaced(scan, stamp_ns=scan.stamp_ns + 360 * 10**9)
        for scan in past(start=6.5, stop=9.0).scans()
    ]


SOMEBODY = (*SHUT, (0.0, 0.5, 0.9, 0.5))


@pytest.mark.parametrize(
    ("scans", "minutes"),
    [
        ([*standing(5), *away(), *standing(5, from_min=8)], [0, 8]),
        ([*standing(3), *standing(3, from_min=3, pose=(1.1, -0.3, 1.57))], [0, 3]),
        ([*standing(3, from_min=60), *standing(3)], [0, 60]),
        ([*standing(3), *standing(2, SOMEBODY, from_min=3), *standing(3, from_min=5)], [0]),
    ],
    ids=["it comes back", "it moves", "its clock is set back", "somebody stands in the doorway"],
)
def test_when_the_same_is_news(scans: list[PlacedScan], minutes: list[int]) -> None:
    """What is seen from another stand is; an undecided visit is no news and ends none."""
    found = news(seen(scans, places()))

    assert minutes == [minute for _, minute in found]
    assert {"CLOSED"} == {state for state, _ in found}


def test_a_door_that_is_otherwise_now_is_told_anew() -> None:
    watcher, scans = DoorWatcher(), standing(6)
    visits = watcher.take(scans[:90], places())

    visits += watcher.take(scans[90:], places(glass=True))

    assert [0, 3] == [minute for _, minute in news(visits + watcher.close())]


@pytest.mark.parametrize("leaves", [SHUT, OPEN])
@pytest.mark.parametrize("late_ns", [0, 40_000_000])
@pytest.mark.parametrize("step", [1, 3])
def test_a_filtered_copy_adds_nothing(leaves: tuple[Segment, ...], late_ns: int, step: int) -> None:
    """With some of its beams left out, in another frame, the visit is as sure as without it."""
    scans = past(*leaves).scans()
    copies = [
        replaced(scan, laser="front_filtered", stamp_ns=scan.stamp_ns + late_ns,
                 origins=scan.origins[::step], bearings=scan.bearings[::step],
                 ranges=scan.ranges[::step])
        for scan in scans
    ]  # fmt: skip
    both = [scan for two in zip(scans, copies, strict=True) for scan in two]

    alone, visit = the_visit(scans, places()), the_visit(both, places())

    assert (visit.laser, visit.state) == ("front", alone.state)
    assert visit.looks == pytest.approx(alone.looks, rel=0.02)
    assert visit.accuracy == pytest.approx(alone.accuracy, abs=0.002)


def test_two_lasers_that_look_one_after_the_other_make_one_visit() -> None:
    """The front one until the robot is at the door, the rear one from there."""
    scans = past(*SHUT).scans()
    turns = [scan if i < 8 else replaced(scan, laser="rear") for i, scan in enumerate(scans)]

    alone, visit = the_visit(scans, places()), the_visit(turns, places())

    assert visit.looks == pytest.approx(alone.looks, rel=0.15)
    assert "CLOSED" == visit.state.name
    assert visit.last_ns == alone.last_ns


def test_a_laser_whose_clock_is_another_is_left_out_and_counted() -> None:
    scans = past(*SHUT).scans()
    late = [replaced(scan, laser="rear", stamp_ns=scan.stamp_ns - 3600 * 10**9) for scan in scans]
    watcher = DoorWatcher()

    both = [scan for two in zip(scans, late, strict=True) for scan in two]
    visits = watcher.take(both, places()) + watcher.close()

    assert [the_visit(scans, places())] == visits
    (why,) = watcher.dropped
    assert "other lasers" in why
    assert len(scans) == watcher.dropped[why]
