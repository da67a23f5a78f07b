"""A scan of a planar laser whose beams have their places on the map."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class PlacedScan:
    """One scan on the map of a level: where each beam begins, where it points, how far it went.

    A laser that moves while it turns, hangs upside down or is tilted is worked in by whoever places
    the scan: `origins` and `bearings` are those of each beam at its own moment.
    """

    stamp_ns: int
    """Of the first beam, nanoseconds since 1970."""
    level: int
    laser: str
    """Which laser: its frame."""
    origins: NDArray[np.float64]
    """(b, 2) m, frame `map`."""
    bearings: NDArray[np.float64]
    """(b,) rad, frame `map`; unwrapped: neighbours differ by less than pi, all in one direction."""
    ranges: NDArray[np.float64]
    """(b,) m along the floor; inf: the beam did not come back (no return, out of range); NaN: it
    was not measured, and says nothing."""
    max_range: float
    """m; farther than that a beam does not come back."""
    sd_xy: float = nan
    """Standard deviation of the laser's place on the map along each axis, m; NaN: not told."""
    sd_theta: float = nan
    """Of its heading, rad; NaN: not told."""
    robot: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class DoorPlaces:
    """The doors of a moment that have a place: rows belong together."""

    ids: NDArray[np.int64]
    """(n,)"""
    levels: NDArray[np.int64]
    """(n,) level numbers."""
    lines: NDArray[np.float64]
    """(n, 4): x, y of the start m, theta rad, width m; frame `map`."""
    kinds: tuple[str, ...]
    """(n,) the annotation `kind`: hinged, double, sliding, folding, …; empty: not known."""
    glass: NDArray[np.bool_]
    """(n,) the annotation `glass`."""
