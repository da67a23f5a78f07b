"""Kinds of doors: office hours, ward, slot, weekend, flicker, sticky; and doors without hours."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from door_sim.week_chain import SLOTS, WeekChain

WORKING_DAYS, EVERY_DAY = range(5), range(7)

RELAXATIONS_H = (0.25, 1.0, 4.0, 12.0, 48.0)
"""After so many hours a door without hours has forgotten e-fold how it was."""


class _Week:
    """A week of which some hours are other than the rest; later ones lie over earlier ones."""

    def __init__(self, share: float, pace: float) -> None:
        self.share, self.pace = np.full(SLOTS, share), np.full(SLOTS, pace)

    def hours(
        self, days: Iterable[int], start: float, end: float, share: float, pace: float
    ) -> _Week:
        """Return the week with other hours on some days."""
        for day in days:
            slots = slice(round(day * 48 + 2 * start), round(day * 48 + 2 * end))
            self.share[slots], self.pace[slots] = share, pace
        return self

    def chain(self) -> WeekChain:
        return WeekChain.of(self.share, self.pace)


def _office(rng: np.random.Generator) -> WeekChain:
    """Closed at night and at weekends; in and out by day."""
    start, end = rng.choice([7.5, 8.0, 9.0]), rng.choice([16.0, 17.0, 18.0])
    share, pace = rng.uniform(0.5, 0.9), rng.uniform(1, 4)
    return _Week(0.01, 0.3).hours(WORKING_DAYS, start, end, share, pace).chain()


def _ward(rng: np.random.Generator) -> WeekChain:
    """Open by day, seven days a week; ajar in some nights."""
    week = _Week(rng.uniform(0.05, 0.3), 0.5)
    return week.hours(EVERY_DAY, 6, 21, rng.uniform(0.6, 0.9), rng.uniform(1, 4)).chain()


def _slot(rng: np.random.Generator) -> WeekChain:
    """Opens in two hours of one day of the week only; not always."""
    day, start = int(rng.integers(7)), float(rng.integers(6, 20))
    return _Week(0.003, 0.5).hours([day], start, start + 2, rng.uniform(0.55, 0.95), 4).chain()


def _weekend(rng: np.random.Generator) -> WeekChain:
    """Open at weekends."""
    share, pace = rng.uniform(0.6, 0.9), rng.uniform(0.5, 2)
    return _Week(0.03, 0.3).hours([5, 6], 10, 18, share, pace).chain()


def _flicker(rng: np.random.Generator) -> WeekChain:
    """Opens and closes every few minutes by day; a spring shuts it."""
    week = _Week(0.02, 1.0)
    return week.hours(EVERY_DAY, 7, 20, rng.uniform(0.1, 0.4), rng.uniform(8, 20)).chain()


def _sticky(rng: np.random.Generator) -> WeekChain:
    """Stays as it is for a day or two; a little likelier open by day."""
    relaxation = 1 / rng.uniform(24, 48)
    week = _Week(rng.uniform(0.2, 0.5), relaxation)
    return week.hours(WORKING_DAYS, 8, 18, rng.uniform(0.5, 0.8), 2 * relaxation).chain()


KINDS: Mapping[str, Callable[[np.random.Generator], WeekChain]] = {
    "office": _office, "ward": _ward, "slot": _slot, "weekend": _weekend, "flicker": _flicker,
    "sticky": _sticky,
}  # fmt: skip


def without_hours(rng: np.random.Generator, relaxation_h: float) -> WeekChain:
    """Return a door that forgets in so many hours, by day and by night."""
    return _Week(rng.uniform(0.15, 0.85), 1 / relaxation_h).chain()
