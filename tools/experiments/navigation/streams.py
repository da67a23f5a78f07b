"""Chance, apart for each thing that needs it: so that two runs can share goals and doors."""

from __future__ import annotations

import random
from typing import Literal

import numpy as np

Series = Literal["fixed", "random"]
SERIES: tuple[Series, ...] = ("fixed", "random")


class Streams:
    """A run's random numbers, by what they are for.

    Series `fixed` (the thesis's "fixed randomized" tests): a seed gives all setups the same goals,
    doors and start, to the bit. Series `random`: each setup has its own.
    """

    def __init__(self, building: str, setup: str, series: str, seed: int) -> None:
        own = setup if series == "random" else ""
        self._words = f"{building} {own} {series} {seed}"

    def of(self, what: str) -> random.Random:
        """Return the numbers for that: always the same ones, from the first on."""
        return random.Random(f"{self._words} {what}")

    def noise(self, what: str) -> np.random.Generator:
        """Return the same for many numbers at once."""
        return np.random.default_rng(self.of(what).getrandbits(128))
