"""How two maps of one place lie to each other, of points that were measured in both.

The rigid transform with the least sum of squared residuals: Arun, Huang and Blostein,
"Least-Squares Fitting of Two 3-D Point Sets", PAMI 1987; Umeyama, PAMI 1991, without his scale. In
the plane it has a closed form: with points as complex numbers, counted from their means, old a and
new b, it turns by the angle of sum(conj(a) b).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError

MOST_RESIDUAL_M = 0.3
"""A pair that is farther off is refused, unless told otherwise: about what a person who clicks into
two maps, and the maps themselves, are off by."""
MOST_PAIRS = 1000
LEAST_SPOILING_M = 0.05
"""One cell of most maps: less than that, no pair is worth a word."""
SPOILS = 3
"""A pair spoils a fit if without it the greatest residual is less than a third."""
LEAST_SCALE = 0.005
"""So far from 1 a scale is worth a word: 0.25 m in a corridor of 50 m."""


@dataclass(frozen=True, slots=True)
class PointPair:
    """A point in both maps, metres."""

    name: str
    """What people call it: its name, or its line."""
    old_x: float
    old_y: float
    new_x: float
    new_y: float


@dataclass(frozen=True, slots=True)
class MapFit:
    """A fitted transform, and how well each pair fits it."""

    pairs: tuple[PointPair, ...]
    transform: RigidTransform
    residuals_m: tuple[float, ...]
    """How far each old point, once moved, lies from the new one."""
    misfits: tuple[str, ...]
    """Names of the pairs that do not fit the others."""
    without_misfits_m: float
    """The greatest residual of a fit without them; NaN: there are none."""
    hints: tuple[str, ...]
    """What may be wrong with the maps themselves: one is mirrored, or has another scale."""

    @property
    def worst_m(self) -> float:
        """The greatest residual."""
        return max(self.residuals_m)


def fit_maps(pairs: Sequence[PointPair], *, most_residual_m: float = MOST_RESIDUAL_M) -> MapFit:
    """Return the best rigid transform from the old map to the new one, whatever its residuals.

    Args:
        pairs: Points in both.
        most_residual_m: What is farther off does not fit.

    Raises:
        CommandError: There are less than two pairs, or all of them at one place, or too many.
    """
    _check(pairs)
    old, new = _points(pairs)
    transform = _rigid(old, new)
    residuals = _residuals(transform, old, new)
    misfits = _misfits(old, new, residuals, most_residual_m)
    kept = np.setdiff1d(np.arange(len(pairs)), misfits)
    without = _worst(old[kept], new[kept]) if misfits else math.nan
    return MapFit(
        pairs=tuple(pairs), transform=transform, residuals_m=tuple(residuals.tolist()),
        misfits=tuple(pairs[i].name for i in misfits), without_misfits_m=without,
        hints=tuple(_hints(old, new)),
    )  # fmt: skip


def check_fit(fit: MapFit, *, most_residual_m: float = MOST_RESIDUAL_M) -> None:
    """Return if every pair fits.

    Raises:
        CommandError: One does not; the message names it, and says what the others would give.
    """
    if fit.worst_m <= most_residual_m:
        return
    far = zip(fit.pairs, fit.residuals_m, strict=True)
    worst = [f"{pair.name}: {off:.2f} m" for pair, off in far if off > most_residual_m]
    said = (
        f"the pairs: expected residuals of at most {most_residual_m:g} m, got {', '.join(worst)}. "
    )
    if len(fit.pairs) == 2:
        said += "The two points are farther from each other in one map than in the other"
    elif fit.misfits and not math.isnan(fit.without_misfits_m):
        them = "it" if len(fit.misfits) == 1 else "them"
        said += (
            f"What does not fit the others: {', '.join(fit.misfits)}; without {them} the greatest "
            f"residual is {fit.without_misfits_m:.2f} m"
        )
    else:
        said += "No two thirds of them fit each other"
    hints = "".join(f" {hint}" for hint in fit.hints)
    raise CommandError(f"{said}.{hints} Measure such points again, or give --most-residual.")


def _check(pairs: Sequence[PointPair]) -> None:
    if not 2 <= len(pairs) <= MOST_PAIRS:
        raise CommandError(
            f"the pairs: expected 2 to {MOST_PAIRS:,} points in both maps, "
            f"got {counted(len(pairs), 'pair')}."
        )
    for which, points in zip(("old", "new"), _points(pairs), strict=True):
        if float(np.abs(points - points[0]).max()) < LEAST_SPOILING_M:
            raise CommandError(
                f"the pairs: expected points that lie apart, at best at far ends of the map; in "
                f"the {which} map all lie within {LEAST_SPOILING_M:g} m, which tells no direction."
            )


Points = np.ndarray
"""complex128: x + iy, metres."""


def _points(pairs: Iterable[PointPair]) -> tuple[Points, Points]:
    pairs = list(pairs)
    return (
        np.array([complex(p.old_x, p.old_y) for p in pairs]),
        np.array([complex(p.new_x, p.new_y) for p in pairs]),
    )


def _sum(values: Points) -> complex:
    return complex(math.fsum(values.real.tolist()), math.fsum(values.imag.tolist()))


def _rigid(old: Points, new: Points) -> RigidTransform:
    """Return the best transform; of points that are all at one place, one without a turn."""
    middle, goal = _sum(old) / len(old), _sum(new) / len(new)
    theta = cmath.phase(_sum(np.conj(old - middle) * (new - goal)))
    shift = goal - cmath.rect(1.0, theta) * middle
    return RigidTransform(shift.real, shift.imag, theta)


def _residuals(transform: RigidTransform, old: Points, new: Points) -> np.ndarray:
    x, y, _ = transform.moved(old.real, old.imag, 0.0)
    off: np.ndarray = np.hypot(x - new.real, y - new.imag)
    return off


def _worst(old: Points, new: Points) -> float:
    return float(_residuals(_rigid(old, new), old, new).max())


def _misfits(old: Points, new: Points, residuals: np.ndarray, most_m: float) -> list[int]:
    """Return the pairs that do not fit the others; none where most of them do not.

    Of all transforms that two pairs give, the one that most pairs fit within `most_m` tells (RANSAC
    with every sample drawn: Fischler and Bolles 1981). Where all fit, the one pair counts without
    which the others fit much better.
    """
    if len(old) < 3 or residuals.max() <= LEAST_SPOILING_M:
        return []
    if residuals.max() <= most_m:
        return _spoiler(old, new, float(residuals.max()))
    fits = _largest_consensus(old, new, most_m)
    return np.flatnonzero(~fits).tolist() if fits.sum() * 3 >= len(old) * 2 else []


def _spoiler(old: Points, new: Points, worst_m: float) -> list[int]:
    without = [_worst(np.delete(old, i), np.delete(new, i)) for i in range(len(old))]
    best = int(np.argmin(without))
    return [best] if len(old) > 3 and without[best] * SPOILS < worst_m else []


def _largest_consensus(old: Points, new: Points, most_m: float) -> np.ndarray:
    """Return which pairs fit the transform that most pairs fit; of several, the closest fit."""
    best, key = np.zeros(len(old), np.bool_), (0, 0.0)
    for i in range(len(old) - 1):
        turn = np.conj(old[i + 1 :] - old[i]) * (new[i + 1 :] - new[i])
        turn = np.where(turn == 0, 1, turn)
        turn /= np.abs(turn)
        # Each two of them meet half way: both are as far off as the other.
        middle, goal = (old[i] + old[i + 1 :]) / 2, (new[i] + new[i + 1 :]) / 2
        off = np.abs(goal[:, None] + turn[:, None] * (old - middle[:, None]) - new)
        fits = off <= most_m
        sums = np.where(fits, off, 0).sum(axis=1)
        for at in np.flatnonzero(fits.sum(axis=1) >= key[0]).tolist():
            if (found := (int(fits[at].sum()), -float(sums[at]))) > key:
                best, key = fits[at], found
    return best


def _hints(old: Points, new: Points) -> list[str]:
    """Return what a fit with a mirror, or with a scale, says, where that fits much better."""
    a, b = old - _sum(old) / len(old), new - _sum(new) / len(new)
    spread = math.fsum((np.abs(a) ** 2).tolist())
    straight, mirrored = _sum(np.conj(a) * b), _sum(a * b)
    scale = abs(straight) / spread
    rigid = _off(b - a * cmath.rect(1.0, cmath.phase(straight)))
    hints = []
    flipped = _off(b - np.conj(a) * cmath.rect(1.0, cmath.phase(mirrored)))
    if len(a) > 2 and rigid > LEAST_SPOILING_M and flipped * SPOILS < rigid:
        hints.append(
            f"A mirrored map would fit much better ({flipped:.2f} m, root mean square, instead of "
            f"{rigid:.2f} m): one of the two is drawn upside down, with y down perhaps."
        )
    scaled = _off(b - a * (straight / spread))
    if abs(scale - 1) > LEAST_SCALE and len(a) > 2 and scaled * SPOILS < rigid:
        hints.append(
            f"Maps of another scale would fit much better ({scaled:.2f} m, root mean square, "
            f"instead of {rigid:.2f} m): the new one is {scale:.4g} times as large; look at the "
            "`resolution` of both."
        )
    return hints


def _off(differences: Points) -> float:
    return math.sqrt(math.fsum((np.abs(differences) ** 2).tolist()) / len(differences))
