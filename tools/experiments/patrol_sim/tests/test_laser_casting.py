"""Where beams end: by the tool, and by asking each beam about each line in plain Python."""

from __future__ import annotations

import math

import numpy as np
import pytest

from patrol_sim.laser_casting import NOTHING, cast, cast_all


def by_hand(
    origin: tuple[float, float], bearing: float, ends: list[list[float]], most_m: float
) -> tuple[float, int]:
    """Return how far, and to which line: bisected, so that no formula is shared with the tool."""
    best, which = math.inf, NOTHING
    ux, uy = math.cos(bearing), math.sin(bearing)
    for number, (x0, y0, x1, y1) in enumerate(ends):
        # Sides on which the line's ends lie of the beam; the crossing is where the side is zero.
        def side(share: float, x0=x0, y0=y0, x1=x1, y1=y1) -> float:
            x, y = x0 + share * (x1 - x0) - origin[0], y0 + share * (y1 - y0) - origin[1]
            return ux * y - uy * x

        low, high = 0.0, 1.0
        if side(low) * side(high) > 0:
            continue
        for _ in range(80):
            middle = (low + high) / 2
            low, high = (middle, high) if side(low) * side(middle) > 0 else (low, middle)
        x, y = x0 + low * (x1 - x0) - origin[0], y0 + low * (y1 - y0) - origin[1]
        far = x * ux + y * uy
        if 1e-6 < far <= most_m and far < best:
            best, which = far, number
    return best, which


@pytest.mark.parametrize("seed", range(6))
def test_beams_end_where_a_walk_along_each_line_says(seed: int) -> None:
    """
    However a robot moves while its laser turns, each beam ends on the same line, as far away.
    """
    rng = np.random.default_rng(seed)
    beams = 97
    ends = np.column_stack([rng.uniform(-6, 6, (40, 2)), rng.uniform(-6, 6, (40, 2))])
    bearings = rng.uniform(-9, 9) + np.sort(rng.uniform(0, math.tau, beams))
    origins = rng.uniform(-3, 3, 2) + np.linspace(0, 0.3, beams)[:, None] * rng.normal(size=2)

    hits = cast(origins, bearings, ends, most_m=5.0)

    for beam in range(beams):
        far, line = by_hand(tuple(origins[beam]), bearings[beam], ends.tolist(), 5.0)
        assert line == hits.line[beam]
        assert hits.ranges[beam] == pytest.approx(far)


def test_hits_tell_incidence_and_place() -> None:
    """A beam that meets a wall at 30 degrees: cosine .5, and how far along the wall."""
    ends = np.array([[-4.0, 1.0, 4.0, 1.0]])
    bearing = math.radians(30)

    hits = cast(np.zeros((1, 2)), np.array([bearing]), ends, most_m=9)

    assert hits.ranges[0] == pytest.approx(2)
    assert hits.cosine[0] == pytest.approx(0.5)
    assert hits.along_m[0] == pytest.approx(4 + math.sqrt(3))


def test_nothing_within_reach() -> None:
    """What is too far away is not met."""
    hits = cast(np.zeros((1, 2)), np.zeros(1), np.array([[7.0, -1, 7, 1]]), most_m=6.9)

    assert hits.ranges[0] == math.inf
    assert hits.line[0] == NOTHING


def test_beams_in_any_order_meet_the_same() -> None:
    """The way for few beams of any origins gives what the way for whole scans gives."""
    rng = np.random.default_rng(0)
    ends = rng.uniform(-5, 5, (20, 4))
    origins, bearings = np.zeros((50, 2)), np.sort(rng.uniform(0, math.tau, 50))

    whole = cast(origins, bearings, ends, most_m=9)
    shuffled = rng.permutation(50)
    single = cast_all(origins[shuffled], bearings[shuffled], ends, most_m=9)

    assert whole.ranges[shuffled].tolist() == single.ranges.tolist()
