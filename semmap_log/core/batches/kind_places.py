"""Where among many events those of each kind are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.loops import compiled


def places_by_kind(kinds: NDArray[np.uint8]) -> dict[int, NDArray[np.intp]]:
    """Return the places of each kind that is there, ascending; kinds ascend, too."""
    loops = compiled()
    if loops is None:
        there = np.flatnonzero(np.bincount(kinds)).tolist()
        return {kind: np.flatnonzero(kinds == kind) for kind in there}
    places, ends = np.empty(len(kinds), np.int64), np.empty(2**8, np.int64)
    loops.sort_places(kinds, places, ends)
    found, start = {}, 0
    for kind, end in enumerate(ends.tolist()):
        if end > start:
            found[kind] = places[start:end]
            start = end
    return found
