"""How much of what a laser sees the robot has not seen before."""

from __future__ import annotations

from dataclasses import dataclass
from math import dist, inf

from semmap_log.analysis.scans.scan_model import ScanModel
from semmap_log.core.model.moments import SECOND_NS


@dataclass(slots=True)
class Motion:
    """How many new looks there were to be had, since its lasers went so far: of one robot."""

    looks: float = 0.0

    def went(self, before: float, looks: float) -> None:
        """Take in that a laser went so far since there were `before`; others went with it."""
        self.looks = max(self.looks, before + looks)


class Newness:
    """How much of a new look each scan of a laser is: who parks proves nothing more by parking.

    Nor by a localisation that puts it a centimetre elsewhere at each scan: what counts is how far
    it came from where it was, not how long the way was.
    """

    def __init__(self, model: ScanModel, motion: Motion) -> None:
        self._model, self._motion = model, motion
        self._last_ns: int | None = None
        self._from, self._from_looks = (0.0, 0.0), 0.0
        """Where it was when it last was somewhere else, and how far the robot was then."""
        self._fresh = inf
        self._looked_ns = 0

    def of(self, stamp_ns: int, place: tuple[float, float]) -> float:
        """Return what share of a new look the next scan is; 0: it waits for the next one."""
        self._go(stamp_ns, place)
        is_old = stamp_ns - self._looked_ns >= self._model.least_often_s * SECOND_NS
        if self._fresh < self._model.least_fresh and not is_old:
            return 0.0
        worth = min(self._fresh, 1.0)
        self._fresh, self._looked_ns = 0.0, stamp_ns
        return worth

    def _go(self, stamp_ns: int, place: tuple[float, float]) -> None:
        """Take in when and where the next scan was made."""
        if self._last_ns is None:
            self._from, self._from_looks = place, self._motion.looks
        else:
            self._fresh += waited_looks(stamp_ns - self._last_ns, self._model)
            moved = dist(place, self._from) / self._model.step
            if moved >= self._model.least_fresh:
                self._fresh += moved
                self._motion.went(self._from_looks, moved)
                self._from, self._from_looks = place, self._motion.looks
        self._last_ns = stamp_ns


@dataclass(frozen=True, slots=True)
class LookedAt:
    """When a robot looked at a door last, and how far it was."""

    stamp_ns: int
    looks: float
    """See `Motion`."""

    def not_seen_since(self, now: LookedAt, model: ScanModel) -> float:
        """Return how many new looks there are since, by whichever laser.

        What one has looked at, another that looks from there, too, sees with the same errors: two
        lasers, or a scan and its filtered copy, prove no more than one.
        """
        waited = waited_looks(max(now.stamp_ns - self.stamp_ns, 0), model)
        return max(now.looks - self.looks + waited, 0.0)


def waited_looks(waited_ns: int, model: ScanModel) -> float:
    """Return how many new looks a robot gets that stands for so long."""
    return waited_ns / SECOND_NS / model.still_s
