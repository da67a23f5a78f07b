"""Scans of a corridor with a door, cast by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from semmap_log.analysis.scans.visit import PlacedScan, Visit
from semmap_log.core.model.doors import DoorState
from tests.analysis.scans.beams import ranges_at
from tests.analysis.scans.some_visits import some_visit

LINE = (2.0, 1.0, 0.0, 1.0)
"""A door in the wall y = 1, from x = 2 to x = 3."""
WALLS = [(-2, 1, 2, 1), (3, 1, 8, 1), (-2, -1, 8, -1), (-2, -1, -2, 1), (8, -1, 8, 1),
         (0, 4, 5, 4), (0, 1, 0, 4), (5, 1, 5, 4)]  # fmt: skip
"""A corridor, and a room behind the door."""
SHUT = (2.0, 1.0, 3.0, 1.0)


def some_scan(
    at_ns: int, x: float, y: float, *, leaf: Sequence[float] | None = None, beams: int = 180,
    **other: Any,
) -> PlacedScan:  # fmt: skip
    """What a laser at (x, y) sees, a turn of it; the leaf is x, y of both ends."""
    bearings = np.linspace(0, 2 * math.pi, beams, endpoint=False) + 0.01
    walls = [*WALLS, *([leaf] if leaf is not None else [])]
    told: dict[str, Any] = {
        "laser": "laser", "robot": "", "max_range": 10.0, "sd_xy": 0.05, "sd_theta": 0.02,
        "origins": np.tile([x, y], (beams, 1)), "ranges": ranges_at((x, y), bearings, walls),
    }  # fmt: skip
    return PlacedScan(stamp_ns=at_ns, level=0, bearings=bearings, **{**told, **other})


def seen_visit(
    at_s: float = 0.0, *, leaf: Sequence[float] | None = SHUT, scans: int = 5, **other: Any
) -> tuple[Visit, list[PlacedScan]]:
    """A visit to the door of `LINE` while a robot goes by, and its scans."""
    told: dict[str, Any] = {"state": DoorState.OPEN if leaf is None else DoorState.CLOSED}
    told["leaves"] = () if leaf is None else (tuple(leaf),)
    visit = some_visit(at_s=at_s, **{"laser": "laser", "scans": scans, **told, **other})
    stamps = np.linspace(visit.first_ns, visit.last_ns, scans).astype(np.int64)
    return visit, [
        some_scan(int(stamp), 1.0 + 0.5 * n, 0.0, leaf=leaf, robot=visit.robot, laser=visit.laser)
        for n, stamp in enumerate(stamps)
    ]
