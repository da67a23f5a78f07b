"""The beam model over arrays, against the same told once more for one beam, with loops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import cos, exp, hypot, inf, isinf, log, pi, sin, sqrt

import numpy as np
import pytest

from semmap_log.analysis.scans.beam_model import log_likelihoods, log_ratios, wall_log_likelihoods
from semmap_log.analysis.scans.door_beams import DoorBeams
from semmap_log.analysis.scans.leaves import LOG_WEIGHTS, SHIFTS, Leaves, leaves_of
from semmap_log.analysis.scans.visit import ScanModel

MODEL = ScanModel()
HIT = (1 - MODEL.short - MODEL.stray) * (1 - MODEL.lost)


def some_beams(count: int, seed: int) -> DoorBeams:
    """Return beams from both sides of doors; some of them did not come back."""
    rng = np.random.default_rng(seed)
    width = rng.uniform(0.6, 2.0, count)
    y = rng.uniform(0.4, 4, count) * rng.choice((-1, 1), count)
    target = rng.uniform(0.1, width - 0.1)
    x = rng.uniform(-3, 4, count)
    far = np.hypot(target - x, y)
    ranges = far + rng.choice((0, 0.05, -0.4, 0.5, 2.0, inf), count) + rng.normal(0, 0.02, count)
    return DoorBeams(
        sight=np.arange(count),
        x=x,
        y=y,
        ux=(target - x) / far,
        uy=-y / far,
        range=np.maximum(ranges, 0.1),
        max_range=np.full(count, 12.0),
        plane=far,
        width=width,
        sd=rng.uniform(0.04, 0.2, count),
        reaches=np.ones(count, bool),
    )


def spread_of(beams: DoorBeams, i: int, sine: float) -> float:
    return sqrt(MODEL.sd_range**2 + (0.5 * float(beams.sd[i]) / abs(sine)) ** 2)


def shifted_origin(beams: DoorBeams, i: int, shift: np.ndarray) -> tuple[float, float]:
    sd, side = float(beams.sd[i]), 1 if beams.y[i] > 0 else -1
    return float(beams.x[i]) + shift[0] * sd, float(beams.y[i]) + side * shift[1] * sd


def met_at(
    beams: DoorBeams, i: int, origin: tuple[float, float], leaves: Leaves, h: int
) -> Iterator[tuple[float, float, float]]:
    """Yield how far the beam goes to each leaf, P(it meets it), and the sine of the angle."""
    ux, uy, width = float(beams.ux[i]), float(beams.uy[i]), float(beams.width[i])
    for k in range(leaves.lengths.shape[1]):
        length = float(leaves.lengths[h, k]) * width
        turn = float(leaves.turns[h, k])
        ax, ay = (float(a) * width for a in leaves.starts[h, k])
        cross = ux * sin(turn) - uy * cos(turn)
        if not length or abs(cross) < 1e-4:
            continue
        dx, dy = ax - origin[0], ay - origin[1]
        far, along = (dx * sin(turn) - dy * cos(turn)) / cross, (dx * uy - dy * ux) / cross
        blurred = max(MODEL.blurred, 0.5 * float(beams.sd[i]) / abs(cross))
        inside = (length / 2 - abs(along - length / 2)) / (2 * blurred)
        if far > 0.05 and inside > -0.5:
            yield far, min(0.5 + inside, 1), cross


def one_log_likelihood(
    beams: DoorBeams, i: int, shift: np.ndarray, leaves: Leaves, h: int, *, glass: float,
    wall_there: float = 1,
) -> float:  # fmt: skip
    """Return log p of one range, as the module's docstring has it."""
    origin = shifted_origin(beams, i, shift)
    plane = -origin[1] / float(beams.uy[i])
    where = origin[0] + plane * float(beams.ux[i])
    is_wall = not 0 <= where <= beams.width[i]
    ended, largest = float(beams.range[i]), float(beams.max_range[i])
    is_lost = isinf(ended)
    lost_free = MODEL.lost + (1 - MODEL.lost) * exp(-max(largest - plane, 0) / MODEL.room)
    lost_free = MODEL.lost if is_wall else lost_free
    stray, short = MODEL.stray / largest, MODEL.short / max(plane, 0.1)
    depth = exp(-max(ended - plane, 0) / MODEL.room) / MODEL.room if ended > plane - 0.05 else 0

    def noise(place: float, sine: float) -> float:
        spread = spread_of(beams, i, sine)
        density = 2 / (pi * sqrt(3)) / spread * (1 + ((ended - place) / spread) ** 2 / 3) ** -2
        return HIT * (1 - glass) * density

    on_wall = wall_there * noise(plane, float(beams.uy[i])) + (1 - wall_there) * HIT * depth
    free = (on_wall if is_wall else HIT * depth) + (short if ended < plane else 0) + stray
    chance = lost_free if is_lost else free
    nearest = plane if is_wall and wall_there == 1 else inf
    for far, met, sine in met_at(beams, i, origin, leaves, h):
        if far >= nearest:
            continue
        like_anybody = MODEL.persuades if far < plane - MODEL.before else 1
        ends = short if ended < far else HIT * glass * depth
        on_leaf = noise(far, sine) * like_anybody + ends + stray
        if is_lost:
            on_leaf = MODEL.lost + glass * (lost_free - MODEL.lost)
        chance += met * (on_leaf - chance)
        nearest = min(nearest, far) if met >= 0.5 else nearest
    return log(chance)


@pytest.mark.parametrize("kind", ["", "double", "sliding", "folding"])
@pytest.mark.parametrize("glass", [0.01, 0.6])
def test_many_beams_at_once_are_each_as_alone(kind: str, glass: float) -> None:
    beams, leaves = some_beams(12, seed=len(kind)), leaves_of(kind)

    table = log_likelihoods(beams, leaves, np.full(12, glass), MODEL)

    assert (12, len(SHIFTS), len(leaves.clear)) == table.shape
    wrong = 0
    for i in range(12):
        for s, shift in enumerate(SHIFTS):
            for h in range(len(leaves.clear)):
                alone = one_log_likelihood(beams, i, shift, leaves, h, glass=glass)
                wrong += abs(alone - float(table[i, s, h])) > 0.02
    # single floats decide otherwise only where one leaf just hides another
    assert wrong <= 0.002 * table.size


def test_beams_beside_a_door_tell_of_its_leaf_alone() -> None:
    """What they say of the wall is the same however the leaf stands, and told elsewhere."""
    beams, leaves = some_beams(12, seed=3), leaves_of("hinged")
    beams = replace(beams, x=beams.x - beams.width)
    gone = int(np.flatnonzero((leaves.lengths == 0).all(1))[0])

    table = log_ratios(beams, leaves, np.full(12, 0.01), MODEL)

    assert not table[:, :, gone].any()
    for i in range(12):
        for h in range(len(leaves.clear)):
            alone, free = (
                one_log_likelihood(
                    beams, i, SHIFTS[2], leaves, row, glass=0.01, wall_there=MODEL.wall_there
                )
                for row in (h, gone)
            )
            assert float(table[i, 2, h]) == pytest.approx(alone - free, abs=0.02)


def test_a_stand_without_a_leaf_stops_no_beam() -> None:
    """Nor one that crosses the line just where a leaf would begin."""
    beams, leaves = some_beams(8, seed=1), leaves_of("double")
    beams = replace(
        beams,
        x=np.full(8, 0.0004),
        y=np.full(8, -2.0),
        ux=np.zeros(8),
        uy=np.ones(8),
        range=np.full(8, 2.0),
        plane=np.full(8, 2.0),
        width=np.ones(8),
    )

    table = log_likelihoods(beams, leaves, np.full(8, 0.01), MODEL)

    (gone,) = np.flatnonzero((leaves.lengths == 0).all(1)).tolist()
    alone = [one_log_likelihood(beams, i, SHIFTS[0], leaves, gone, glass=0.01) for i in range(8)]
    assert table[:, 0, gone] == pytest.approx(alone, abs=0.01)


def test_walls_beside_a_door_tell_how_far_the_laser_is_off() -> None:
    """Beams end 0.2 m behind the line, though the model believes in 5 cm."""
    beams = some_beams(300, seed=4)
    behind = np.hypot(beams.ux, beams.uy) * 0.2 / np.abs(beams.uy)
    beams = replace(beams, range=beams.plane + behind, sd=np.full(300, 0.057))

    table = wall_log_likelihoods(beams, MODEL).sum(0)

    assert (0.0, 3.5) == tuple(SHIFTS[table[:-1].argmax()])
    assert table.argmax() < len(SHIFTS), "the wall is in line"


def test_shifts_are_all_that_there_is() -> None:
    assert np.exp(LOG_WEIGHTS).sum() == pytest.approx(1)
    assert (0, 0) == tuple(SHIFTS[0]) == tuple(SHIFTS[LOG_WEIGHTS.argmax()])
    assert hypot(*SHIFTS[-1]) == 1.5
