"""Which beams look at which door: every beam asked by itself."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

from semmap_log.analysis.scans.door_beams import Sights, sights_of
from semmap_log.analysis.scans.visit import PlacedScan, ScanModel, ScanStack

MODEL = ScanModel(beams=1000, side_beams=1000)
"""All beams of a door are kept."""


def some_scan(seed: int, *, span: float = 1.5 * pi, beams: int = 500) -> PlacedScan:
    """Return a scan near (0, 0); its laser moves while it turns."""
    rng = np.random.default_rng(seed)
    way = np.linspace(0, 0.1, beams)
    start = rng.uniform(-2, 2, 2)
    return PlacedScan(
        stamp_ns=seed,
        level=0,
        laser="",
        origins=start + np.stack([way, -way], axis=1),
        bearings=rng.uniform(-7, 7) + np.linspace(0, span, beams, endpoint=False),
        ranges=rng.uniform(0.5, 8, beams),
        max_range=30,
    )


def some_doors(seed: int, count: int = 12) -> np.ndarray:
    rng = np.random.default_rng(seed)
    low, high = (-5, -5, -pi, 0.5), (5, 5, pi, 1.5)
    return rng.uniform(low, high, (count, 4))


def crossing(scan: PlacedScan, line: np.ndarray) -> dict[int, tuple[float, float]]:
    """Return where on the line each beam that is not too flat crosses it, and how far it is."""
    x, y, theta, _ = line.tolist()
    found = {}
    for i, bearing in enumerate(scan.bearings.tolist()):
        ox, oy = scan.origins[i].tolist()
        ux, uy = cos(bearing), sin(bearing)
        flat = uy * cos(theta) - ux * sin(theta)
        if abs(flat) <= sin(MODEL.flattest):
            continue
        far = ((x - ox) * -sin(theta) + (y - oy) * cos(theta)) / flat
        if far > 0:
            px, py = ox + far * ux - x, oy + far * uy - y
            found[i] = (px * cos(theta) + py * sin(theta), far)
    return found


def sights(scan: PlacedScan, doors: np.ndarray) -> Sights:
    stack = ScanStack.of([scan], MODEL)
    pairs = np.zeros(len(doors), np.intp), np.arange(len(doors))
    return sights_of(stack, doors, pairs, MODEL)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("span", [0.8, 1.5 * pi, 2 * pi])
def test_beams_through_a_door_are_those_that_cross_its_line_and_end_there(
    seed: int, span: float
) -> None:
    scan, doors = some_scan(seed, span=span), some_doors(seed + 100)

    found = sights(scan, doors)

    assert len(found.door)
    for place, door in enumerate(found.door.tolist()):
        width = doors[door, 3]
        mine = found.beams.only(found.beams.sight == place)
        through = set(np.round(mine.range[mine.range > mine.plane + 0.01], 9).tolist())
        expected = {
            round(float(scan.ranges[i]), 9): where
            for i, (where, far) in crossing(scan, doors[door]).items()
            if scan.ranges[i] > far + 0.01 and far < 4 * MODEL.reach
        }
        # the margins are those of one place of the laser, which moved a little meanwhile
        sure = {ended for ended, where in expected.items() if 0.25 < where < width - 0.25}
        possible = {ended for ended, where in expected.items() if 0 < where < width}
        assert sure <= through <= possible


@pytest.mark.parametrize("seed", range(6))
def test_walls_beside_a_door_are_looked_at_outside_its_line(seed: int) -> None:
    found = sights(some_scan(seed), some_doors(seed))
    beside = found.beside

    outside = np.maximum(-beside.where, beside.where - beside.width)
    assert len(outside)
    assert (outside > 0).all()
    assert (outside < MODEL.beside + 0.3).all()


@pytest.mark.parametrize("seed", range(6))
def test_beams_beside_a_door_that_come_over_its_leaf(seed: int) -> None:
    """They cross the line outside of it, and are above its middle part well before that."""
    scan, doors = some_scan(seed), some_doors(seed)
    found = sights(scan, doors)
    over = found.over

    assert len(over.where)
    assert ((over.where < 0) | (over.where > over.width)).all()
    up = 0.7 * over.width / np.abs(over.uy)
    at = over.where - up * over.ux
    assert ((at > 0) & (at < over.width)).all()
    ends_short = ~over.reaches
    x, y = (a + over.range * u for a, u in ((over.x, over.ux), (over.y, over.uy)))
    hinge = np.minimum(np.hypot(x, y), np.hypot(x - over.width, y))
    assert (hinge[ends_short] < over.width[ends_short] + 0.1).all()


def test_of_many_beams_evenly_spaced_ones_are_taken() -> None:
    bearings = np.linspace(0, pi, 5001)
    scan = PlacedScan(0, 0, "", np.zeros((5001, 2)), bearings, np.full(5001, 9.0), max_range=30)
    doors = np.array([[-0.6, 2.0, 0.0, 1.2]])
    stack = ScanStack.of([scan], ScanModel())

    found = sights_of(stack, doors, (np.zeros(1, np.intp), np.zeros(1, np.intp)), ScanModel())

    where = np.sort(found.beams.where)
    assert ScanModel().beams == len(where)
    assert where[[0, -1]] == pytest.approx([0.1, 1.1], abs=0.002)
    assert np.diff(where).max() < 0.11
    assert found.looks[0] * len(where) == pytest.approx(ScanModel().looks_a_scan)


def test_a_few_beams_are_worth_few_looks() -> None:
    bearings = np.array([1.4, pi / 2, 1.7])
    scan = PlacedScan(0, 0, "", np.zeros((3, 2)), bearings, np.full(3, 9.0), max_range=30)
    doors = np.array([[-0.6, 2.0, 0.0, 1.2]])

    found = sights_of(
        ScanStack.of([scan], MODEL), doors, (np.zeros(1, np.intp), np.zeros(1, np.intp)), MODEL
    )

    assert 3 == len(found.beams.range) == found.looks[0] * 3


def test_what_ended_well_before_the_door_says_nothing_unless_a_leaf_may_be_there() -> None:
    bearings = np.linspace(1.2, 1.9, 200)
    scan = PlacedScan(0, 0, "", np.zeros((200, 2)), bearings, np.full(200, 1.0), max_range=30)
    far, near = np.array([[-0.6, 4.0, 0.0, 1.2]]), np.array([[-0.6, 1.6, 0.0, 1.2]])

    assert 0 == len(sights(scan, far).beams.range)
    assert sights(scan, far).hidden[0] > 50
    swept = sights(scan, near).beams
    assert len(swept.range)
    assert not swept.reaches.any()
