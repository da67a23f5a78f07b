"""What a door that is watched all the time remembers beyond its present state.

A door that was opened a minute ago will soon be closed; one that stood open all morning will not.
The chain forgets how it came to its state; this corrects its forecasts by how far the door was off
its schedule during the last hour, four hours and day. The weight of each, some time ahead, is
fitted by ridge regression toward the chain's forecast, at each midnight; it only takes sums over
the days before.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.chain.looks import held_at
from semmap_log.analysis.probabilities.evidence.day_tables import DayRows
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule
from semmap_log.core.batches.event_batch import placed
from semmap_log.core.lazily import computed_once
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import HOUR_NS, SECOND_NS

Times = NDArray[np.int64]
Reals = NDArray[np.float64]
Kept = Callable[[Times, Times], Reals]

STEPS_A_DAY = 96
STEP_NS = 86_400 * SECOND_NS // STEPS_A_DAY
STEP_H = 24 / STEPS_A_DAY
SPANS_H = np.array([1.0, 4.0, 24.0])
"""Over how long deviations are averaged, with weights that fall off."""
AHEAD_H = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
"""Fitted for these times ahead; linear between them, and toward zero at 0 and beyond them."""
RIDGE_H = 10.0
"""The weight of the chain's own forecast, in hours in which the door was fully off."""


class Memory:
    """The memory of a door, and its worth so far."""

    def __init__(self, evidence: DoorEvidence, schedule: DoorSchedule, clock: LocalClock) -> None:
        self._evidence, self._schedule, self._clock = evidence, schedule, clock

    def correction(self, kept: Kept, times_ns: Times, known_ns: Times, deviation: Reals) -> Reals:
        """Return the corrections of the chain's forecasts, (n,).

        Args:
            kept: What the chain keeps of a deviation, (n, gaps), of (n,) times, over (gaps,).
            times_ns: (n,), of the forecasts.
            known_ns: (n,), when the door's state was known.
            deviation: (n,), of its state then from the schedule.
        """
        ahead_h = (times_ns - known_ns) / HOUR_NS
        if not len(self._evidence.start_ns):
            return np.zeros(len(times_ns))
        past = self._past
        row = np.searchsorted(past.days, self._days(known_ns))
        rows, first, which = np.unique(row, return_index=True, return_inverse=True)
        by_chain = kept(known_ns[first], (AHEAD_H * HOUR_NS).astype(np.int64))
        weights = _between(past.weights(rows, by_chain)[which], ahead_h)
        place = np.maximum(np.searchsorted(past.grid_ns, known_ns, "right") - 1, 0)
        remembered = np.column_stack([deviation, past.averages[place]])
        found: Reals = np.einsum("ns,ns->n", weights, remembered)
        return found

    @computed_once
    def _past(self) -> _Past:
        """Return all deviations, and the sums that show their worth."""
        grid_ns, left_out_d = _steps(self._evidence)
        held, is_open = held_at(self._evidence, grid_ns)
        expected = self._schedule.p_open(grid_ns, grid_ns)
        deviation = np.where(held, is_open - expected, 0.0)
        averages = np.column_stack([_averaged(deviation, left_out_d, span) for span in SPANS_H])
        remembered = np.where(held[:, None], np.column_stack([deviation, averages]), 0.0)

        days, day = placed(self._days(grid_ns))
        spans = remembered.shape[1]
        products = np.zeros((len(days) + 1, len(AHEAD_H), spans, spans))
        targets = np.zeros((len(days) + 1, len(AHEAD_H), spans))
        for ahead, hours in enumerate(AHEAD_H.tolist()):
            steps = round(hours / STEP_H)
            then_ns, now_ns = grid_ns[steps:], grid_ns[: max(len(grid_ns) - steps, 0)]
            if not len(now_ns):
                continue
            x = np.where(held[steps:, None], remembered[: len(now_ns)], 0.0)
            y = is_open[steps:] - self._schedule.p_open(then_ns, now_ns)
            # A day's row is what the midnight before it knew.
            row = day[steps:] + 1
            _sum_by_day(x[:, :, None] * x[:, None, :], row, products[:, ahead])
            _sum_by_day(x * y[:, None], row, targets[:, ahead])
        return _Past(days, grid_ns, averages, products.cumsum(0), targets.cumsum(0))

    def _days(self, times_ns: Times) -> NDArray[np.int64]:
        return self._clock.hour_of(times_ns) // 24


@dataclass(frozen=True, slots=True)
class _Past:
    days: NDArray[np.int64]
    """(rows - 1,), ascending: those of the grid."""
    grid_ns: Times
    """(n,)."""
    averages: Reals
    """(n, spans): of the deviations up to each time."""
    products: Reals
    """(rows, ahead, spans + 1, spans + 1): of what was remembered, hours; row i is of
    the first i days."""
    targets: Reals
    """(rows, ahead, spans + 1): of that with how the door then was off its schedule."""

    def weights(self, rows: NDArray[np.intp], kept: Reals) -> Reals:
        """Return (rows, ahead, spans + 1): the weight of the memory in addition to the chain.

        Args:
            rows: As of which midnights.
            kept: (rows, ahead), what the chain keeps of the present deviation.
        """
        products = self.products[rows]
        rest = self.targets[rows] - kept[..., None] * products[..., 0]
        ridge = RIDGE_H * (1 + AHEAD_H)[:, None, None] * np.eye(products.shape[-1])
        solved = np.linalg.solve(products + ridge, rest[..., None])[..., 0]
        return np.asarray(solved, np.float64)


def _steps(evidence: DoorEvidence) -> tuple[Times, NDArray[np.int64]]:
    """Return steps from when the state is first held on; and (days,): how many are left out before.

    Of a long gap these are all days but the first two, from which nothing reaches beyond the gap.
    """
    first, last = (ns // STEP_NS for ns in (evidence.start_ns, evidence.end_ns))
    rows = DayRows.of(*((step - first[0]) // STEPS_A_DAY for step in (first, last)), after=2)
    days = rows.days[~rows.is_gap]
    steps = (first[0] + days[:, None] * STEPS_A_DAY + np.arange(STEPS_A_DAY)).ravel()
    return steps[steps <= last[-1]] * STEP_NS, np.diff(days, prepend=-1) - 1


def _averaged(deviation: Reals, left_out_d: NDArray[np.int64], span_h: float) -> Reals:
    """Return the running mean of deviations, with weights that fall off by e in each span.

    All days are gone through side by side; what is left of the day before is added then.

    Args:
        deviation: (n,), of steps.
        left_out_d: (days,), how many days before each one have no steps.
        span_h: The span.
    """
    keep = math.exp(-STEP_H / span_h)
    days = len(left_out_d)
    padded = np.zeros(days * STEPS_A_DAY)
    padded[: len(deviation)] = deviation
    found: Reals = (1 - keep) * padded.reshape(days, STEPS_A_DAY)
    for step in range(1, STEPS_A_DAY):
        found[:, step] += keep * found[:, step - 1]
    fading = keep ** np.arange(1, STEPS_A_DAY + 1)
    for day in range(1, days):
        carried = found[day - 1, -1]
        if left_out_d[day]:
            carried *= math.exp(-24 * float(left_out_d[day]) / span_h)
        found[day] += carried * fading
    return np.ravel(found)[: len(deviation)]


def _between(weights: Reals, ahead_h: Reals) -> Reals:
    """Return (n, spans + 1): the weights of times between those that were fitted."""
    knots = np.concatenate([[0.0], AHEAD_H, [2 * AHEAD_H[-1]]])
    nothing = np.zeros_like(weights[:, :1])
    padded = np.concatenate([nothing, weights, nothing, nothing], axis=1)
    before = np.clip(np.searchsorted(knots, ahead_h, "right") - 1, 0, len(knots) - 1)
    width = np.append(np.diff(knots), np.inf)[before]
    share = ((ahead_h - knots[before]) / width)[:, None]
    row = np.arange(len(weights))
    found: Reals = (1 - share) * padded[row, before] + share * padded[row, before + 1]
    return found


def _sum_by_day(of_steps: Reals, day: NDArray[np.int64], into: Reals) -> None:
    """Add up, in hours, what belongs to each day; days ascend."""
    firsts = np.flatnonzero(np.diff(day, prepend=-1))
    into[day[firsts]] += STEP_H * np.add.reduceat(of_steps, firsts, axis=0)
