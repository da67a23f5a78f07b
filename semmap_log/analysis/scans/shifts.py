"""How far the laser may really be from where it is believed to be: the same through a visit.

The error of a localisation is slow: it is shared by all scans of a visit, and taken out at the
visit's end, once. Told standard deviations are often too small. Were their scale unknown, with an
inverse gamma prior, the error has Student's t distribution: small shifts as in a normal one, but
now and then a large one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.door_beams import DoorBeams

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
