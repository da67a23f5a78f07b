"""Turns in space as quaternions: one at a time, or many as arrays.

A vector is (x, y, z), a quaternion (x, y, z, w); each component is a number, or an array of as many
as there are of the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

Vector: TypeAlias = tuple[Any, Any, Any]
Quaternion: TypeAlias = tuple[Any, Any, Any, Any]

NO_SHIFT: Vector = (0.0, 0.0, 0.0)
NO_TURN: Quaternion = (0.0, 0.0, 0.0, 1.0)


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the rotation by b, then by a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def inverse(turn: Quaternion) -> Quaternion:
    """Return the rotation back."""
    x, y, z, w = turn
    return -x, -y, -z, w


def unit(turn: Sequence[Any]) -> Quaternion:
    """Return a quaternion of length 1, as a turn has it: a longer one would stretch, too."""
    length = np.sqrt(sum(part * part for part in turn))
    x, y, z, w = (part / length for part in turn)
    return x, y, z, w


def rotated(vector: Vector, turn: Quaternion) -> Vector:
    """Return a vector turned."""
    return product(product(turn, (*vector, 0.0)), inverse(turn))[:3]


def between(a: Quaternion, b: Quaternion, share: Any) -> Quaternion:
    """Return the turn that lies a share of the way from a to b: at a constant rate, the short way.

    Two quaternions are the same turn if one is the other's negative: of those of `b` the one nearer
    to `a` counts, or a turn by one degree would go around by 359.
    """
    dot = sum(one * other for one, other in zip(a, b, strict=True))
    sign = np.where(np.less(dot, 0), -1.0, 1.0)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(angle)
    is_small = sine < SMALL
    safe = np.where(is_small, 1.0, sine)
    of_a = np.where(is_small, 1 - share, np.sin((1 - share) * angle) / safe)
    of_b = np.where(is_small, share, np.sin(share * angle) / safe) * sign
    mixed = [of_a * one + of_b * other for one, other in zip(a, b, strict=True)]
    return unit(mixed)


SMALL = 1e-6
"""Sine of an angle below which the arc is as good as straight."""


def angle_between(a: Quaternion, b: Quaternion) -> Any:
    """Return by how much two turns differ, radians."""
    *xyz, w = product(inverse(a), b)
    return 2 * np.arctan2(np.sqrt(sum(part * part for part in xyz)), np.abs(w))


def yaw(turn: Quaternion) -> Any:
    """Return the angle around z, radians."""
    x, y, z, w = turn
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
