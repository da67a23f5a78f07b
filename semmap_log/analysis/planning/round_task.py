"""A round to be ordered: its stops, the times between them, and how likely each lets one in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.errors import PlanError

Seconds = NDArray[np.float64]
Orders = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class RoundTask:
    """The stops of a round; a stop that does not let the robot in costs time, too.

    What a round shall have least of is the mean time to visit: the sum over the stops of
    P(it lets in) times its time of arrival. A stop that was not visited counts as one that is
    reached when the round is over, so that it is no gain to come when a door is shut.
    """

    from_start_s: Seconds
    """(n,): from where the robot is to each stop, seconds."""
    leg_s: Seconds
    """(n, n): from each stop, row, to each other, column, seconds."""
    p_passes: NDArray[np.float64]
    """(n, k): P(it lets the robot in), at k times, `step_s` apart; from the last on it stays."""
    enter_s: Seconds
    """(n,): what a stop takes that lets the robot in: it goes in, and comes out again."""
    fail_s: Seconds
    """(n,): what a stop takes that does not."""
    step_s: float = 60.0
    budget_s: float | None = None
    """The round ends then: what is reached later is not visited."""
    now_s: float = 0.0
    """Since the round began, as are the times of `p_passes` and the budget."""

    def __post_init__(self) -> None:
        """Check the shapes and values.

        Raises:
            PlanError: Some do not fit together, or cannot be.
        """
        count = len(self.from_start_s)
        got = [self.leg_s.shape, self.p_passes.shape[:1], self.enter_s.shape, self.fail_s.shape]
        expected = [(count, count), (count,), (count,), (count,)]
        if got != expected or self.p_passes.ndim != 2 or not self.p_passes.shape[1]:
            raise PlanError(f"a round: expected arrays of shapes {expected}, got {got}.")
        times = (self.from_start_s, self.leg_s, self.enter_s, self.fail_s)
        if not all((np.isfinite(each) & (each >= 0)).all() for each in times):
            raise PlanError("a round: expected times from 0 s on, got one that is none.")
        if not ((self.p_passes >= 0) & (self.p_passes <= 1)).all():
            raise PlanError("a round: expected probabilities of 0..1, got one that is none.")

    @classmethod
    def fixed(
        cls, from_start_s: Seconds, leg_s: Seconds, p_passes: NDArray[np.float64],
        enter_s: float, fail_s: float,
    ) -> RoundTask:  # fmt: skip
        """Return a round whose probabilities do not change; all stops take the same."""
        alike = np.ones(len(from_start_s))
        return cls(
            from_start_s, leg_s, np.asarray(p_passes)[:, None], alike * enter_s, alike * fail_s
        )

    def __len__(self) -> int:
        return len(self.from_start_s)

    def rest(self, stops: Orders, *, last: int | None, now_s: float) -> RoundTask:
        """Return what is left of the round: some stops, from the last one or the start, now."""
        return replace(
            self,
            from_start_s=self.from_start_s[stops] if last is None else self.leg_s[last, stops],
            leg_s=self.leg_s[np.ix_(stops, stops)],
            p_passes=self.p_passes[stops],
            enter_s=self.enter_s[stops],
            fail_s=self.fail_s[stops],
            now_s=now_s,
        )

    @property
    def is_fixed(self) -> bool:
        """Whether P does not change, and no budget ends the round: orders can be exact."""
        return self.p_passes.shape[1] == 1 and self.budget_s is None

    def at(self, times_s: Seconds) -> RoundTask:
        """Return the same with the fixed P of each stop at its time; no budget, from 0 s on."""
        p_passes = self.p_at(np.arange(len(self)), times_s)[:, None]
        return replace(self, p_passes=p_passes, budget_s=None, now_s=0.0)

    def p_at(self, stops: Orders, times_s: Seconds) -> NDArray[np.float64]:
        """Return P(it lets the robot in) of stops, each at its time."""
        last = self.p_passes.shape[1] - 1
        if not last:
            fixed: NDArray[np.float64] = self.p_passes[stops, 0]
            return fixed
        place = np.minimum(times_s / self.step_s, last)
        before = np.minimum(place.astype(np.intp), last - 1)
        low, high = self.p_passes[stops, before], self.p_passes[stops, before + 1]
        found: NDArray[np.float64] = low + (place - before) * (high - low)
        return found

    def arrivals(self, orders: Orders) -> tuple[Seconds, NDArray[np.float64]]:
        """Return when one comes to the stops of some orders, on average, and P of each then.

        Args:
            orders: (m, j), stops; each row without repeats.
        """
        times, chances = np.empty(orders.shape), np.empty(orders.shape)
        now = np.full(len(orders), self.now_s)
        for place in range(orders.shape[1]):
            stop = orders[:, place]
            leg = self.leg_s[orders[:, place - 1], stop] if place else self.from_start_s[stop]
            now = now + leg
            p_passes = self.p_at(stop, now)
            times[:, place], chances[:, place] = now, p_passes
            now = now + p_passes * self.enter_s[stop] + (1 - p_passes) * self.fail_s[stop]
        return times, chances

    def cost(self, orders: Orders) -> Seconds:
        """Return the cost of each order: the less, the better; zero: all are reached at the end."""
        times, chances = self.arrivals(orders)
        ends_s = self.horizon_s
        gain = ends_s - times
        if self.budget_s is not None:
            gain = np.maximum(gain, 0.0)
        found: Seconds = -(chances * gain).sum(axis=1)
        return found

    @property
    def horizon_s(self) -> float:
        """When the round is over: its budget, or about when all stops can have been gone to."""
        if self.budget_s is not None:
            return self.budget_s
        service = np.maximum(self.enter_s, self.fail_s).sum()
        between = np.sort(self.leg_s, axis=1)[:, 1:2].sum() if len(self) > 1 else 0.0
        nearest = self.from_start_s.min() if len(self) else 0.0
        return float(self.now_s + nearest + between + service)


def with_stop(order: Orders, stop: int) -> Orders:
    """Return the orders with one more stop, (n + 1, n + 1): in row i it is at place i."""
    count = len(order) + 1
    found = np.empty((count, count), np.intp)
    found[~np.eye(count, dtype=np.bool_)] = np.repeat(order[None], count, axis=0).ravel()
    np.fill_diagonal(found, stop)
    return found
