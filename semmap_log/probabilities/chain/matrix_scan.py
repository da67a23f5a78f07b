"""Products of many 2 x 2 matrices, one after another, without a loop over all of them.

The sequence is cut into as many blocks as each is long, and all blocks are multiplied side by side;
then their products are chained. It is the two-level form of a parallel prefix sum (Blelloch 1990).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Matrices = NDArray[np.float64]


def states(matrices: Matrices, first: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what the matrices make of a vector, one after another.

    Args:
        matrices: (2, 2, n), none negative; matrix i is `matrices[:, :, i]`.
        first: (2,), what stands before the first.

    Returns:
        (2, n): matrix i x ... x matrix 0 x first, each scaled to the sum 1.
    """
    count = matrices.shape[2]
    if not count:
        return np.empty((2, 0))
    length = math.isqrt(count - 1) + 1
    blocks = -(-count // length)
    padded = np.zeros((2, 2, blocks * length))
    padded[0, 0] = padded[1, 1] = 1.0
    padded[:, :, :count] = matrices
    # The step is the outer axis, so that each step's matrices of all blocks lie together.
    steps = np.ascontiguousarray(padded.reshape(2, 2, blocks, length).transpose(3, 0, 1, 2))
    products = _products(steps)
    starts = _chained(products[-1], first)
    found = products[:, :, 0] * starts[0] + products[:, :, 1] * starts[1]
    vectors = found.transpose(1, 2, 0).reshape(2, -1)[:, :count]
    scaled: NDArray[np.float64] = vectors / vectors.sum(0)
    return scaled


def _products(steps: Matrices) -> Matrices:
    """Return (length, 2, 2, blocks): in each block, the product up to each step, scaled."""
    found = np.empty_like(steps)
    found[0] = steps[0] / steps[0].sum((0, 1))
    for i in range(1, len(steps)):
        here, before, after = steps[i], found[i - 1], found[i]
        np.multiply(here[:, 0, None], before[0], out=after)
        after += here[:, 1, None] * before[1]
        after /= after.sum((0, 1))
    return found


def _chained(products: Matrices, first: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (2, blocks): the vector before each block, scaled."""
    found = np.empty((2, products.shape[2]))
    zero, one = first.tolist()
    for block, ((a, b), (c, d)) in enumerate(products.transpose(2, 0, 1).tolist()):
        found[:, block] = zero, one
        zero, one = a * zero + b * one, c * zero + d * one
        total = zero + one
        zero, one = zero / total, one / total
    return found
