"""Numbers of events in a log that retells another, beside a dictionary."""

from __future__ import annotations

import random
from itertools import pairwise

import numpy as np
import pytest

from semmap_log.core.folds.renumbering import NewNumbers, renamed
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorRemoved, Retracted, SightingsThinned

COUNT = 40


@pytest.mark.parametrize("seed", range(12))
def test_a_retraction_reaches_the_same_events(seed: int) -> None:
    """Wherever they lie now, and none besides."""
    dice, numbers, known, first = random.Random(seed), NewNumbers(COUNT), dict[int, int](), 5
    at = 0
    while at < COUNT:
        length, step = dice.randint(1, 6), dice.choice((0, 0, 3))
        run = np.arange(at, min(at + length, COUNT))
        at += length
        if dice.random() < 0.3:
            continue
        first += step
        numbers.add(run, first) if dice.random() < 0.5 else [
            numbers.add(int(number), first + i) for i, number in enumerate(run)
        ]
        known |= {int(number): first + i for i, number in enumerate(run)}
        first += len(run)
    for _ in range(50):
        low, high = sorted((dice.randrange(COUNT), dice.randrange(COUNT)))

        told = renamed(Retracted(first_event=low, last_event=high), numbers.ranges)

        reached = [n for t in told for n in range(t.first_event, t.last_event + 1)]  # type: ignore[attr-defined]
        assert reached == sorted(new for old, new in known.items() if low <= old <= high)
        assert all(
            one.last_event + 1 < other.first_event  # type: ignore[attr-defined]
            for one, other in pairwise(told)
        )


def test_thinned_sightings_name_the_first_or_nothing() -> None:
    """0 means that it is not known."""
    numbers = NewNumbers(COUNT)
    numbers.add(7, 3)
    numbers.add(0, 5)
    for number, expected in ((7, 3), (8, 0), (0, 0), (COUNT + 5, 0)):
        told = SightingsThinned(
            door_id=DoorId(1), state=DoorState.OPEN, count=2, first_ns=1, last_ns=2,
            first_event=number,
        )  # fmt: skip
        (found,) = renamed(told, numbers.ranges)
        assert expected == found.first_event  # type: ignore[attr-defined]


def test_all_other_events_name_none() -> None:
    event = DoorRemoved(door_id=DoorId(1))

    assert [event] == renamed(event, NewNumbers(COUNT).ranges)
