"""What a laser reports: noise by surface and angle, lost and mixed echoes, glass, people."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from patrol_sim.laser_echoes import Beams
from patrol_sim.laser_people import LEG_M
from patrol_sim.laser_sensor import Laser, measured
from patrol_sim.laser_surfaces import Floats, Lines, Surface, joined

NOBODY = np.empty((0, 2))
LASER = Laser(beams=200, field_deg=40)


def wall(x: float, surface: Surface = Surface.PAINT, low: float = -9, high: float = 9) -> Lines:
    return Lines(np.array([[x, low, x, high]]), np.array([surface], np.int8))


def looks(lines: Lines, *, laser: Laser = LASER, legs: Floats = NOBODY, times: int = 40) -> Floats:
    """Return (times, beams) what a laser at the origin, looking along x, reports."""
    rng = np.random.default_rng(5)
    beams = Beams(np.zeros((laser.beams, 2)), laser.angles)
    return np.array([measured(laser, beams, lines, legs, rng=rng) for _ in range(times)])


def spread(lines: Lines) -> tuple[float, float]:
    """Return how wide the beams near the middle scatter about a wall, and the share lost."""
    ranges = looks(lines)[:, 90:110]
    true = 2.0 / np.cos(LASER.angles[90:110])
    near = np.abs(ranges - true) < 0.3
    return float((ranges - true)[near].std()), float(np.isinf(ranges).mean())


def test_ranges_are_whole_steps_near_the_wall() -> None:
    """Straight on, a bright wall: a centimetre or so of noise, hardly an echo lost."""
    ranges = looks(wall(2.0))

    true = 2.0 / np.cos(LASER.angles)
    assert np.median(np.abs(ranges - true)) < 0.012
    assert np.isinf(ranges).mean() < 0.02
    back = ranges[np.isfinite(ranges)]
    assert np.allclose(back / LASER.step_m, np.round(back / LASER.step_m), atol=1e-6)


def test_dark_surfaces_scatter_more_and_answer_less() -> None:
    """The same wall in black: twice the noise, and echoes are lost."""
    bright_sd, bright_lost = spread(wall(2.0))
    dark_sd, dark_lost = spread(wall(2.0, Surface.DARK))

    assert dark_sd > 1.5 * bright_sd
    assert dark_lost > bright_lost + 0.02


def test_noise_grows_with_the_angle() -> None:
    """At the same range, beams that graze a wall scatter more than those that meet it squarely."""
    squarely = looks(wall(3.0))[:, 95:105]
    turn = math.radians(75)  # the wall through (3, 0), turned away from the beams
    aside = np.array([math.sin(turn), math.cos(turn)]) * 2
    slanted = Lines(
        np.array([[3 - aside[0], -aside[1], 3 + aside[0], aside[1]]]), np.zeros(1, np.int8)
    )
    grazing = looks(slanted)[:, 95:105]

    def scatter(ranges: Floats) -> float:
        off = ranges - np.median(ranges, axis=0)
        return float(off[np.abs(off) < 0.3].std())

    assert scatter(grazing) > 1.5 * scatter(squarely)


def test_mixed_pixels_at_an_edge() -> None:
    """
    Where a beam is half on a post and half on the wall behind, some ranges lie in between, and none
    do at beams that meet one thing only.
    """
    lines = joined([wall(2.4), wall(2.0, low=-0.2, high=0.2)])
    ranges = looks(lines, times=300)
    between = (ranges > 2.08) & (ranges < 2.30)
    edge = np.abs(np.abs(np.tan(LASER.angles)) - 0.1) < 0.006

    assert 0.05 < between[:, edge].mean() < 0.7
    assert between[:, ~edge].mean() < 0.003


@pytest.mark.parametrize(("apart", "mixes"), [(0.3, True), (2.0, False)])
def test_echoes_far_apart_are_not_mixed(apart: float, mixes: bool) -> None:
    """A pulse is so long: of echoes farther apart one is taken, and nothing lies in between."""
    lines = joined([wall(2.0 + apart), wall(2.0, low=-0.2, high=0.2)])
    ranges = looks(lines, times=300)
    low, high = 2.08, 2.0 + apart * 0.75
    edge = np.abs(np.abs(np.tan(LASER.angles)) - 0.1) < 0.006

    assert (((ranges > low) & (ranges < high))[:, edge].mean() > 0.05) == mixes


def test_glass_answers_straight_on_and_lets_through_aside() -> None:
    """Most beams that meet a pane squarely come back from it, few at 40 degrees."""
    lines = joined([wall(2.0, Surface.GLASS), wall(4.0)])
    laser = replace(LASER, field_deg=100, beams=200)
    ranges = looks(lines, laser=laser)
    pane = 2.0 / np.cos(laser.angles)
    answered = np.abs(ranges - pane) < 0.1
    squarely = np.abs(laser.angles) < math.radians(5)
    aside = np.abs(laser.angles) > math.radians(35)

    assert answered[:, squarely].mean() > 0.5
    assert answered[:, aside].mean() < 0.2
    through = np.abs(ranges - 2 * pane) < 0.15
    assert through[:, aside].mean() > 0.4


def test_people_have_legs() -> None:
    """A leg 1 m ahead: beams end on its near side."""
    ranges = looks(wall(3.0), legs=np.array([[1.0, 0.0]]))
    middle = ranges[:, 95:105]

    assert np.median(middle) == pytest.approx(1.0 - LEG_M, abs=0.02)


def test_out_of_reach_does_not_come_back() -> None:
    """Farther than the laser sees, nearer than it can: infinite."""
    laser = replace(LASER, range_max=5.0, range_min=0.5)

    far, near = looks(wall(6.0), laser=laser), looks(wall(0.3), laser=laser)

    assert np.isinf(far).mean() > 0.99
    assert np.isinf(near).mean() > 0.99


def test_upside_down_scans_are_mirrored() -> None:
    """Hung from its mount, the laser's first beam is the leftmost one on the map."""
    lines = joined([wall(3.0, low=0.0, high=9.0), wall(1.5, low=-9.0, high=0.0)])
    base = np.zeros((LASER.beams, 3))
    rng = np.random.default_rng(0)
    found = {}
    for hung in (False, True):
        laser = replace(LASER, upside_down=hung, yaw=0.0, x=0.0, y=0.0)
        beams = laser.placed(base, as_told=True)
        found[hung] = measured(laser, beams, lines, NOBODY, rng=rng)

    assert np.nanmedian(found[False][:80]) < 2 < np.nanmedian(found[False][120:])
    assert np.nanmedian(found[True][120:]) < 2 < np.nanmedian(found[True][:80])


def test_spinning_laser_takes_its_time() -> None:
    """A full turn takes as long as a scan; a field of 270 degrees is over earlier."""
    laser = Laser(beams=360, field_deg=270, hz=10)

    assert laser.time_increment_s * 359 == pytest.approx(0.075)
    assert replace(laser, spins=False).time_increment_s == 0
