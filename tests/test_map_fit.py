"""How two maps lie to each other: against plain complex numbers, and numpy's least squares."""

from __future__ import annotations

import cmath
import math
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.core.folds.rebasing import PointPair, check_fit, fit_maps
from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.errors import CommandError

METRES = st.floats(-200, 200, allow_nan=False)
ANGLES = st.floats(-math.pi, math.pi, allow_nan=False)
TRANSFORMS = st.builds(RigidTransform, METRES, METRES, ANGLES)
PLACES = st.lists(st.builds(complex, METRES, METRES), min_size=2, max_size=12)


def moved(by: RigidTransform, place: complex) -> complex:
    return complex(by.dx, by.dy) + cmath.exp(1j * by.theta) * place


def paired(old: list[complex], new: list[complex]) -> list[PointPair]:
    return [
        PointPair(f"p{i}", a.real, a.imag, b.real, b.imag)
        for i, (a, b) in enumerate(zip(old, new, strict=True))
    ]


def residuals_of_least_squares(old: list[complex], new: list[complex]) -> np.ndarray:
    """Solve for (dx, dy, theta) by Gauss and Newton, each step with numpy's lstsq."""
    a, b = np.array(old), np.array(new)
    dx, dy = (b.mean() - a.mean()).real, (b.mean() - a.mean()).imag
    best = None
    for theta in np.linspace(-np.pi, np.pi, 8, endpoint=False):
        x = np.array([dx, dy, theta])
        for _ in range(60):
            turned = np.exp(1j * x[2]) * a
            off = b - (x[0] + 1j * x[1]) - turned
            slope = 1j * turned
            rows = np.concatenate([
                np.stack([np.ones(len(a)), np.zeros(len(a)), slope.real], 1),
                np.stack([np.zeros(len(a)), np.ones(len(a)), slope.imag], 1),
            ])  # fmt: skip
            x = x + np.linalg.lstsq(rows, np.concatenate([off.real, off.imag]), rcond=None)[0]
        off = np.abs(b - (x[0] + 1j * x[1]) - np.exp(1j * x[2]) * a)
        if best is None or (off**2).sum() < (best**2).sum():
            best = off
    assert best is not None
    return best


@given(TRANSFORMS, METRES, METRES, ANGLES)
def test_a_pose_moves_as_a_complex_number_does(
    by: RigidTransform, x: float, y: float, theta: float
) -> None:
    """Its place, and its direction within a turn."""
    new_x, new_y, new_theta = by.moved(x, y, theta)

    assert abs(complex(new_x, new_y) - moved(by, complex(x, y))) < 1e-9
    assert abs(cmath.exp(1j * new_theta) - cmath.exp(1j * (theta + by.theta))) < 1e-9
    assert by == RigidTransform() or -math.pi <= new_theta < math.pi


@given(TRANSFORMS, PLACES)
def test_a_fit_recovers_the_transform(by: RigidTransform, old: list[complex]) -> None:
    """Whatever it is, from two points on."""
    if max(abs(place - old[0]) for place in old) < 1:
        old = [*old, old[0] + 1]

    fit = fit_maps(paired(old, [moved(by, place) for place in old]))

    assert fit.worst_m < 1e-6
    assert all(abs(moved(fit.transform, at) - moved(by, at)) < 1e-6 for at in old)
    assert not fit.misfits
    assert not fit.hints


@pytest.mark.parametrize("seed", range(8))
def test_noise_leaves_the_residuals_of_least_squares(seed: int) -> None:
    rng = random.Random(seed)
    by = RigidTransform(rng.uniform(-50, 50), rng.uniform(-50, 50), rng.uniform(-3, 3))
    old = [complex(rng.uniform(0, 40), rng.uniform(0, 25)) for _ in range(rng.randint(3, 9))]
    new = [moved(by, at) + complex(rng.gauss(0, 0.1), rng.gauss(0, 0.1)) for at in old]

    fit = fit_maps(paired(old, new), most_residual_m=5.0)

    np.testing.assert_allclose(residuals_of_least_squares(old, new), fit.residuals_m, atol=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_pairs_that_spoil_the_fit_are_named(seed: int) -> None:
    """Two of eight are metres off: all of them are shown far off, and only the two are named."""
    rng = random.Random(seed)
    by = RigidTransform(12.5, -3.0, rng.uniform(-3, 3))
    old = [complex(rng.uniform(0, 40), rng.uniform(0, 25)) for _ in range(8)]
    new = [moved(by, at) + complex(rng.gauss(0, 0.02), rng.gauss(0, 0.02)) for at in old]
    new[2] += cmath.rect(4, rng.uniform(0, 6))
    new[5] += cmath.rect(7, rng.uniform(0, 6))

    fit = fit_maps(paired(old, new))

    assert ("p2", "p5") == fit.misfits
    assert fit.without_misfits_m < 0.1
    with pytest.raises(CommandError, match="does not fit the others: p2, p5; without them"):
        check_fit(fit)


def test_where_half_of_the_pairs_fit_none_is_named() -> None:
    """The other half may be right."""
    fit = fit_maps(paired([0j, 20 + 0j, 20 + 10j, 10j], [0j, 20 + 0j, 26 + 18j, 16j]))

    assert () == fit.misfits


def test_a_pair_within_the_limit_that_spoils_is_named() -> None:
    """0.2 m off, where the others fit to a centimetre: taken, and said."""
    old = [0j, 20 + 0j, 20 + 10j, 10j, 10 + 5j]

    fit = fit_maps(paired(old, [*old[:-1], 10.2 + 5j]))

    assert ("p4",) == fit.misfits
    check_fit(fit)


def test_a_mirrored_and_a_scaled_map_are_told() -> None:
    """They are what the residuals come from, not a pair."""
    old = [0j, 20 + 0j, 20 + 10j, 10j]

    mirrored = fit_maps(paired(old, [place.conjugate() for place in old]))
    scaled = fit_maps(paired(old, [1.1 * place for place in old]))

    assert "mirrored" in mirrored.hints[0]
    assert "1.1 times as large" in scaled.hints[0]
    with pytest.raises(CommandError, match="`resolution` of both"):
        check_fit(scaled)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ([0j], [1j], "got 1 pair"),
        ([1j, 1j, 1j], [0j, 5j, 9j], "in the old map all are within"),
        ([0j, 5j], [1j, 1j], "in the new map all are within"),
    ],
)
def test_too_little_tells_no_transform(old: list[complex], new: list[complex], says: str) -> None:
    """One point, or points at one place."""
    with pytest.raises(CommandError, match=says):
        fit_maps(paired(old, new))
