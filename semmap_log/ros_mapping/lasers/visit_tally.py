"""What visits to doors came to, and what is odd about it: numbers for who runs the robot."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from semmap_log.common.texts import counted
from semmap_log.domain.doors import DoorState
from semmap_log.domain.events import RobotPose
from semmap_log.ros_mapping.lasers.placing import REACH_M
from semmap_log.scans.placed_scan import DoorPlaces
from semmap_log.scans.visit import Visit

BEHIND_M = 0.12
"""A door whose beams end so far off its line is drawn elsewhere than it is."""
BEHIND_VISITS = 3
"""For such a word: of a leaf that is ajar the offsets differ from visit to visit."""
MOST_AJAR = 0.5
"""P(ajar) from which on a leaf is not where the line is, wherever that is drawn."""
MOST_OFFSETS = 100
"""Of a door: the last ones count."""
GLASS_VISITS = 5
"""A door that was open so often, and was never driven through, may be one of glass."""
MOVED_M = 0.5
"""So far apart the robot's places are, of which the nearest door is looked up."""


@dataclass(slots=True)
class DoorTally:
    """Of one door."""

    visits: Counter[DoorState] = field(default_factory=Counter)
    passed: int = 0
    offsets: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_OFFSETS))
    """Of visits at which it was not open: where beams ended, behind its line (+) or before it (-),
    m."""

    @property
    def behind_m(self) -> float:
        """How far those visits agree that beams end off its line, m; NaN: they do not."""
        if len(self.offsets) < BEHIND_VISITS:
            return math.nan
        few = len(self.offsets) // 10
        agreed = sorted(self.offsets)[few : len(self.offsets) - few]
        return median(agreed) if agreed[-1] - agreed[0] < BEHIND_M else math.nan


@dataclass(slots=True)
class VisitTally:
    """Counts visits, door by door."""

    doors: dict[int, DoorTally] = field(default_factory=dict)
    undecided: Counter[str] = field(default_factory=Counter)
    """Why -> how many."""
    nearest: tuple[float, int] = (math.inf, 0)
    """How near the robot came to the middle of a door, m, and to which."""
    glass: set[int] = field(default_factory=set)
    """Doors that are known to be of glass."""
    levels: Counter[int] = field(default_factory=Counter)
    """How many doors each level has."""
    _last: tuple[int, float, float] | None = None

    def add(self, visit: Visit) -> None:
        """Count a visit."""
        door = self.doors.setdefault(visit.door_id, DoorTally())
        if visit.passed:
            door.passed += 1
            return
        door.visits[visit.state] += 1
        if visit.state is DoorState.UNKNOWN:
            self.undecided[visit.why or "not enough was seen"] += 1
        may_be_shut = visit.state is not DoorState.OPEN and visit.ajar < MOST_AJAR
        if may_be_shut and math.isfinite(visit.behind_m):
            door.offsets.append(visit.behind_m)

    def stood(self, pose: RobotPose, doors: DoorPlaces) -> None:
        """Take note of where the robot was, and of the doors of that moment."""
        last = self._last
        if last and last[0] == pose.level and math.dist(last[1:], (pose.x, pose.y)) < MOVED_M:
            return
        self._last = (pose.level, pose.x, pose.y)
        self.glass.update(doors.ids[doors.glass].tolist())
        self.levels = Counter(doors.levels.tolist())
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
        """How many visits ended in which state."""
        return sum((door.visits for door in self.doors.values()), Counter[DoorState]())

    @property
    def passages(self) -> int:
        """How often the robot drove through a door."""
        return sum(door.passed for door in self.doors.values())

    def summary(self) -> Iterator[str]:
        """Yield in words what there was."""
        seen = self.visits
        undecided = seen[DoorState.UNKNOWN]
        yield (
            f"visits: {seen.total():,} to {counted(len(self.doors), 'door')}, of which "
            f"{seen[DoorState.OPEN]:,} OPEN, {seen[DoorState.CLOSED]:,} CLOSED, "
            f"{undecided:,} undecided (not written); driven through: {self.passages:,}"
        )
        if self.undecided:
            yield "undecided: " + ", ".join(
                f"{why} {n:,}" for why, n in self.undecided.most_common()
            )

    def warnings(self, name_of: Callable[[int], str]) -> Iterator[str]:
        """Yield what is odd; a door is called by `name_of` its id."""
        for door_id, door in sorted(self.doors.items()):
            name = name_of(door_id)
            if abs(door.behind_m) > BEHIND_M:
                side = "behind" if door.behind_m > 0 else "before"
                yield (
                    f"door {name}: beams end {abs(door.behind_m):.2f} m {side} its line; if it "
                    "is drawn there by mistake, move it with `update`"
                )
            opened, shut = door.visits[DoorState.OPEN], door.visits[DoorState.CLOSED]
            if opened >= GLASS_VISITS and not shut + door.passed and door_id not in self.glass:
                yield (
                    f"door {name}: open at all {opened} visits that decided, never driven through; "
                    "glass? A shut door of glass looks like that: `annotate` it (key glass, yes)"
                )

    def nothing_met(self, level: int) -> str:
        """Return why no door was met, as far as it can be told."""
        metres, door_id = self.nearest
        if not self.levels:
            return "the log had no door with a place at the time of the scans"
        if not self.levels[level]:
            there = ", ".join(map(str, sorted(self.levels)))
            return f"the scans are of level {level}, the doors on level {there}: say which (level)"
        if metres > REACH_M:
            return (
                f"no door was ever within {REACH_M:g} m (nearest: door {door_id}, {metres:.1f} m): "
                "are the scans on the log's map, and is the map frame right?"
            )
        return (
            f"doors were within {REACH_M:g} m (nearest: door {door_id}, {metres:.1f} m), but no "
            "beam reached the line of one"
        )
