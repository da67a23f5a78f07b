"""Driving through a door is a visit of its own; hops of the localisation are not driving."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.visit import PlacedScan, Visit
from tests.analysis.scans.scenes import LINE, WIDTH, moved, places, replaced, seen

MIDDLE = WIDTH / 2


def drive(*points: tuple[float, float], every_s: float = 0.2, start_s: float = 0.0) -> list:
    """Return scans that see nothing, at these places."""
    return [
        PlacedScan(
            stamp_ns=round((start_s + i * every_s) * 1e9),
            level=0,
            laser="",
            origins=np.array([point]),
            bearings=np.zeros(1),
            ranges=np.array([np.nan]),
            max_range=30,
        )
        for i, point in enumerate(points)
    ]


def straight(start: float, stop: float, *, x: float = MIDDLE, step: float = 0.05) -> list:
    """Return places across the door's line, which is at y = 1."""
    count = round(abs(stop - start) / step) + 1
    return [(x, y) for y in np.linspace(start, stop, count).tolist()]


def passages(scans: list, line: tuple = LINE, *, at_once: int = 1000) -> list[Visit]:
    return [visit for visit in seen(scans, places(line), at_once=at_once) if visit.passed]


@pytest.mark.parametrize("there", [(0.0, 2.0), (2.0, 0.0), (0.5, 1.4), (1.5, 0.6)])
@pytest.mark.parametrize("at_once", [1, 4, 1000])
def test_who_drives_through_has_passed(there: tuple[float, float], at_once: int) -> None:
    (visit,) = passages(drive(*straight(*there)), at_once=at_once)

    assert ("OPEN", 0.999, 1.0) == (visit.state.name, visit.accuracy, visit.opening)
    assert visit.passed
    assert visit.first_ns < visit.last_ns
    assert visit.scans >= 15


WAYS = {
    "not far enough": (0, straight(0.0, 1.3)),
    "not across": (0, straight(0.0, 0.95)),
    "back again": (0, [*straight(0.0, 1.2), *straight(1.2, 0.0)]),
    "from nowhere": (0, straight(0.8, 2.0)),
    "through the wall": (0, straight(0.0, 2.0, x=-0.5)),
    "at the hinge": (0, straight(0.0, 2.0, x=0.05)),
    "at the latch": (0, straight(0.0, 2.0, x=WIDTH - 0.05)),
    "along the line": (0, [(x, 1.0) for x in np.linspace(-2, 3, 50).tolist()]),
    "a jump of the localisation": (0, [*straight(0.0, 0.6), *straight(1.4, 2.0)]),
    "rocking in the doorway": (
        1,
        [*straight(0, 1), *((MIDDLE, 1 + 0.1 * sin(i)) for i in range(100)), *straight(1, 2)],
    ),
    "there and back": (2, [*straight(0, 2), *straight(2, 0)]),
}


@pytest.mark.parametrize("way", WAYS)
def test_only_whole_ways_through_are_passages(way: str) -> None:
    count, points = WAYS[way]
    assert count == len(passages(drive(*points)))


def test_a_gap_in_time_is_no_passage() -> None:
    before, behind = drive(*straight(0.0, 0.9)), drive(*straight(1.1, 2.0), start_s=30)

    assert [] == passages([*before, *behind])


def test_another_level_is_no_passage() -> None:
    """Through the door's place on the floor above: the way begins there, on the other side."""
    scans = drive(*straight(0.0, 2.0))

    assert [] == passages([replaced(s, level=1) for s in scans])
    assert [] == passages([replaced(s, level=int(i < 21)) for i, s in enumerate(scans)])


def test_scans_far_apart_still_make_a_passage() -> None:
    """A log that keeps a scan each metre."""
    assert 1 == len(passages(drive((MIDDLE, -0.4), (MIDDLE, 0.6), (MIDDLE, 1.6), every_s=2)))


@pytest.mark.parametrize("turn", [1.0, -2.5])
def test_a_passage_in_a_turned_world(turn: float) -> None:
    c, s = cos(turn), sin(turn)
    line = (c * LINE[0] - s * LINE[1] + 9, s * LINE[0] + c * LINE[1] + 4, turn, WIDTH)

    assert 1 == len(passages([moved(p, 9, 4, turn) for p in drive(*straight(0, 2))], line))
    other_end = (WIDTH, 1.0, pi, WIDTH)
    assert 1 == len(passages(drive(*straight(0, 2)), other_end))


def test_a_door_that_moves_meanwhile_is_not_passed() -> None:
    watcher, scans = DoorWatcher(), drive(*straight(0, 2))
    watcher.take(scans[:23], places())

    visits = watcher.take(scans[23:], places((0.0, 0.9, 0.0, WIDTH)))

    assert [] == [visit for visit in visits + watcher.close() if visit.passed]


@pytest.mark.parametrize("at_once", [1, 1000])
def test_a_robot_with_two_lasers_has_passed_once(at_once: int) -> None:
    """Though each of them crosses the line; on its way back once more."""
    front = [*straight(-2.0, 3.0), *straight(3.0, -2.0)]
    rear = [(x, y - 0.5) for x, y in front]
    two = [replaced(scan, laser="rear") for scan in drive(*rear)]
    other = [replaced(scan, robot="other") for scan in drive(*front)]
    mixed = [scan for three in zip(drive(*front), two, other, strict=True) for scan in three]

    found = passages(mixed, at_once=at_once)

    robots = [visit.robot for visit in found]
    assert (2, 2) == (robots.count(""), robots.count("other"))
    assert ["", "rear"] == [visit.laser for visit in found if not visit.robot]


def test_a_robot_that_comes_straight_back_has_passed_twice() -> None:
    """Though it was behind the door for a second only."""
    there_and_back = [*straight(0.0, 1.5), *straight(1.5, 0.0)]

    one, other = passages(drive(*there_and_back, every_s=0.1))

    assert 0 < other.first_ns - one.last_ns < 2 * 10**9
