"""Values that somebody may have given in degrees, or in millimetres: no door is like that."""

from __future__ import annotations

import math
from collections.abc import Iterator

WIDEST_DOOR_M = 25.0
"""Gates of hangars are wider, and are asked about; nothing is refused."""
WIDEST_CELL_M = 1.0


def suspect_units(*, theta: float, width: float) -> Iterator[str]:
    """Yield what looks like another unit about a door's values, in words; NaN: not given."""
    yield from suspect_angle("theta", theta)
    if width > WIDEST_DOOR_M:
        yield f"width {width:g} m is more than a gate's: millimetres, or centimetres?"


def suspect_cells(*, resolution: float, theta: float) -> Iterator[str]:
    """Yield the same about a floor plan: the size of its cells and the yaw of its origin."""
    yield from suspect_angle("its origin's yaw", theta)
    if resolution > WIDEST_CELL_M:
        yield f"cells of {resolution:g} m are larger than doors: millimetres, or centimetres?"


def suspect_angle(what: str, angle: float) -> Iterator[str]:
    """Yield that an angle is more than a turn, if it is."""
    if abs(angle) > math.tau + 1e-6:
        yield f"{what} {angle:g} rad is more than a turn: degrees?"
