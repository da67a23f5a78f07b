"""Doors as bodies: leaves of some thickness that swing, slide or fold, and how they stood when."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

import numpy as np

from patrol_sim.laser_plan import PlanDoor
from patrol_sim.laser_surfaces import Floats, Lines, Surface, bar, joined

LEAF_M = 0.04
GAP_M = 0.005
"""Between a leaf and its frame."""
STILE_M = 0.08
"""The frame of a glass leaf, at both ends."""
MOVES_S = 2.5
"""A door takes this long to open or close."""
SHUT_BELOW, OPEN_FROM = 0.012, 0.5
"""The clear share of the width that is called shut (9 degrees), and open (60 degrees)."""

HINGED, DOUBLE, SLIDING, DOUBLE_SLIDING, FOLDING = (
    "hinged", "double_hinged", "sliding", "double_sliding", "folding",
)  # fmt: skip
TWO_LEAVES = (DOUBLE, DOUBLE_SLIDING)
SLIDES = (SLIDING, DOUBLE_SLIDING)
Amounts = tuple[float, float]
"""How far each leaf is open: radians, or the share of its way for those that slide. Doors with one
leaf have the same number twice."""


@dataclass(frozen=True, slots=True)
class DoorBody:
    """A door as it was built: not quite where it is drawn."""

    drawn: PlanDoor
    kind: str
    glass: bool
    shifted: tuple[float, float]
    """m: how far it was built from where it is drawn, along its line and to its left."""
    hinge_at_end: bool
    """The hinge, or where a sliding leaf goes, is at the end of the line, not at its start."""
    side: int
    """To which side it swings: 1 left of its line, -1 right."""
    recess_m: float
    """The leaf's middle lies so far from the line, to that side."""
    surface: Surface

    @property
    def ends(self) -> tuple[Floats, Floats]:
        """Start and end of the opening as built."""
        start, end = self.drawn.ends
        moved = self.shifted[0] * self.drawn.along + self.shifted[1] * self.drawn.left
        return start + moved, end + moved

    def opening(self, amounts: Amounts) -> float:
        """Return the clear share of the width, 0..1."""
        return sum(self._clear(amount) for amount in amounts) / 2

    def word(self, amounts: Amounts) -> str:
        """Return OPEN, CLOSED or AJAR."""
        opening = self.opening(amounts)
        return (
            "CLOSED" if opening < SHUT_BELOW else "OPEN" if opening > OPEN_FROM - 1e-9 else "AJAR"
        )

    def angle_deg(self, amounts: Amounts) -> float | None:
        """Return how far the leaf that is open farthest has swung; None: it slides."""
        return None if self.kind in SLIDES else math.degrees(max(amounts))

    def lines(self, amounts: Amounts) -> Lines:
        """Return the outlines of its leaves."""
        return joined(self._slab(start, end) for start, end in self.panels(amounts))

    def panels(self, amounts: Amounts) -> list[tuple[Floats, Floats]]:
        """Return the middle line of each panel of each leaf, m."""
        start, end = self.ends
        aside = self.side * self.drawn.left
        start, end = start + self.recess_m * aside, end + self.recess_m * aside
        if self.hinge_at_end:
            start, end = end, start
        middle = (start + end) / 2
        leaves = [(start, middle), (end, middle)] if self.kind in TWO_LEAVES else [(start, end)]
        return [
            panel
            for (hinge, latch), amount in zip(leaves, amounts, strict=False)
            for panel in self._leaf(hinge, latch, amount, aside)
        ]

    def _leaf(
        self, hinge: Floats, latch: Floats, amount: float, aside: Floats
    ) -> list[tuple[Floats, Floats]]:
        width = float(np.hypot(*(latch - hinge)))
        along = (latch - hinge) / width
        hinge, width = hinge + GAP_M * along, width - 2 * GAP_M
        if self.kind in SLIDES:
            return [(hinge - amount * width * along, latch - (amount * width + GAP_M) * along)]
        if self.kind == FOLDING:
            knee = hinge + width / 2 * (math.cos(amount) * along + math.sin(amount) * aside)
            return [(hinge, knee), (knee, hinge + width * math.cos(amount) * along)]
        return [(hinge, hinge + width * (math.cos(amount) * along + math.sin(amount) * aside))]

    def _clear(self, amount: float) -> float:
        return amount if self.kind in SLIDES else 1 - max(math.cos(amount), 0.0)

    def _slab(self, start: Floats, end: Floats) -> Lines:
        half = LEAF_M / 2
        if not self.glass:
            return bar(start, end, left_m=half, right_m=half, surface=self.surface)
        along = (end - start) / np.hypot(*(end - start))
        stile = STILE_M * along
        pane = Lines(
            np.array([[*(start + stile), *(end - stile)]]), np.array([Surface.GLASS], np.int8)
        )
        stiles = [(start, start + stile), (end - stile, end)]
        bars = [bar(a, b, left_m=half, right_m=half, surface=Surface.SHINY) for a, b in stiles]
        return joined([pane, *bars])


class DoorLife:
    """How a door stood, from the first moment on: it moves for some seconds at each change."""

    def __init__(self, body: DoorBody, first: Amounts) -> None:
        self.body = body
        self._starts: list[float] = [-math.inf]
        self._targets: list[Amounts] = [first]

    def change(self, at_s: float, amounts: Amounts, *, holds_s: float = 0.0) -> None:
        """Let it go there from that moment on, and stay so at least that long."""
        self.hold(at_s, holds_s)
        place = bisect_right(self._starts, at_s)
        self._starts.insert(place, at_s)
        self._targets.insert(place, amounts)

    def hold(self, at_s: float, holds_s: float) -> None:
        """Let it begin nothing new from that moment on, for so long."""
        first, last = bisect_left(self._starts, at_s), bisect_right(self._starts, at_s + holds_s)
        del self._starts[first:last], self._targets[first:last]

    def amounts(self, at_s: float) -> Amounts:
        """Return how far its leaves are open then."""
        place = bisect_right(self._starts, at_s) - 1
        share = min(1.0, (at_s - self._starts[place]) / MOVES_S)
        target = self._targets[place]
        if share >= 1.0 or place == 0:
            return target
        before = self._targets[place - 1]
        return (
            before[0] + share * (target[0] - before[0]),
            before[1] + share * (target[1] - before[1]),
        )

    def moves(self, start_s: float, end_s: float) -> bool:
        """Tell whether it moves at any time from start to end."""
        return any(start_s - MOVES_S < change_s <= end_s for change_s in self._starts[1:])

    def next_change_s(self, at_s: float) -> float:
        """Return when it will begin to move after then; inf: never."""
        place = bisect_right(self._starts, at_s)
        return self._starts[place] if place < len(self._starts) else math.inf

    def told(self, from_s: float, to_s: float) -> list[dict[str, object]]:
        """Return the truth as rows: from when, which state, how far open; MOVING in between."""
        rows: list[dict[str, object]] = []
        for start_s, target in zip(self._starts, self._targets, strict=True):
            settled_s = max(start_s + MOVES_S, from_s)
            following_s = self.next_change_s(start_s)
            if start_s >= to_s or following_s <= from_s:
                continue
            if start_s > from_s:
                rows.append({"from_s": round(start_s, 3), "state": "MOVING"})
            if settled_s < min(following_s, to_s):
                rows.append(self._row(settled_s, target))
        return rows

    def _row(self, from_s: float, amounts: Amounts) -> dict[str, object]:
        angle = self.body.angle_deg(amounts)
        return {
            "from_s": round(from_s, 3),
            "state": self.body.word(amounts),
            "opening": round(self.body.opening(amounts), 4),
            "angle_deg": None if angle is None else round(angle, 1),
        }


def built(
    door: PlanDoor, *, rng: np.random.Generator, glass_share: float, drawing_m: float,
    wall_m: float, side: int,
) -> DoorBody:  # fmt: skip
    """Return a door as somebody built it.

    Args:
        door: As it was drawn.
        rng: Where all chance comes from.
        glass_share: How many doors are of glass.
        drawing_m: Standard deviation of the drawing's error, along each axis.
        wall_m: How thick the wall is.
        side: To which side it swings.
    """
    kind = _body_kind(door.kind)
    pocket = rng.random() < 0.5
    recess_m = rng.uniform(-0.03, 0.10)
    if kind in SLIDES:  # in a pocket of the wall, or hung before it
        recess_m = rng.uniform(-0.01, 0.02) if pocket else wall_m / 2 + 0.03
    shift = rng.normal(0, drawing_m, 2).clip(-3 * drawing_m, 3 * drawing_m)
    surfaces = [Surface.PAINT, Surface.WOOD, Surface.DARK, Surface.SHINY]
    return DoorBody(
        drawn=door, kind=kind, glass=bool(rng.random() < glass_share),
        shifted=(float(shift[0]), float(shift[1])), hinge_at_end=bool(rng.random() < 0.5),
        side=side, recess_m=float(recess_m),
        surface=Surface(rng.choice(surfaces, p=[0.5, 0.3, 0.1, 0.1])),
    )  # fmt: skip


def _body_kind(kind: str) -> str:
    """Return how a door of that Open-RMF kind moves."""
    known = {"single_sliding": SLIDING, "single_telescope": SLIDING,
             "double_telescope": DOUBLE_SLIDING, "single_swing": HINGED,
             "double_swing": DOUBLE}  # fmt: skip
    kind = known.get(kind, kind)
    return kind if kind in {DOUBLE, SLIDING, DOUBLE_SLIDING, FOLDING} else HINGED


def standing(body: DoorBody, word: str, rng: np.random.Generator) -> Amounts:
    """Return some way in which a door can stand so: OPEN, CLOSED or AJAR."""
    if body.kind in SLIDES:
        share = {"CLOSED": 0.0, "AJAR": rng.uniform(0.1, 0.45), "OPEN": rng.uniform(0.7, 1.0)}[word]
        return share, share
    most = 85 if body.kind == FOLDING else 112
    degrees = {
        "CLOSED": abs(rng.normal(0, 1.0)), "AJAR": rng.uniform(10, 45),
        "OPEN": rng.uniform(62, most),
    }[word]  # fmt: skip
    first = math.radians(degrees)
    if body.kind != DOUBLE:
        return first, first
    if word == "OPEN" and rng.random() < 0.4:  # one leaf of two: half of the width, just open
        return math.radians(max(degrees, 90)), 0.0
    lowest = {"CLOSED": 0.0, "AJAR": 10.0, "OPEN": 62.0}[word]
    return first, math.radians(max(lowest, degrees * rng.uniform(0.85, 1.0)))
