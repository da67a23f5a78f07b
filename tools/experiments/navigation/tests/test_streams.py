"""Chance: apart for each thing, shared where it is to be."""

from __future__ import annotations

from navigation.streams import Streams


def drawn(setup: str = "map", series: str = "fixed", seed: int = 1, what: str = "doors") -> float:
    return Streams("clinic 1", setup, series, seed).of(what).random()


def test_each_thing_has_numbers_of_its_own() -> None:
    assert len({drawn(what=what) for what in ("doors", "goals", "sensor", "start", "laser")}) == 5


def test_the_same_thing_has_the_same_numbers() -> None:
    assert drawn() == drawn()
    assert drawn(seed=2) != drawn(seed=1)
    one, other = (Streams("b", "map", "fixed", 1).noise("laser") for _ in range(2))
    assert one.normal(size=5).tolist() == other.normal(size=5).tolist()


def test_setups_share_numbers_in_fixed_series_only() -> None:
    assert drawn("map") == drawn("no_map")
    assert drawn("map", "random") != drawn("no_map", "random")
    assert drawn("map", "random") != drawn("map", "fixed")
