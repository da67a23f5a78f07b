"""Find the best order of stops: exactly where that is possible, else by local search.

Few stops whose probabilities do not change are ordered exactly: Held and Karp's algorithm, for
latency. A search starts from greedy orders, in which each next stop is the best by itself. It then
reverses or moves pieces of an order while that helps: 2-opt and or-opt for the mean time to visit.
The cost of an order that is put together from pieces of another follows from three numbers of each
piece: how long it takes, the sum of its P, and what it would cost by itself (M. Silva et al., Eur.
J. Oper. Res. 221, 2012). So a step looks at all moves at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.planning.round_task import Orders, RoundTask

MOST_SWEEPS = 40
"""Steps of the search with P at arrival: each looks at all orders near the last one."""


def best_order(
    task: RoundTask, *, given: Iterable[Orders] = (), sweeps: int = MOST_SWEEPS
) -> Orders:
    """Return the order of all stops with the least mean time to visit; deterministic.

    For up to `MOST_EXACT` stops whose P does not change it is optimal. Otherwise it is the best of
    searches from three or more orders: by value, nearest first, and as the stops are given. If P
    changes, or a budget ends the round, orders are evaluated at the times of arrival.

    Args:
        task: The stops.
        given: Additional orders to start from, such as the rest of a plan under way.
        sweeps: See `best_from`.
    """
    if task.is_fixed and len(task) <= MOST_EXACT:
        return exact_order(task)
    as_they_are = np.arange(len(task))
    starts = [greedy_order(task), nearest_order(task), as_they_are, *given]
    return best_from(task, starts, sweeps=sweeps)


def best_from(task: RoundTask, starts: list[Orders], *, sweeps: int = MOST_SWEEPS) -> Orders:
    """Return the best order that searches from these find; deterministic.

    Args:
        task: The stops.
        starts: At least one.
        sweeps: Steps with P at arrival; 0: only with P as it is at the arrival in each start.
    """
    found = [_improved(task, start) for start in starts]
    best = min(found, key=lambda order: float(task.cost(order[None])[0]))
    return best if task.is_fixed else _swept(task, best, sweeps)


def _improved(task: RoundTask, start: Orders) -> Orders:
    """Return a better order, by P at each stop's arrival in the previous order."""
    if task.is_fixed:
        return improved(task, start)
    best = start
    for _ in range(2):
        order = improved(_as_arrived(task, best), best)
        first, second = task.cost(np.array([best, order]))
        if second >= first:
            break
        best = order
    return best


def _as_arrived(task: RoundTask, order: Orders) -> RoundTask:
    times_s = np.empty(len(order))
    times_s[order] = task.arrivals(order[None])[0][0]
    return task.at(times_s)


def _swept(task: RoundTask, order: Orders, sweeps: int) -> Orders:
    """Return an order that no single move improves, evaluated at the times of arrival."""
    best = float(task.cost(order[None])[0])
    for _ in range(sweeps):
        near = _near(order)
        if not len(near):
            break
        costs = task.cost(near)
        place = int(costs.argmin())
        if costs[place] >= best - 1e-9 * max(1.0, abs(best)):
            break
        order, best = near[place], float(costs[place])
    return order


def _near(order: Orders) -> Orders:
    """Return the orders in which one stop is moved, or a piece reversed."""
    count = len(order)
    places = np.arange(count)
    moved = []
    for source in range(count):
        without = np.delete(places, source)
        moved += [np.insert(without, target, source) for target in range(count) if target != source]
    for low in range(count):
        for high in range(low + 2, count):
            turned = places.copy()
            turned[low : high + 1] = turned[low : high + 1][::-1]
            moved.append(turned)
    return order[np.array(moved, np.intp).reshape(-1, count)]


Values = NDArray[np.float64]


def greedy_order(task: RoundTask) -> Orders:
    """Return the greedy order by P per time.

    P is that at the time of arrival.
    """

    def worth(stops: Orders, leg_s: Values, p_passes: Values) -> Values:
        takes_s = leg_s + p_passes * task.enter_s[stops] + (1 - p_passes) * task.fail_s[stops]
        found: Values = p_passes / np.maximum(takes_s, 1e-9)
        return found

    return _by(task, worth)


def nearest_order(task: RoundTask) -> Orders:
    """Return the greedy order by distance."""
    return _by(task, lambda _stops, leg_s, _p: -leg_s)


def _by(task: RoundTask, worth: Callable[[Orders, Values, Values], Values]) -> Orders:
    left, order = np.arange(len(task)), list[int]()
    now_s = task.now_s
    while len(left):
        leg_s = task.leg_s[order[-1], left] if order else task.from_start_s[left]
        p_passes = task.p_at(left, now_s + leg_s)
        place = int(worth(left, leg_s, p_passes).argmax())
        stop, p = int(left[place]), float(p_passes[place])
        now_s += float(leg_s[place] + p * task.enter_s[stop] + (1 - p) * task.fail_s[stop])
        order.append(stop)
        left = np.delete(left, place)
    return np.array(order, np.intp)


Places = NDArray[np.intp]
Reals = NDArray[np.float64]

LONGEST_MOVED = 3
"""Stops in a piece that moves."""
_GAINS = 1e-9
"""Of the cost: less is rounding."""


def improved(task: RoundTask, order: Orders) -> Orders:
    """Return an order that no such move improves; deterministic.

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
    """A task with its start and its end as stops of weight 0."""

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
    """Pieces of a path, many at once: the numbers that give the cost of a path made of them."""

    takes_s: Reals
    weight: Reals
    cost: Reals
    """Cost with arrival at its first stop at time 0."""
    first: Places
    """The stop."""
    last: Places


@dataclass(frozen=True, slots=True, eq=False)
class _Pieces:
    """A path, and sums along it, from which each of its pieces follows without a loop."""

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
        """Return the cost of paths of these pieces, one after the other."""
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
    """Return the path after the best move of a kind; unchanged if none gains anything."""
    moves = kind(pieces)
    best = int(moves.costs.argmin())
    if pieces.cost - float(moves.costs[best]) <= _GAINS * max(pieces.cost, 1.0):
        return pieces
    path = np.concatenate([pieces.path[block] for block in moves.blocks(best)])
    return _Pieces.of(pieces.round, path)


def _turned(pieces: _Pieces, low: Places, high: Places) -> _Moves:
    """Return the moves that reverse a piece."""
    path = [_head(pieces, low), pieces.backward(low, high), _tail(pieces, high)]
    return _Moves(pieces.cost_of(path), low, high, high, (True, False))


def _swapped(
    pieces: _Pieces, low: Places, middle: Places, high: Places, is_turned: tuple[bool, bool]
) -> _Moves:
    """Return the moves that swap two consecutive pieces."""
    first, second = ((pieces.backward if turned else pieces.forward) for turned in is_turned)
    path = [
        _head(pieces, low), second(middle + 1, high), first(low, middle), _tail(pieces, high)
    ]  # fmt: skip
    return _Moves(pieces.cost_of(path), low, middle, high, is_turned)


def _head(pieces: _Pieces, low: Places) -> _Piece:
    return pieces.forward(np.zeros_like(low), low - 1)


def _tail(pieces: _Pieces, high: Places) -> _Piece:
    return pieces.forward(high + 1, np.full_like(high, len(pieces.path) - 1))


MOST_EXACT = 12
"""Stops; each one more doubles time and memory."""


def exact_order(task: RoundTask) -> Orders:
    """Return the order with the least mean time to visit.

    Each leg delays all stops not visited yet: its cost is its time, and the time spent at the stop
    before, times the sum of P of the remaining stops. That depends on which stops were visited and
    on the last one, not on their order (M. Held, R. Karp, J. SIAM 10, 1962). Ties are broken the
    same way every time.

    Args:
        task: Of at most `MOST_EXACT` stops; P as at the start, no budget.
    """
    count = len(task)
    if not count:
        return np.empty(0, np.intp)
    weights = task.p_passes[:, 0]
    onward_s = onward(task)
    members = (np.arange(1 << count)[:, None] >> np.arange(count)) & 1 > 0
    left = weights.sum() - members @ weights
    cost = np.full((1 << count, count), np.inf)
    before = np.full((1 << count, count), -1, np.int8)
    cost[1 << np.arange(count), np.arange(count)] = task.from_start_s * weights.sum()
    sizes = members.sum(axis=1)
    for size in range(1, count):
        sets = np.flatnonzero(sizes == size)
        reached = cost[sets][:, :, None] + onward_s * left[sets][:, None, None]
        best, last = reached.min(axis=1), reached.argmin(axis=1)
        row, stop = np.nonzero(~members[sets])
        with_it = sets[row] | (1 << stop)
        cost[with_it, stop] = best[row, stop]
        before[with_it, stop] = last[row, stop]
    return _traced(cost[-1], before)


def onward(task: RoundTask) -> NDArray[np.float64]:
    """Return (n, n): from the arrival at a stop, row, to that at the next, column, on average."""
    p_passes = task.p_passes[:, 0]
    service_s = p_passes * task.enter_s + (1 - p_passes) * task.fail_s
    found: NDArray[np.float64] = service_s[:, None] + task.leg_s
    return found


def _traced(cost: NDArray[np.float64], before: NDArray[np.int8]) -> Orders:
    """Return the order that ends at the stop of least cost, all visited."""
    visited, stop = len(before) - 1, int(cost.argmin())
    order = []
    while stop >= 0:
        order.append(stop)
        visited, stop = visited ^ (1 << stop), int(before[visited, stop])
    return np.array(order[::-1], np.intp)
