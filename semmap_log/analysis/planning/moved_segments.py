"""Better orders of many stops: pieces of an order are turned round or moved, while that helps.

2-opt and or-opt for the mean time to visit. What an order costs that is put together from pieces
of another follows from three numbers of each piece: how long it takes, the sum of its P, and what
it would cost by itself (M. Silva et al., Eur. J. Oper. Res. 221, 2012). So a step looks at all
moves at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.planning.exact_order import onward
from semmap_log.analysis.planning.round_task import Orders, RoundTask

Places = NDArray[np.intp]
Reals = NDArray[np.float64]

LONGEST_MOVED = 3
"""Stops in a piece that moves."""
_GAINS = 1e-9
"""Of the cost: less is rounding."""


def improved(task: RoundTask, order: Orders) -> Orders:
    """Return an order that no such move makes better: the same for the same arguments.

    Args:
        task: P as at the start, no budget.
        order: To begin with, of all stops.
    """
    if len(order) < 2:
        return order
    round_ = _Round.of(task)
    pieces = _Pieces.of(round_, np.concatenate([[round_.start], order, [round_.end]]))
    kinds = list(_kinds(len(order)))
    gained = True
    while gained:
        gained = False
        for kind in kinds:
            better = _with_best_move(pieces, kind)
            gained |= better is not pieces
            pieces = better
    return pieces.path[1:-1]


@dataclass(frozen=True, slots=True, eq=False)
class _Round:
    """A task with its start and its end as stops that weigh nothing."""

    onward_s: Reals
    weights: Reals
    start: int
    end: int

    @classmethod
    def of(cls, task: RoundTask) -> _Round:
        count = len(task)
        onward_s = np.zeros((count + 2, count + 2))
        onward_s[:count, :count] = onward(task)
        onward_s[count, :count] = task.from_start_s
        return cls(onward_s, np.append(task.p_passes[:, 0], [0.0, 0.0]), count, count + 1)


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    """Pieces of a path, many at once: the numbers that tell what a path of them costs."""

    takes_s: Reals
    weight: Reals
    cost: Reals
    """If one were at its first stop at time 0."""
    first: Places
    """The stop."""
    last: Places


@dataclass(frozen=True, slots=True, eq=False)
class _Pieces:
    """A path, and sums along it, from which each of its pieces is told without a loop."""

    round: _Round
    path: Orders
    there_s: Reals
    """(n + 2,): when one comes to each place of the path."""
    back_s: Reals
    """(n + 2,): when one would, along the path backward, from its end."""
    weight: Reals
    """(n + 3,): of all places before each."""
    there: Reals
    """(n + 3,): weight x time, of all places before each."""
    back: Reals

    @classmethod
    def of(cls, round_: _Round, path: Orders) -> _Pieces:
        there_s = np.append(0.0, np.cumsum(round_.onward_s[path[:-1], path[1:]]))
        steps_back_s = round_.onward_s[path[1:], path[:-1]]
        back_s = np.append(np.cumsum(steps_back_s[::-1])[::-1], 0.0)
        weights = round_.weights[path]
        sums = (np.append(0.0, np.cumsum(each))
                for each in (weights, weights * there_s, weights * back_s))  # fmt: skip
        return cls(round_, path, there_s, back_s, *sums)

    @property
    def cost(self) -> float:
        return float(self.there[-1])

    def forward(self, low: Places, high: Places) -> _Piece:
        """Return the pieces from place `low` to place `high`, both of them included."""
        weight = self.weight[high + 1] - self.weight[low]
        cost = self.there[high + 1] - self.there[low] - self.there_s[low] * weight
        takes_s = self.there_s[high] - self.there_s[low]
        return _Piece(takes_s, weight, cost, self.path[low], self.path[high])

    def backward(self, low: Places, high: Places) -> _Piece:
        """Return the same pieces from `high` to `low`."""
        weight = self.weight[high + 1] - self.weight[low]
        cost = self.back[high + 1] - self.back[low] - self.back_s[high] * weight
        takes_s = self.back_s[low] - self.back_s[high]
        return _Piece(takes_s, weight, cost, self.path[high], self.path[low])

    def cost_of(self, pieces: list[_Piece]) -> Reals:
        """Return the cost of paths of these pieces, one behind the other."""
        now_s, cost = pieces[0].takes_s, pieces[0].cost
        for before, piece in pairwise(pieces):
            arrives_s = now_s + self.round.onward_s[before.last, piece.first]
            cost = cost + piece.cost + piece.weight * arrives_s
            now_s = arrives_s + piece.takes_s
        return cost


@dataclass(frozen=True, slots=True, eq=False)
class _Moves:
    """Moves of one kind: what each would cost, and the path that the best of them gives."""

    costs: Reals
    low: Places
    middle: Places
    """Place of the last stop of the first of two pieces that change places."""
    high: Places
    is_turned: tuple[bool, bool]
    """Whether each of the two is turned round; one that is no piece has no stops."""

    def blocks(self, best: int) -> list[slice]:
        low, middle, high = (int(each[best]) for each in (self.low, self.middle, self.high))
        first, second = (low, middle), (middle + 1, high)
        turned_first, turned_second = self.is_turned
        inner = [_block(*second, turned_second), _block(*first, turned_first)]
        return [slice(0, low), *inner, slice(high + 1, None)]


def _block(low: int, high: int, is_turned: bool) -> slice:  # noqa: FBT001 - private
    return slice(high, low - 1, -1) if is_turned and high >= low else slice(low, high + 1)


_Kind = Callable[[_Pieces], _Moves]


def _kinds(count: int) -> Iterator[_Kind]:
    """Yield the kinds of moves on a path of so many stops, each with all its places."""
    low, high = (each + 1 for each in np.triu_indices(count, 1))
    yield partial(_turned, low=low, high=high)
    for length in range(1, min(LONGEST_MOVED, count - 1) + 1):
        fits = high - low >= length
        few, many = low[fits], high[fits]
        for is_turned in (False, True)[: 1 + (length > 1)]:
            first, second = (is_turned, False), (False, is_turned)
            yield partial(_swapped, low=few, middle=few + length - 1, high=many, is_turned=first)
            yield partial(_swapped, low=few, middle=many - length, high=many, is_turned=second)


def _with_best_move(pieces: _Pieces, kind: _Kind) -> _Pieces:
    """Return the path after the best move of a kind; the same where none gains anything."""
    moves = kind(pieces)
    best = int(moves.costs.argmin())
    if pieces.cost - float(moves.costs[best]) <= _GAINS * max(pieces.cost, 1.0):
        return pieces
    path = np.concatenate([pieces.path[block] for block in moves.blocks(best)])
    return _Pieces.of(pieces.round, path)


def _turned(pieces: _Pieces, low: Places, high: Places) -> _Moves:
    """Return the moves that turn a piece round."""
    path = [_head(pieces, low), pieces.backward(low, high), _tail(pieces, high)]
    return _Moves(pieces.cost_of(path), low, high, high, (True, False))


def _swapped(
    pieces: _Pieces, low: Places, middle: Places, high: Places, is_turned: tuple[bool, bool]
) -> _Moves:
    """Return the moves that let two pieces, one behind the other, change places."""
    first, second = ((pieces.backward if turned else pieces.forward) for turned in is_turned)
    path = [
        _head(pieces, low), second(middle + 1, high), first(low, middle), _tail(pieces, high)
    ]  # fmt: skip
    return _Moves(pieces.cost_of(path), low, middle, high, is_turned)


def _head(pieces: _Pieces, low: Places) -> _Piece:
    return pieces.forward(np.zeros_like(low), low - 1)


def _tail(pieces: _Pieces, high: Places) -> _Piece:
    return pieces.forward(high + 1, np.full_like(high, len(pieces.path) - 1))
