"""Doors that are not in the map: gaps in walls that a laser saw."""

from __future__ import annotations

from dataclasses import replace
from math import nan, pi, radians

import numpy as np
import pytest
from numpy.typing import NDArray

from semmap_log.analysis.scans.proposing.proposals import Proposal, proposals_of
from semmap_log.analysis.scans.proposing.swept_cells import KeptScans, SweptCells
from semmap_log.analysis.scans.proposing.wall_gaps import directions_of, gaps_in
from semmap_log.analysis.scans.visit import DoorPlaces, PlacedScan
from semmap_log.errors import FormatError
from tests.analysis.scans.scenes import LINE, WALLS, Segment, cast, leaf, places

NO_DOORS = DoorPlaces(
    np.zeros(0, int), np.zeros(0, int), np.zeros((0, 4)), (), np.zeros(0, np.bool_)
)
ANGLES = np.radians(np.arange(-135, 135, 1.5))
ENDS: tuple[Segment, ...] = ((-5, -1, -5, 1), (6, -1, 6, 1))
ALONG = tuple((x, 0.0, 0.0) for x in np.arange(-3.0, 4.0, 0.25))
INTO = tuple((0.45, y, pi / 2) for y in np.arange(-0.6, 2.6, 0.25))


def _seen(
    poses: tuple[tuple[float, float, float], ...], *leaves: Segment, max_range: float = 20.0
) -> list[PlacedScan]:
    """What a laser sees of the corridor from these poses, one a half second."""
    return [
        PlacedScan(
            stamp_ns=10**18 + i * 5 * 10**8, level=0, laser="laser",
            origins=np.tile(pose[:2], (len(ANGLES), 1)), bearings=pose[2] + ANGLES,
            ranges=cast(pose, (*WALLS, *ENDS, *leaves), ANGLES), max_range=max_range,
        )
        for i, pose in enumerate(poses)
    ]  # fmt: skip


def _is_at_the_door(found: Proposal) -> bool:
    middle = np.array([LINE[0] + LINE[3] / 2, LINE[1]])
    turned = abs((found.theta + pi / 2) % pi - pi / 2)
    return float(np.hypot(*(found.middle - middle))) < 0.15 and turned < 0.1


def test_an_open_door_is_proposed_where_it_is() -> None:
    """Its line, its width, and that the visits to it saw it open."""
    (found,) = proposals_of(_seen(ALONG), NO_DOORS)

    assert _is_at_the_door(found)
    assert found.width == pytest.approx(LINE[3], abs=0.16)
    assert found.kind == ""
    assert found.seen_open >= 1
    assert (found.passed, found.seen_closed) == (0, 0)


def test_errors_of_poses_do_not_make_a_door_narrower() -> None:
    """They blur the walls beside it, which then stand into it."""
    rng = np.random.default_rng(3)
    off = [
        replace(
            scan,
            origins=scan.origins + rng.normal(0, 0.05, 2),
            bearings=scan.bearings + rng.normal(0, radians(1)),
        )
        for scan in _seen(tuple((x, 0.0, 0.0) for x in np.tile(np.arange(-3.0, 4.0, 0.15), 3)))
    ]

    (found,) = proposals_of(off, NO_DOORS)

    assert found.width == pytest.approx(LINE[3] + 0.02, abs=0.04)


def test_driving_through_speaks_for_a_door() -> None:
    """It is counted, and the score is higher than by looks alone."""
    (looked,) = proposals_of(_seen(ALONG), NO_DOORS)
    (passed,) = proposals_of(_seen((*ALONG, *INTO)), NO_DOORS)

    assert passed.passed == 1
    assert passed.score > looked.score


def test_a_shut_door_is_wall() -> None:
    """Nothing tells its leaf from the wall, so nothing is proposed."""
    assert proposals_of(_seen(ALONG, leaf(0)), NO_DOORS) == []


def test_a_gap_that_no_beam_went_through_is_none() -> None:
    """The floor plan has a gap of a door's width where the laser saw wall, far from all doors."""
    steps = np.arange(-5, 6, 0.05)
    wall = np.stack([steps, np.full_like(steps, -1.0)], axis=1)
    gap = (steps > 0) & (steps < 0.9)

    assert len(gaps_in(wall[~gap])) >= 1
    assert proposals_of(_seen(ALONG), NO_DOORS, wall[~gap]) == []


def test_a_door_of_the_log_is_not_proposed_again() -> None:
    """Also where it is drawn a little beside; one on another level is another door."""
    scans = _seen(ALONG)
    x, y, theta, width = LINE
    beside = places((x + width + 0.1, y + 0.1, theta + pi, width))
    elsewhere = DoorPlaces(beside.ids, beside.levels + 1, beside.lines, beside.kinds, beside.glass)

    assert proposals_of(scans, beside) == []
    assert len(proposals_of(scans, elsewhere)) == 1


def test_walls_of_a_floor_plan_take_the_place_of_what_scans_draw() -> None:
    """A gap that the floor plan does not have is none."""
    steps = np.arange(-5, 6, 0.05)
    whole = np.stack([steps, np.ones_like(steps)], axis=1)
    with_gap = whole[(steps < 0) | (steps > 0.9)]

    assert proposals_of(_seen(ALONG), NO_DOORS, whole) == []
    (found,) = proposals_of(_seen(ALONG), NO_DOORS, with_gap)
    assert _is_at_the_door(found)


def test_beams_that_did_not_come_back_prove_no_gap() -> None:
    """A stretch of wall that swallows all beams is no doorway."""
    scans = _seen(ALONG)
    dark = [
        PlacedScan(
            s.stamp_ns, 0, "laser", s.origins, s.bearings,
            np.where(_ends_beyond(s), np.inf, s.ranges), 20.0,
        )
        for s in scans
    ]  # fmt: skip

    assert proposals_of(dark, NO_DOORS) == []


def _ends_beyond(scan: PlacedScan) -> NDArray[np.bool_]:
    return scan.origins[:, 1] + scan.ranges * np.sin(scan.bearings) > 1.05


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.2, 2.9])
@pytest.mark.parametrize(
    ("width", "is_one"), [(0.4, False), (0.9, True), (2.2, True), (3.0, False)]
)
def test_gaps_have_a_doors_width(turn: float, width: float, is_one: bool) -> None:
    """However the walls run."""
    steps = np.arange(-6, 6, 0.03)
    along = steps[abs(steps) > width / 2]
    points = np.stack([along * np.cos(turn), along * np.sin(turn)], axis=1)

    gaps = gaps_in(points)

    assert len(gaps) == is_one
    if is_one:
        assert gaps.lines[0, 3] == pytest.approx(width, abs=0.11)
        assert gaps.middles[0] == pytest.approx([0, 0], abs=0.1)


def test_walls_run_in_the_directions_that_are_found() -> None:
    """Two of them, at any angle to each other."""
    steps = np.arange(0, 8, 0.04)
    walls = [np.outer(steps, [np.cos(a), np.sin(a)]) + np.array([3, 2]) for a in (0.2, 1.4)]

    found = directions_of(np.concatenate(walls))

    assert sorted(found)[:2] == pytest.approx([0.2, 1.4], abs=0.03)
    assert directions_of(np.zeros((0, 2))) == []


def test_what_beams_go_through_is_no_wall() -> None:
    """Somebody who stood there once leaves no wall; nor does a beam that never came back."""
    scans = _seen(((0.0, 0.0, 0.0),) * 8)
    hit = SweptCells.of(scans)
    none = SweptCells.of([PlacedScan(1, 0, "l", np.zeros((1, 2)), np.zeros(1), np.array([nan]), 9)])

    ahead = hit.at(hit.walls, np.array([5.98, 2.0]), np.array([0.0, 0.0]))

    assert hit.passed.max() >= 8
    assert not ahead[1]
    assert not none.walls.any()


def test_a_robot_that_stands_is_not_kept_again_and_again() -> None:
    """One scan each two seconds is; each place is."""
    standing, moving = KeptScans(), KeptScans()
    standing.take(_seen(((0.0, 0.0, 0.0),) * 9))
    moving.take(_seen(ALONG))

    assert (standing.taken, len(standing.scans)) == (9, 3)
    assert len(moving.scans) == len(ALONG)


def test_a_long_day_keeps_no_more_than_it_shows() -> None:
    """Of the same drive, again and again, ever fewer are kept: whole drives, late ones, too."""
    kept = KeptScans()
    drive = _seen((*ALONG, *INTO))
    for lap in range(400):
        kept.take(replace(scan, stamp_ns=scan.stamp_ns + lap * 60 * 10**9) for scan in drive)

    laps = {(scan.stamp_ns - drive[0].stamp_ns) // (60 * 10**9) for scan in kept.scans}

    assert kept.taken == 400 * len(drive)
    assert len(kept.scans) < kept.taken / 2
    assert set(range(10)) < laps
    assert max(laps) > 300


def test_scans_over_half_the_world_are_refused() -> None:
    """With how large the map would be."""
    far = [
        PlacedScan(i, 0, "l", np.full((1, 2), x), np.zeros(1), np.ones(1), 9.0)
        for i, x in enumerate((0.0, 1e5))
    ]

    with pytest.raises(FormatError, match="too large a map"):
        proposals_of(far, NO_DOORS)
