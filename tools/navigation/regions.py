"""Which free cells hang together: 8-connected regions of a grid, by runs of its rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Labels = NDArray[np.int32]

NOWHERE = 0


def regions_of(free: NDArray[np.bool_]) -> Labels:
    """Return (rows, columns): the same number where a way leads from cell to cell, 0: not free.

    Ways lead to all eight neighbours.
    """
    rows, columns = free.shape
    # A column of nothing behind each row ends its last run.
    flat = np.zeros((rows, columns + 1), np.bool_)
    flat[:, :columns] = free
    edges = np.flatnonzero(np.diff(flat.reshape(-1), prepend=False))
    start, end = edges[0::2], edges[1::2]
    roots = _joined(len(start), *_touching(start, end, columns + 1))
    labels = np.zeros(flat.size, np.int32)
    labels[start] = roots + 1
    # What is written at starts and taken back at ends sums up to the runs' labels.
    labels[end] -= roots + 1
    return np.cumsum(labels, dtype=np.int32).reshape(rows, columns + 1)[:, :columns]


def _touching(
    start: NDArray[np.intp], end: NDArray[np.intp], width: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return (a, b): the pairs of runs that touch, of one row and the next."""
    # Moved down a row, a run touches those that begin before its end and end after its start.
    first = np.searchsorted(end, start + width, side="left")
    behind = np.searchsorted(start, end + width, side="right")
    count = np.maximum(behind - first, 0)
    above = np.repeat(np.arange(len(start)), count)
    within = np.arange(len(above)) - np.repeat(np.cumsum(count) - count, count)
    return above, np.repeat(first, count) + within


def _joined(count: int, a: NDArray[np.intp], b: NDArray[np.intp]) -> NDArray[np.int32]:
    """Return for each of so many nodes the least one that it hangs together with."""
    root = np.arange(count, dtype=np.int32)
    while True:
        least = np.minimum(root[a], root[b])
        before = root.copy()
        np.minimum.at(root, root[a], least)
        np.minimum.at(root, root[b], least)
        root = root[root]
        if (root == before).all():
            return root
