"""The DoorDaemon against the thesis's sentence: how often doors toggle, so long after a toggle."""

from __future__ import annotations

import math
import random
from collections import Counter

import pytest

from navigation.door_daemon import RESET, DoorDaemon, likelihood
from semmap_log.core.model.doors import DoorId, DoorState

DOORS = [DoorId(number) for number in range(1, 2001)]


def toggles(reading: str, base: float, *, iterations: int = 60) -> tuple[Counter, Counter]:
    """Return how many doors were there, and how many toggled, so many iterations after a toggle."""
    daemon = DoorDaemon(DOORS, random.Random(7), base=base, reading=reading)
    since = dict.fromkeys(DOORS, 0)
    tried, toggled = Counter[int](), Counter[int]()
    for _ in range(iterations):
        now = set(daemon.iterate())
        for door in DOORS:
            since[door] = (since[door] + 1) % 24
            tried[since[door]] += 1
            toggled[since[door]] += door in now
            if door in now:
                since[door] = 0
    return tried, toggled


def test_the_likelihood_is_a_normal_density_and_a_base() -> None:
    """
    Its peak lies 6 iterations after a toggle and is 1 / (4 sqrt(2 pi)).
    """
    assert likelihood(6, 0.0) == pytest.approx(1 / (4 * math.sqrt(2 * math.pi)))
    assert (
        likelihood(2, 0.0)
        == likelihood(10, 0.0)
        == pytest.approx(likelihood(6, 0) * math.exp(-1 / 2))
    )
    assert likelihood(23, 0.02) == pytest.approx(0.02, abs=1e-4)
    assert likelihood(6, 1.0) == 1.0


@pytest.mark.parametrize("base", [0.0, 0.02, 0.1])
def test_doors_toggle_as_often_as_the_prose_says(base: float) -> None:
    """
    Of 2,000 doors, by iterations since the last toggle: each share within 4.5 standard errors.
    """
    tried, toggled = toggles("prose", base)

    assert len(tried) == RESET
    for count, doors in tried.items():
        expected = likelihood(count, base)
        error = math.sqrt(expected * (1 - expected) / doors)
        assert abs(toggled[count] / doors - expected) <= 4.5 * error, count


def test_the_literal_reading_is_the_other_way_round() -> None:
    """
    "If the random variable is equal or larger": nine of ten doors toggle each time.
    """
    tried, toggled = toggles("literal", 0.0, iterations=20)

    share = toggled[1] / tried[1]
    assert share == pytest.approx(1 - likelihood(1, 0.0), abs=0.01)
    assert share > 0.9


def test_after_24_iterations_the_count_begins_anew() -> None:
    """
    A door that did not toggle is as likely to do so in its 30th iteration as in its 6th.
    """
    daemon = DoorDaemon([DoorId(1)], Never(), base=0.0)
    asked = []
    for _ in range(48):
        daemon._rng.asked = []
        daemon.iterate()
        asked += daemon._rng.asked
    assert asked == [likelihood(count % 24, 0.0) for count in range(1, 49)]


class Never(random.Random):
    """A number that no likelihood reaches; it keeps what it was compared with."""

    asked: list[float]

    def random(self) -> Number:  # type: ignore[override]
        return Number(self)


class Number(float):
    """1.0, which knows what it is compared with."""

    def __new__(cls, rng: Never) -> Number:  # noqa: PYI034
        return super().__new__(cls, 1.0)

    def __init__(self, rng: Never) -> None:
        self._rng = rng

    def __ge__(self, other: float) -> bool:
        self._rng.asked.append(other)
        return True

    def __lt__(self, other: float) -> bool:
        return False


def test_about_half_of_the_doors_stand_open_at_first() -> None:
    daemon = DoorDaemon(DOORS, random.Random(1), base=0.0)
    assert sum(daemon.is_open.values()) == pytest.approx(1000, abs=100)
    assert set(daemon.states().values()) == {DoorState.OPEN, DoorState.CLOSED}


def test_the_same_generator_gives_the_same_doors() -> None:
    one, other = (DoorDaemon(DOORS[:50], random.Random(3), base=0.02) for _ in range(2))
    assert [one.iterate() for _ in range(40)] == [other.iterate() for _ in range(40)]
    assert one.is_open == other.is_open
