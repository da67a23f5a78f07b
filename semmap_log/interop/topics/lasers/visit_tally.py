"""What visits to doors came to, and what is odd about it: numbers for who runs the robot."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from semmap_log.analysis.scans.door_figures import DoorFigures
from semmap_log.analysis.scans.door_warnings import door_warnings
from semmap_log.analysis.scans.placed_scan import DoorPlaces
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import RobotPose
from semmap_log.core.texts import counted
from semmap_log.interop.topics.lasers.placing import REACH_M

MOVED_M = 0.5
"""So far apart the robot's places are, of which the nearest door is looked up."""


@dataclass(slots=True)
class VisitTally:
    """Counts visits, door by door."""

    doors: dict[DoorId, DoorFigures] = field(default_factory=dict)
    again: int = 0
    """Visits that only said again what was told from the same stand: of them no more is counted."""
    nearest: tuple[float, int] = (math.inf, 0)
    """How near the robot came to the middle of a door, m, and to which."""
    glass: set[DoorId] = field(default_factory=set)
    """Doors that are known to be of glass."""
    levels: Counter[int] = field(default_factory=Counter)
    """How many doors each level had at most, at any moment of the scans."""
    _last: tuple[int, float, float] | None = None

    def add(self, visit: Visit) -> None:
        """Count a visit."""
        self.doors.setdefault(visit.door_id, DoorFigures(visit.door_id)).add(visit)

    def stood(self, pose: RobotPose, doors: DoorPlaces) -> None:
        """Take note of where the robot was, and of the doors of that moment."""
        last = self._last
        if last and last[0] == pose.level and math.dist(last[1:], (pose.x, pose.y)) < MOVED_M:
            return
        self._last = (pose.level, pose.x, pose.y)
        self.glass.update(map(DoorId, doors.ids[doors.glass].tolist()))
        self.levels |= Counter(doors.levels.tolist())
        here = doors.levels == pose.level
        if not here.any():
            return
        x, y, theta, width = doors.lines[here].T
        away = np.hypot(
            x + width / 2 * np.cos(theta) - pose.x, y + width / 2 * np.sin(theta) - pose.y
        )
        least = int(np.argmin(away))
        self.nearest = min(self.nearest, (float(away[least]), int(doors.ids[here][least])))

    @property
    def last_level(self) -> int | None:
        """Return where the robot was last; None: there was no scan."""
        return self._last[0] if self._last else None

    @property
    def visits(self) -> Counter[DoorState]:
        """How many visits say which state; passages are counted apart."""
        found: Counter[DoorState] = Counter()
        for door in self.doors.values():
            found[DoorState.OPEN] += door.open
            found[DoorState.CLOSED] += door.closed
            found[DoorState.UNKNOWN] += door.undecided
        return found

    @property
    def undecided(self) -> Counter[str]:
        """Why visits are undecided -> how many."""
        return sum((door.reasons for door in self.doors.values()), Counter[str]())

    @property
    def passages(self) -> int:
        """How often the robot drove through a door."""
        return sum(door.passed for door in self.doors.values())

    def summary(self) -> Iterator[str]:
        """Yield in words what there was."""
        seen = self.visits
        visits = seen.total() + self.passages
        if not visits:
            yield "visits: none"
            return
        yield (
            f"visits: {visits:,} to {counted(len(self.doors), 'door')}: "
            f"{seen[DoorState.OPEN]:,} OPEN, {seen[DoorState.CLOSED]:,} CLOSED, "
            f"{self.passages:,} driven through, {seen[DoorState.UNKNOWN]:,} undecided"
        )
        if self.again:
            yield (
                f"seen again from the same stand: {counted(self.again, 'visit')} in which a door "
                "was as told before (not written: who stands still proves nothing more)"
            )
        if reasons := self.undecided:
            told = ", ".join(f"{why} {n:,}" for why, n in reasons.most_common())
            yield f"undecided, so nothing is written of them: {told}"

    def warnings(self, name_of: Callable[[int], str]) -> Iterator[str]:
        """Yield what is odd; a door is called by `name_of` its id."""
        doors = [self.doors[door_id] for door_id in sorted(self.doors)]
        for warning in door_warnings(doors, glass=self.glass):
            yield warning.about(name_of(warning.door_id))

    def nothing_met(self, level: int) -> str:
        """Return why no door was met, as far as it can be told."""
        metres, door_id = self.nearest
        if not self.levels:
            return "the log had no door with a place at the time of the scans"
        if not self.levels[level]:
            there = ", ".join(map(str, sorted(self.levels)))
            return f"the scans are of level {level}, the doors on level {there}: say which, --level"
        if metres > REACH_M:
            return (
                f"no door was ever within {REACH_M:g} m (nearest: door {door_id}, {metres:.1f} m): "
                "are the scans on the log's map, and is the map frame right?"
            )
        return (
            f"doors were within {REACH_M:g} m (nearest: door {door_id}, {metres:.1f} m), but no "
            "beam reached the line of one"
        )
