"""The thesis's DoorDaemon: doors that open and close while the robot drives (appendix E.1).

At each iteration every door may be toggled. How likely that is, depends on how many iterations ago
it was toggled last: the density of a normal distribution of mean 6 and deviation 4, which rises
for a while and then falls, plus a base probability. After 24 iterations the count begins anew.

The thesis says in prose that the density is the likelihood of a toggle, and then that a door is
toggled "if the random variable is equal or larger to the defined probability", which toggles nearly
all doors each time. Both readings are here: `prose` and `literal`.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

from semmap_log.core.model.doors import DoorId, DoorState

MEAN, DEVIATION = 6.0, 4.0
RESET = 24
"""So many iterations after its last toggle a door counts from 0 again."""
READINGS = ("prose", "literal")
P_OPEN_AT_FIRST = 0.5


def likelihood(iterations: int, base: float) -> float:
    """Return the probability that stands against the random number, so long after a toggle."""
    deviations = (iterations - MEAN) / DEVIATION
    density = math.exp(-(deviations**2) / 2) / (DEVIATION * math.sqrt(math.tau))
    return min(1.0, density + base)


class DoorDaemon:
    """How the doors of the world stand, and how that goes on.

    It draws a number for every door at every iteration, whatever happens to the robot: the same
    generator gives the same doors.
    """

    def __init__(
        self, doors: Sequence[DoorId], rng: random.Random, *, base: float, reading: str = "prose"
    ) -> None:
        """Let about half of the doors stand open.

        Args:
            doors: Their ids.
            rng: Where its chance comes from; nobody else draws from it.
            base: Added to each likelihood.
            reading: One of `READINGS`.
        """
        self._rng = rng
        self._toggles_above = reading == "literal"
        self._likelihood = [likelihood(count, base) for count in range(RESET)]
        self._since = dict.fromkeys(doors, 0)
        self.is_open = {door: rng.random() < P_OPEN_AT_FIRST for door in doors}
        """How each door stands."""

    def states(self) -> dict[DoorId, DoorState]:
        """Return how all doors stand."""
        return {door: state_of(is_open) for door, is_open in self.is_open.items()}

    def iterate(self) -> list[DoorId]:
        """Toggle doors; return which."""
        return [door for door in self.is_open if self._toggled(door)]

    def _toggled(self, door: DoorId) -> bool:
        self._since[door] = (self._since[door] + 1) % RESET
        is_above = self._rng.random() >= self._likelihood[self._since[door]]
        if is_above != self._toggles_above:
            return False
        self._since[door] = 0
        self.is_open[door] = not self.is_open[door]
        return True


def state_of(is_open: bool) -> DoorState:  # noqa: FBT001 - what it is about
    """Return the state's name."""
    return DoorState.OPEN if is_open else DoorState.CLOSED
