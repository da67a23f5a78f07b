"""What visits tell of a door that should be looked at: its line, its glass, the robot's poses."""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass
from enum import Enum

from semmap_log.analysis.scans.door_figures import DoorFigures, Mean
from semmap_log.core.model.doors import DoorId
from semmap_log.core.texts import counted

FEW = 5
"""Habits are told of doors with at least so many visits."""
LEAST_OFFSETS = 3
"""Visits that an offset is told of."""
OFF_M = 0.12
"""Less is a leaf in its recess, as drawings go."""
SURE = 3.0
"""Standard errors that an offset must be away from 0."""
MOSTLY = 0.5
MOVE_IT = "if its line is drawn there by mistake, move it with `update`"
GLASS_IT = "a shut glass door looks so; if it is one, annotate it (key glass, yes)"


class Concern(str, Enum):
    """What a warning is about."""

    contradiction = "contradiction"
    offset = "offset"
    undecided = "undecided"
    glass = "glass"


@dataclass(frozen=True, slots=True)
class DoorWarning:
    """A warning about a door, with its numbers."""

    door_id: DoorId
    concern: Concern
    text: str
    """Without the door: `beams end 0.22 m behind its line on average (12 visits)`."""

    def about(self, label: str) -> str:
        """Return the warning as a line of its own, of a door that is called so."""
        return f"door {label}: {self.text}"


def door_warnings(
    doors: Iterable[DoorFigures], *, glass: Container[DoorId] = ()
) -> list[DoorWarning]:
    """Return what should be looked at, door by door.

    Args:
        doors: The figures of each.
        glass: Doors that are known to be of glass.
    """
    found = []
    for door in doors:
        told = {
            Concern.contradiction: _contradiction(door),
            Concern.offset: _offset(door),
            Concern.undecided: _undecided(door),
            Concern.glass: "" if door.door_id in glass else _glass(door),
        }
        found += [
            DoorWarning(door.door_id, concern, text) for concern, text in told.items() if text
        ]
    return found


def _contradiction(door: DoorFigures) -> str:
    if not door.contradictions:
        return ""
    return (
        f"CLOSED while the robot drove through it ({counted(door.contradictions, 'visit')}): are "
        "its line and the poses right?"
    )


def _offset(door: DoorFigures) -> str:
    if door.behind_m.count < LEAST_OFFSETS:
        return ""
    # Seen from both sides a line that is drawn too far left has its leaf before it, and behind.
    if len(door.sides) > 1 and _is_off(door.left_m):
        mean, count = door.left_m.value, door.left_m.count
        side = "left" if mean > 0 else "right"
        return (
            f"beams end {abs(mean):.2f} m to the {side} of its line on average "
            f"({counted(count, 'visit')} from both sides); {MOVE_IT}"
        )
    if not _is_off(door.behind_m):
        return ""
    mean, count = door.behind_m.value, door.behind_m.count
    side = "behind" if mean > 0 else "before"
    return (
        f"beams end {abs(mean):.2f} m {side} its line on average ({counted(count, 'visit')}); "
        f"{MOVE_IT}"
    )


def _is_off(offsets: Mean) -> bool:
    """Tell whether offsets are one on average, and not by chance."""
    return abs(offsets.value) >= max(OFF_M, SURE * offsets.error)


def _undecided(door: DoorFigures) -> str:
    if door.visits < FEW or door.undecided <= MOSTLY * door.visits:
        return ""
    return f"{door.undecided} of {counted(door.visits, 'visit')} undecided, mostly: {door.why}"


def _glass(door: DoorFigures) -> str:
    """Return a question where the laser may see through what nobody walks through."""
    if door.closed or door.passed or door.open < FEW:
        return ""
    visits = counted(door.open, "visit")
    return f"always open ({visits}), never driven through: glass? {GLASS_IT}"
