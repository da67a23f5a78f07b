"""How likely each range is, were the leaf so and the robot a little beside its place.

The beam model is that of laser localisation (hit, short, lost, stray: Thrun, Burgard, Fox,
"Probabilistic Robotics", 6.3), with a leaf or else the room behind the door as what is hit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.scans.door_beams import DoorBeams
from semmap_log.scans.leaves import Leaves
from semmap_log.scans.scan_model import ScanModel

SHIFTS = np.array([(0, 0), (0, 1), (0, -1), (0, 2), (0, -2), (1.5, 0), (-1.5, 0)], np.float32)
"""Of the laser in the door's frame, in standard deviations: along the line, across it."""
BEFORE = 0.15
"""m; a leaf that is nearer to the robot than the line by more looks like anybody who stands there."""
PERSUADES = 0.05
"""By how much less such a leaf counts."""
ROOT_TWO_PI = np.float32(2.5066282)

Table = NDArray[np.float32]


def shift_log_weights() -> NDArray[np.float64]:
    """Return (s,) the log of how likely each shift is."""
    log_weights = -0.5 * (SHIFTS.astype(np.float64) ** 2).sum(1)
    return np.asarray(log_weights - np.log(np.exp(log_weights).sum()))


def log_likelihoods(
    beams: DoorBeams, leaves: Leaves, glass: NDArray[np.float64], model: ScanModel
) -> Table:
    """Return (m, s, h): log p(range | shift of the laser, stand of the leaves) of each beam.

    `glass` (m,): P(the beam passes a leaf).
    """

    def column(values):
        return values.astype(np.float32)[:, None, None]

    x, y, ux, uy, width, sd = map(
        column, (beams.x, beams.y, beams.ux, beams.uy, beams.width, beams.sd)
    )
    lost = ~np.isfinite(beams.range)[:, None, None]
    rng = column(np.where(np.isfinite(beams.range), beams.range, beams.max_range))
    ox, oy = x + sd * SHIFTS[:, :1], y + sd * SHIFTS[:, 1:]
    plane = -oy / uy
    where = ox + plane * ux
    wall = (where < 0) | (where > width)
    stop = np.full((len(x), len(SHIFTS), len(leaves.clear)), np.inf, np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(leaves.turns.shape[1]):
            ex, ey = np.cos(leaves.turns[:, k]), np.sin(leaves.turns[:, k])
            ax, ay = leaves.starts[:, k, 0] * width, leaves.starts[:, k, 1] * width
            cross = 1 / (ux * ey - uy * ex)
            far = ((ax - ox) * ey - (ay - oy) * ex) * cross
            along = ((ax - ox) * uy - (ay - oy) * ux) * cross
            met = (far > 0.05) & (along >= 0) & (along <= leaves.lengths[:, k] * width)
            stop = np.where(met & (far < stop), far, stop)
    stop = np.where(wall, np.minimum(stop, plane), stop)
    hits = np.isfinite(stop)
    stop = np.where(hits, stop, plane)
    spread = np.sqrt(model.sd_range**2 + (0.5 * sd / np.abs(uy)) ** 2)
    rest = 1 - model.short - model.stray
    near = np.exp(-0.5 * ((rng - stop) / spread) ** 2) / (spread * ROOT_TWO_PI)
    near = np.where(
        stop < plane - BEFORE,
        PERSUADES * near + model.short * (rng < stop + 0.3) / np.maximum(stop, 0.5),
        near,
    )
    beyond = np.where(
        rng > stop - 0.05, np.exp(-np.clip(rng - stop, 0, None) / model.room) / model.room, 0
    )
    front = np.where(rng < stop, 1 / np.maximum(stop, 0.1), 0)
    g = column(glass)
    p = np.where(
        hits,
        rest * ((1 - g) * (1 - model.lost_shut) * near + g * beyond),
        rest * (1 - model.lost_open) * beyond,
    )
    p = p + model.short * front + model.stray / column(beams.max_range)
    gone = (
        rest * np.where(hits, (1 - g) * model.lost_shut + g * model.lost_open, model.lost_open)
        + 0.01
    )
    return np.log(np.where(lost, gone, p)).astype(np.float32)
