"""Kinds of doors: office hours, ward, slot, weekend, flicker, sticky; and doors without hours."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from patrol_sim.habits import EVERY_DAY, WEEKDAYS, Habit, Spell

from door_sim.week_chain import WeekChain

RELAXATIONS_H = (0.25, 1.0, 4.0, 12.0, 48.0)
"""After so many hours a door without hours has forgotten e-fold how it was."""


def _spell(
    days: Iterable[int], start_h: float, end_h: float, share: float, relaxation: float
) -> Spell:
    """Return a spell by how fast it forgets: `relaxation` is both rates' sum, per hour."""
    return Spell(days, start_h, end_h, share, 2 * share * (1 - share) * relaxation)


def _always(share: float, relaxation: float) -> Spell:
    return _spell(EVERY_DAY, 0, 24, share, relaxation)


def _chain(*spells: Spell) -> WeekChain:
    return WeekChain.of(Habit(*spells))


def _office(rng: np.random.Generator) -> WeekChain:
    """Closed at night and at weekends; in and out by day."""
    start, end = rng.choice([7.5, 8.0, 9.0]), rng.choice([16.0, 17.0, 18.0])
    share, pace = rng.uniform(0.5, 0.9), rng.uniform(1, 4)
    return _chain(_always(0.01, 0.3), _spell(WEEKDAYS, start, end, share, pace))


def _ward(rng: np.random.Generator) -> WeekChain:
    """Open by day, seven days a week; ajar in some nights."""
    night = _always(rng.uniform(0.05, 0.3), 0.5)
    return _chain(night, _spell(EVERY_DAY, 6, 21, rng.uniform(0.6, 0.9), rng.uniform(1, 4)))


def _slot(rng: np.random.Generator) -> WeekChain:
    """Opens in two hours of one day of the week only; not always."""
    day, start = int(rng.integers(7)), float(rng.integers(6, 20))
    return _chain(_always(0.003, 0.5), _spell([day], start, start + 2, rng.uniform(0.55, 0.95), 4))


def _weekend(rng: np.random.Generator) -> WeekChain:
    """Open at weekends."""
    share, pace = rng.uniform(0.6, 0.9), rng.uniform(0.5, 2)
    return _chain(_always(0.03, 0.3), _spell([5, 6], 10, 18, share, pace))


def _flicker(rng: np.random.Generator) -> WeekChain:
    """Opens and closes every few minutes by day; a spring shuts it."""
    share, pace = rng.uniform(0.1, 0.4), rng.uniform(8, 20)
    return _chain(_always(0.02, 1.0), _spell(EVERY_DAY, 7, 20, share, pace))


def _sticky(rng: np.random.Generator) -> WeekChain:
    """Stays as it is for a day or two; a little likelier open by day."""
    relaxation = 1 / rng.uniform(24, 48)
    always = _always(rng.uniform(0.2, 0.5), relaxation)
    return _chain(always, _spell(WEEKDAYS, 8, 18, rng.uniform(0.5, 0.8), 2 * relaxation))


KINDS: Mapping[str, Callable[[np.random.Generator], WeekChain]] = {
    "office": _office, "ward": _ward, "slot": _slot, "weekend": _weekend, "flicker": _flicker,
    "sticky": _sticky,
}  # fmt: skip


def without_hours(rng: np.random.Generator, relaxation_h: float) -> WeekChain:
    """Return a door that forgets in so many hours, by day and by night."""
    return _chain(_always(rng.uniform(0.15, 0.85), 1 / relaxation_h))
