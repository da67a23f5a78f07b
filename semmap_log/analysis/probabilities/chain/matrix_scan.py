"""A door as a hidden Markov chain in continuous time, by products of many 2 x 2 matrices.

The chain has two states. Looks come at arbitrary times and are never certain: they count by their
likelihood. This is the continuous-time form of the hidden Markov models of Meyer-Delius et al.
(AAAI 2012) for cells that change.

Products are taken without a loop over all matrices. The sequence is cut into blocks that are
multiplied side by side; then their products are chained. It is the two-level form of a parallel
prefix sum (Blelloch 1990). Where the cuts are does not depend on how many matrices follow, so that
the result at each place is the same to the last digit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

CLOSED, OPEN = 0, 1


@dataclass(frozen=True, slots=True)
class Steps:
    """Transitions from each look to the next, of some chains."""

    from_closed: Reals
    """(n, chains): P(open at look i | closed at the one before)."""
    from_open: Reals
    """(n, chains): P(open at look i | open at the one before)."""

    def predicted(self, before: Reals) -> Reals:
        """Return (n, chains): P(open) at each look, where it was (n, chains) at the one before."""
        return self.from_closed + before * (self.from_open - self.from_closed)


def filtered(steps: Steps, llr: Reals, first: Reals) -> tuple[Reals, Reals]:
    """Return P(open) at each look, from the looks up to it and from those before it.

    Args:
        steps: Of chains.
        llr: (n,), what is seen at each.
        first: (chains,), P(open) before the first.

    Returns:
        Both (n, chains).
    """
    after = states(step_matrices(steps, llr), np.stack([1 - first, first]))[OPEN]
    return after, np.concatenate([first[None], after])[:-1]


def likelihood(p_open: Reals, llr: Reals) -> Reals:
    """Return (n, chains): how likely it is to see that, (n,); up to a constant of the sensor."""
    sees = _sigmoid(llr)[:, None]
    found: Reals = p_open * sees + (1 - p_open) * (1 - sees)
    return found


def weighed(p_open: Reals, llr: Reals) -> Reals:
    """Return (n, chains): P(open) after something was seen, (n,), where it was that before."""
    found: Reals = p_open * _sigmoid(llr)[:, None] / likelihood(p_open, llr)
    return found


def step_matrices(steps: Steps, llr: Reals) -> Reals:
    """Return (2, 2, n, chains): from the closed and open weight at a look to those at the next."""
    opened = _sigmoid(llr)[:, None]
    matrices = np.empty((2, 2, *steps.from_open.shape))
    matrices[CLOSED, CLOSED] = (1 - opened) * (1 - steps.from_closed)
    matrices[CLOSED, OPEN] = (1 - opened) * (1 - steps.from_open)
    matrices[OPEN, CLOSED] = opened * steps.from_closed
    matrices[OPEN, OPEN] = opened * steps.from_open
    return matrices


def _sigmoid(x: Reals) -> Reals:
    found: Reals = 1 / (1 + np.exp(-x))
    return found


Matrices = NDArray[np.float64]

FIRST_LENGTH = 8
"""Of the first blocks; 4 n matrices on they are twice as long, and so on: about as many blocks as
each is long."""


MOST_STEPS = 8192
"""Matrices that are multiplied side by side: more would fill memory."""


def states(matrices: Matrices, first: NDArray[np.float64]) -> NDArray[np.float64]:
    """Apply the matrices to vectors, one after another, and return all results.

    Args:
        matrices: (2, 2, n, chains), none negative; step i of a chain is `matrices[:, :, i, chain]`.
        first: (2, chains), what stands before the first.

    Returns:
        (2, n, chains): matrix i x ... x matrix 0 x first, each scaled to the sum 1. It is the same
        whatever matrices follow i.
    """
    found = np.empty((2, *matrices.shape[2:]))
    for start, end, length in _parts(matrices.shape[2]):
        found[:, start:end] = _of_part(matrices[:, :, start:end], first, length)
        first = found[:, end - 1]
    return found


def _parts(count: int) -> Iterator[tuple[int, int, int]]:
    """Yield (start, end, how long a block is) of parts that double the length of their blocks."""
    start, length = 0, FIRST_LENGTH
    while start < count:
        end = max(4 * start, FIRST_LENGTH**2)
        yield start, min(end, count), length
        length, start = length if start == 0 else 2 * length, end


def _of_part(matrices: Matrices, first: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """Return `states` of some matrices, in blocks of that length."""
    found = np.empty((2, *matrices.shape[2:]))
    step = max(MOST_STEPS // length, 1) * length
    for start in range(0, matrices.shape[2], step):
        part = slice(start, start + step)
        found[:, part], first = _of_blocks(matrices[:, :, part], first, length)
    return found


def _of_blocks(
    matrices: Matrices, first: NDArray[np.float64], length: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return `states` of some blocks, and the vector that stands before the next block."""
    count, chains = matrices.shape[2:]
    blocks = -(-count // length)
    padded = np.zeros((2, 2, blocks * length, chains))
    padded[0, 0] = padded[1, 1] = 1.0
    padded[:, :, :count] = matrices
    # The step is the outer axis, so that each step's matrices of all blocks lie together.
    steps = np.ascontiguousarray(padded.reshape(2, 2, blocks, length, -1).transpose(3, 0, 1, 2, 4))
    products = _products(steps)
    starts, behind = _chained(products[-1], first)
    found = products[:, :, 0] * starts[0] + products[:, :, 1] * starts[1]
    vectors = found.transpose(1, 2, 0, 3).reshape(2, -1, chains)[:, :count]
    scaled: NDArray[np.float64] = vectors / (vectors[0] + vectors[1])
    return scaled, behind


def _products(steps: Matrices) -> Matrices:
    """Return (length, 2, 2, blocks, chains): in each block, the product up to each step, scaled."""
    found = np.empty_like(steps)
    found[0] = steps[0] / _total(steps[0])
    for i in range(1, len(steps)):
        here, before, after = steps[i], found[i - 1], found[i]
        np.multiply(here[:, 0, None], before[0], out=after)
        after += here[:, 1, None] * before[1]
        after /= _total(after)
    return found


def _total(matrices: Matrices) -> NDArray[np.float64]:
    """Return (blocks, chains): the sum of each; in this order, however many there are."""
    total: NDArray[np.float64] = matrices[0, 0] + matrices[0, 1] + matrices[1, 0] + matrices[1, 1]
    return total


def _chained(
    products: Matrices, first: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (2, blocks, chains): the scaled vector before each block; and that after the last."""
    found = np.empty((2, *products.shape[2:]))
    here = first
    for block in range(products.shape[2]):
        found[:, block] = here
        here = products[:, 0, block] * here[0] + products[:, 1, block] * here[1]
        here = here / (here[0] + here[1])
    return found, here
