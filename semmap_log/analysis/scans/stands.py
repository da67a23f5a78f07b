"""What was told from where a robot stands: it proves nothing more by saying it again.

A visit tells of a door with the errors of its place: of the pose, of the map, of what hides the
leaf, of glass. From the same stand all of them are the same in the next visit, and in a hundred
more. So the same state is told of a door from one stand once; another state at once; and the same
again after `same_again_s`, since a door may have been opened and shut meanwhile.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import dist

from semmap_log.analysis.scans.scan_model import ScanModel
from semmap_log.analysis.scans.visit_sums import VisitSums
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import SECOND_NS


@dataclass(frozen=True, slots=True)
class _Told:
    state: DoorState
    at_ns: int
    stand: int


@dataclass(slots=True)
class Stands:
    """Where the lasers of one robot stand, and what was told from there."""

    model: ScanModel
    number: int = 0
    """Of the stand; the next one after it left."""
    _from: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Laser -> where it was first in this stand."""
    _told: dict[int, _Told] = field(default_factory=dict)
    """Door -> what was told of it last."""

    def at(self, laser: str, place: tuple[float, float]) -> int:
        """Take in where a laser is; return the number of the stand."""
        if dist(place, self._from.setdefault(laser, place)) > self.model.stand:
            self.number += 1
            self._from = {laser: place}
        return self.number

    def told_ns(self, door_id: int, state: DoorState, sums: VisitSums) -> int:
        """Return when a visit's state was told from the same stand already; 0: it is news."""
        told = self._told.get(door_id)
        if told is None or (told.state, {told.stand}) != (state, sums.stands):
            return 0
        since_ns = sums.last_ns - told.at_ns
        return told.at_ns if 0 <= since_ns < self.model.same_again_s * SECOND_NS else 0

    def tell(self, door_id: int, state: DoorState, sums: VisitSums) -> None:
        """Take note that a visit's state is told."""
        self._told[door_id] = _Told(state, sums.last_ns, max(sums.stands))

    def forget(self, door_id: int) -> None:
        """Forget what was told of a door that is otherwise now."""
        self._told.pop(door_id, None)
