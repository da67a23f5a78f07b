"""How the leaves of a door may stand, by its kind, and how far the laser may be off its place.

The error of a localisation is slow: all scans of a visit share it, and it is taken out once, at the
visit's end. Reported standard deviations are often too small. If their scale is unknown, with an
inverse gamma prior, the error has Student's t distribution: small shifts as in a normal one, but
now and then a large one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from math import cos, pi, radians, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.door_beams import DoorBeams

NEARLY = 0.03
"""A smaller clear share is shut: up to 12 degrees of a hinged leaf."""
CLEAR = 0.5
"""The clear share of the width from which on a door is open."""
ANGLES = tuple(map(radians, (12, 20, 28, 36, 44, 52, 60, 70, 80, 95)))
"""Of a hinged leaf that is not shut; close together where the words part."""
DOUBLE_ANGLES = (0, 14, 29, 45, 62, 90)
"""Degrees, of each leaf of a double door."""
SLID = (0.1, 0.25, 0.4, 0.55, 0.75)
"""Clear shares of a sliding door that stands in between."""
HUNG = (0.0, 0.1, -0.1)
"""How far off the line a sliding leaf runs, in widths."""
STANDING_AT = (0.0, 0.25, 0.5)
"""Where somebody begins who stands in an open door and fills half of it."""
WALL = 1.5
"""How much of a wall beyond a door is looked at, in widths."""
WALLED = 0.2
"""P(such a wall is there), of each end and side."""
AS_WALL = 0.7
"""The clear share from which on a leaf looks like such a wall itself."""
PRIOR = {"shut": 0.45, "ajar": 0.10, "open": 0.45}


class Leaf(NamedTuple):
    """A leaf as a segment; lengths in widths of the door, its line from (0, 0) to (1, 0)."""

    x: float
    """Where along the line it begins."""
    turn: float
    """Where it points, rad against the line."""
    length: float
    y: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Leaves:
    """All hypotheses of a kind of door; a row each; `k` leaves at most.

    Rows with most leaves come first, those that are two others together last.
    """

    starts: NDArray[np.float32]
    """(h, k, 2) in widths of the door."""
    turns: NDArray[np.float32]
    """(h, k) rad"""
    lengths: NDArray[np.float32]
    """(h, k) in widths of the door; 0: no leaf."""
    clear: NDArray[np.float64]
    """(h,) the share of the width that is free."""
    log_prior: NDArray[np.float64]
    """(h,)"""
    standing: NDArray[np.bool_]
    """(h,) the beams are stopped by a person in an open door, not a leaf."""
    both: NDArray[np.intp]
    """(p, 3) rows: the first is the second, a leaf, before the third, a wall beyond the door."""

    @property
    def with_leaf(self) -> tuple[int, ...]:
        """How many rows, the first ones, have a first leaf, a second one, ...

        Rows that combine two others are left out.
        """
        single = self.lengths[: len(self.clear) - len(self.both)]
        return tuple(n for n in (single > 0).sum(0).tolist() if n)

    @property
    def shut(self) -> NDArray[np.bool_]:
        """(h,) which of them are shut."""
        return self.clear < NEARLY

    @property
    def open(self) -> NDArray[np.bool_]:
        """(h,) which of them are open."""
        return self.clear >= CLEAR - 1e-6

    @property
    def ajar(self) -> NDArray[np.bool_]:
        """(h,) which of them are neither."""
        return ~self.shut & ~self.open

    def on_map(self, row: int, line: NDArray[np.float64]) -> tuple[Segment, ...]:
        """Return where the leaves of a hypothesis stand at a door (x, y, theta, width)."""
        if self.standing[row]:
            return ()
        x, y, theta, width = line.tolist()
        found = []
        for k in np.flatnonzero((self.lengths[row] > 0) & (self.lengths[row] <= 1)).tolist():
            (along, off), turn = self.starts[row, k].tolist(), theta + float(self.turns[row, k])
            x0 = x + width * (along * cos(theta) - off * sin(theta))
            y0 = y + width * (along * sin(theta) + off * cos(theta))
            length = width * float(self.lengths[row, k])
            found.append((x0, y0, x0 + length * cos(turn), y0 + length * sin(turn)))
        return tuple(found)


Segment = tuple[float, float, float, float]
"""x, y of one end, x, y of the other; m, frame `map`."""
Stand = tuple[Sequence[Leaf], float, float]
"""Leaves, clear share, probability within its verdict."""


@cache
def leaves_of(kind: str) -> Leaves:
    """Return the hypotheses for a value of the annotation `kind`; unknown kinds are hinged.

    Open-RMF's names are supported: `double_hinged`, `double_sliding`, `single_telescope` ...
    """
    words = kind.strip().lower()
    for part, stands in _STANDS:
        if part in words:
            return _table(stands())
    return _table(_hinged())


def _hinged() -> Iterable[Stand]:
    yield (Leaf(0, 0, 1),), 0.0, 1.0
    for angle in ANGLES:
        clear = 1 - max(cos(angle), 0)
        for leaf in _swung(angle, 1.0):
            walled = WALLED if NEARLY < clear < AS_WALL else 0.0
            yield (leaf,), clear, 0.25 * (1 - walled)
            if walled:
                yield (_wall_behind(leaf), leaf), clear, 0.25 * walled
    yield (), 1.0, 3.0 * (1 - 4 * WALLED)
    for leaf in _swung(0.5, 1.0):
        yield (_wall_behind(leaf),), 1.0, 3.0 * WALLED
    yield from _occupied(0.1)


def _wall_behind(leaf: Leaf) -> Leaf:
    """Return a wall across the door's line, from where this leaf would latch, to its side.

    Many rooms have it; it looks like a leaf that stands wide open.
    """
    side = 1 if sin(leaf.turn) > 0 else -1
    return Leaf(1 - leaf.x, side * radians(95 if leaf.x else 85), WALL)


def _occupied(weight: float) -> Iterable[Stand]:
    """Yield an open door half of which is filled by somebody who stands in it."""
    for x in STANDING_AT:
        yield (Leaf(x, 0, 0.5),), 1.0, weight


def _swung(angle: float, length: float) -> Iterable[Leaf]:
    """Yield a leaf at either end, swung to either side."""
    for side in (1, -1):
        yield Leaf(0, side * angle, length)
        yield Leaf(1, pi - side * angle, length)


def _double() -> Iterable[Stand]:
    """Yield two leaves of half the width, each by itself, to the same side."""
    angles = tuple(map(radians, DOUBLE_ANGLES))
    found: dict[tuple[Leaf, ...], float] = {}
    for side in (1, -1):
        left = [((Leaf(0, angle * side, 0.5),), 1 - cos(angle)) for angle in angles]
        right = [((Leaf(1, pi - angle * side, 0.5),), 1 - cos(angle)) for angle in angles]
        for one, free in [*left, ((), 1.0)]:
            for other, also_free in [*right, ((), 1.0)]:
                leaves = (*one, *other)
                found[leaves] = (free + also_free) / 2
    for leaves, clear in found.items():
        yield leaves, clear, 1.0


def _sliding() -> Iterable[Stand]:
    """Yield a leaf that slides to either end, or two that part in the middle.

    They run in the wall, or hang before it on either side. Somebody who stands in such a door looks
    like the leaf.
    """
    for off in HUNG:
        yield (Leaf(0, 0, 1, off),), 0.0, 1.0
        for clear in SLID:
            yield (Leaf(0, 0, 1 - clear, off),), clear, 1.0
            yield (Leaf(clear, 0, 1 - clear, off),), clear, 1.0
            half = (1 - clear) / 2
            yield (Leaf(0, 0, half, off), Leaf(1 - half, 0, half, off)), clear, 1.0
    yield (), 1.0, 18.0


def _folding() -> Iterable[Stand]:
    """Yield two panels of half the width that fold to either end, to either side."""
    yield (Leaf(0, 0, 1),), 0.0, 1.0
    for angle in map(radians, (12, 25, 40, 60, 80)):
        x, y = 0.5 * cos(angle), 0.5 * sin(angle)
        for side in (1, -1):
            panel = Leaf(0, side * angle, 0.5), Leaf(x, -side * angle, 0.5, side * y)
            yield panel, 1 - cos(angle), 0.25
            panel = (
                Leaf(1, pi - side * angle, 0.5),
                Leaf(1 - x, pi + side * angle, 0.5, side * y),
            )
            yield panel, 1 - cos(angle), 0.25
    yield (), 1.0, 1.0
    yield from _occupied(0.1)


_STANDS = (("sliding", _sliding), ("telescop", _sliding), ("fold", _folding), ("double", _double))
"""By parts of the kind's name, the first that fits: `double_sliding` is one that slides."""


def _table(stands: Iterable[Stand]) -> Leaves:
    """Return the hypotheses as arrays."""
    rows = sorted(stands, key=lambda stand: (_has_wall(stand[0]), -len(stand[0])))
    most = max(len(leaves) for leaves, _, _ in rows)
    none = Leaf(0, 0, 0)
    row_of = {tuple(leaves): row for row, (leaves, _, _) in enumerate(rows)}
    both = [
        (row_of[wall, leaf], row_of[(leaf,)], row_of[(wall,)])
        for wall, leaf in (leaves for leaves in row_of if len(leaves) == 2)
        if _has_wall((wall, leaf))
    ]
    padded = [[*leaves, *[none] * (most - len(leaves))] for leaves, _, _ in rows]
    clear = np.array([free for _, free, _ in rows])
    weights = np.array([weight for _, _, weight in rows])
    starts = np.array([[(leaf.x, leaf.y) for leaf in row] for row in padded], np.float32)
    turns = np.array([[leaf.turn for leaf in row] for row in padded], np.float32)
    lengths = np.array([[leaf.length for leaf in row] for row in padded], np.float32)
    standing = (clear == 1) & ((lengths > 0) & (turns == 0)).any(1)
    return Leaves(
        starts, turns, lengths, clear, np.log(_prior(clear, weights)), standing,
        np.array(both, np.intp).reshape(-1, 3),
    )  # fmt: skip


def _has_wall(leaves: Sequence[Leaf]) -> bool:
    """Return whether the leaves are a wall and a leaf before it."""
    return len(leaves) == 2 and leaves[0].length == WALL


def _prior(clear: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each hypothesis's probability: a share of its verdict's, by its weight."""
    prior = np.zeros(len(clear))
    shut, wide = clear < NEARLY, clear >= CLEAR - 1e-6
    for word, rows in (("shut", shut), ("ajar", ~shut & ~wide), ("open", wide)):
        prior[rows] = PRIOR[word] * weights[rows] / weights[rows].sum()
    return prior


Floats = NDArray[np.float64]

FREEDOM = 3.0
"""Degrees of freedom of Student's distribution."""
ACROSS = (0.0, 1.0, -1.0, 2.0, -2.0, 3.5, -3.0, 5.25, 7.5)
"""Away from the door (+) or towards it: far errors towards it only hide the door."""
SPAN = (1.0, 1.0, 1.0, 1.25, 1.0, 1.75, 1.0, 2.0, 2.25)
"""How much of the axis each of them stands for."""
ALONG = (1.5, -1.5)
SHIFTS = np.array([*((0.0, across) for across in ACROSS), *((along, 0.0) for along in ALONG)])
"""(s, 2) in standard deviations: along the door's line, away from it; first: none."""


def _log_weights() -> Floats:
    density = (1 + (SHIFTS**2).sum(1) / FREEDOM) ** (-(FREEDOM + 1) / 2)
    weights = density * np.array([*SPAN, *(1.0 for _ in ALONG)])
    return np.asarray(np.log(weights / weights.sum()))


LOG_WEIGHTS = _log_weights()
"""(s,) the log of how likely each shift is."""


def shifted(beams: DoorBeams) -> tuple[Floats, Floats]:
    """Return (m, s) x and y of where beams begin, were the laser shifted; the door's frame."""
    away = np.sign(beams.y) * beams.sd
    return (
        beams.x[:, None] + beams.sd[:, None] * SHIFTS[:, 0],
        beams.y[:, None] + away[:, None] * SHIFTS[:, 1],
    )


def shifted_planes(beams: DoorBeams) -> Floats:
    """Return (m, s) how far it is to the door's line, were the laser shifted; m."""
    return -shifted(beams)[1] / beams.uy[:, None]
