"""The oracle: a flood fill, cell by cell, as anybody would write it; and scipy's, where it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

EDGES = ((1, 0), (-1, 0), (0, 1), (0, -1))
CORNERS = ((1, 1), (1, -1), (-1, 1), (-1, -1))


def flooded(free: NDArray[np.bool_], *, by_corners: bool = False) -> NDArray[np.int64]:
    """Return the 4-connected regions, numbered from 1 in the order of their first cells.

    By corners, too: the 8-connected ones.
    """
    steps = EDGES + CORNERS if by_corners else EDGES
    labels = np.zeros(free.shape, np.int64)
    count = 0
    for first in zip(*np.nonzero(free), strict=True):
        if labels[first]:
            continue
        count += 1
        labels[first] = count
        left = [first]
        while left:
            row, column = left.pop()
            for up, right in steps:
                cell = row + up, column + right
                inside = 0 <= cell[0] < free.shape[0] and 0 <= cell[1] < free.shape[1]
                if inside and free[cell] and not labels[cell]:
                    labels[cell] = count
                    left.append(cell)
    return labels
