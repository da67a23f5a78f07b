"""Doors as bodies: what is clear of them, where their leaves stand, what the truth says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from patrol_sim.laser_casting import cast
from patrol_sim.laser_doors import MOVES_S, DoorLife, standing
from patrol_sim.laser_surfaces import Surface
from patrol_sim.tests.corridor import body

KINDS = ("hinged", "double_hinged", "sliding", "double_sliding", "folding")


def clear_share(kind: str, amount: float) -> float:
    """Return the share of the doorway through which parallel beams, straight on, go."""
    xs = np.linspace(0.0005, 0.9995, 1000)
    door = body(kind)
    lines = door.lines((amount, amount)).ends
    through = [
        cast(np.array([[x, -3.0]]), np.array([math.pi / 2]), lines, most_m=6).ranges[0] == math.inf
        for x in xs
    ]
    return float(np.mean(through))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [0.0, 0.15, 0.4, 0.8])
def test_opening_is_the_share_that_beams_straight_on_go_through(kind: str, share: float) -> None:
    """
    What the truth calls the opening is what is clear, but for the leaf's thickness and its gaps.
    """
    amount = share if "sliding" in kind else math.acos(1 - share)

    assert body(kind).opening((amount, amount)) == pytest.approx(share)
    assert clear_share(kind, amount) == pytest.approx(share, abs=0.065)


@pytest.mark.parametrize("at_end", [False, True])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("recess", [-0.03, 0.1])
def test_leaf_swings_about_its_hinge(at_end: bool, side: int, recess: float) -> None:
    """The leaf begins at its hinge, in its recess, and ends its width from there, on its side."""
    door = body(hinge_at_end=at_end, side=side, recess_m=recess)

    [(hinge, tip)] = door.panels((math.radians(60),) * 2)

    assert hinge[0] == pytest.approx(1 if at_end else 0, abs=0.006)
    assert hinge[1] == pytest.approx(side * recess)
    assert math.dist(hinge, tip) == pytest.approx(0.99)
    assert tip[1] - hinge[1] == pytest.approx(side * 0.99 * math.sin(math.radians(60)))


def test_leaf_has_two_faces() -> None:
    """From either side a beam ends 2 cm before the leaf's middle."""
    lines = body().lines((0.0, 0.0)).ends
    for y, bearing in ((-1.0, math.pi / 2), (1.0, -math.pi / 2)):
        hit = cast(np.array([[0.5, y]]), np.array([bearing]), lines, most_m=3)

        assert hit.ranges[0] == pytest.approx(0.98)


def test_glass_leaf_has_opaque_stiles() -> None:
    """A pane in the middle, 8 cm of frame at both ends."""
    lines = body(glass=True).lines((0.0, 0.0))
    pane = lines.ends[lines.surface == Surface.GLASS]

    assert pane.shape == (1, 4)
    assert pane[0].tolist() == pytest.approx([0.085, 0, 0.915, 0])
    assert (lines.surface != Surface.GLASS).any()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("word", ["OPEN", "CLOSED", "AJAR"])
def test_doors_stand_as_asked(kind: str, word: str) -> None:
    """Whatever chance picks, the door's opening bears the word."""
    rng = np.random.default_rng(1)
    door = body(kind)

    assert {door.word(standing(door, word, rng)) for _ in range(200)} == {word}


def test_life_moves_between_its_rests() -> None:
    """A change takes its time; before and after it the door stands still."""
    life = DoorLife(body(), (0.0, 0.0))
    life.change(10.0, (1.5, 1.5))

    assert life.amounts(10.0) == (0.0, 0.0)
    assert life.amounts(10 + MOVES_S / 2) == pytest.approx((0.75, 0.75))
    assert life.amounts(10 + MOVES_S) == (1.5, 1.5)
    assert not life.moves(0, 9.9)
    assert life.moves(9, 10)
    assert life.moves(12.4, 13)
    assert not life.moves(12.6, 99)


def test_held_door_forgets_what_was_to_come() -> None:
    """A door that is held for the robot does not fall shut meanwhile; later changes stay."""
    life = DoorLife(body(), (0.0, 0.0))
    for at_s in (5.0, 20.0):
        life.change(at_s, (0.0, 0.0))
    life.change(4.0, (1.5, 1.5), holds_s=10)

    assert life.amounts(15.0) == (1.5, 1.5)
    assert life.amounts(30.0) == (0.0, 0.0)


def test_truth_tells_states_and_moves_in_order() -> None:
    """From the first second on: how it stood, that it moved, how it stood then."""
    life = DoorLife(replace(body(), kind="hinged"), (0.0, 0.0))
    life.change(10.0, (math.radians(30),) * 2)
    life.change(40.0, (math.radians(90),) * 2)

    rows = life.told(0.0, 41.0)

    assert [(row["from_s"], row["state"]) for row in rows] == [
        (0.0, "CLOSED"), (10.0, "MOVING"), (12.5, "AJAR"), (40.0, "MOVING"),
    ]  # fmt: skip
    assert rows[2]["angle_deg"] == 30.0
    assert rows[2]["opening"] == pytest.approx(1 - math.cos(math.radians(30)), abs=1e-4)
