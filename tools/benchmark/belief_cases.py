"""The cases of beliefs: what is learnt of doors, and what is forecast."""

from __future__ import annotations

from collections.abc import Iterator

from benchmark.belief_forecasts import clinic_case, minutes_case
from benchmark.belief_sightings import sightings_case
from benchmark.belief_visits import visits_case
from benchmark.case import Case

VISITS, SIGHTINGS, DAYS = 8736, 1_000_000, 1044
"""Visits: half a year of two an hour. Days: 1.5 million minutes, as the longest of the real sets
has."""
TRIED_OUT = 100
"""A run that only tries out has that part of each."""
LEAST_DAYS, FEW_DOORS = 15, 12


def belief_cases(rounds: int | None, *, tries_out: bool = False) -> Iterator[Case]:
    """Yield: what visits tell; sightings as evidence; all doors of a log; years of habits.

    Args:
        rounds: Rounds that count; None: each case's own.
        tries_out: Only a small part of each, to see whether everything works.
    """
    part = TRIED_OUT if tries_out else 1
    yield visits_case(VISITS // part, rounds)
    yield sightings_case(SIGHTINGS // part, rounds)
    yield clinic_case(rounds, most=FEW_DOORS if tries_out else None)
    yield minutes_case(max(DAYS // part, LEAST_DAYS), rounds)
