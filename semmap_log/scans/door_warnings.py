"""What visits tell of a door that should be looked at: its line, its glass, the robot's poses."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from math import isfinite, sqrt

from semmap_log.common.texts import counted
from semmap_log.domain.doors import DoorId, DoorState
from semmap_log.scans.door_figures import (
    DoorFigures,
    door_figures,
    left_of,
    visits_by_door,
)
from semmap_log.scans.visit import Visit

FEW = 5
"""Habits are told of doors with at least so many visits."""
LEAST_OFFSETS = 3
"""Visits that an offset is told of."""
OFF_M = 0.12
"""Less is a leaf in its recess, as drawings go."""
SURE = 2.0
"""Standard errors that an offset must be away from 0."""
MOSTLY = 0.5


class Concern(str, Enum):
    """What a warning is about."""

    offset = "offset"
    glass = "glass"
    undecided = "undecided"
    contradiction = "contradiction"


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


def door_warnings(visits: Iterable[Visit], *, glass: Container[DoorId] = ()) -> list[DoorWarning]:
    """Return what should be looked at, doors ascending.

    Args:
        visits: Of all doors, in any order.
        glass: Doors that are known to be of glass.
    """
    found = []
    for door_id, those in visits_by_door(visits):
        (figures,) = door_figures(those)
        told = {
            Concern.contradiction: _contradiction(those),
            Concern.offset: _offset(those),
            Concern.undecided: _undecided(figures),
            Concern.glass: "" if door_id in glass else _glass(figures),
        }
        found += [DoorWarning(door_id, concern, text) for concern, text in told.items() if text]
    return found


def _contradiction(visits: Sequence[Visit]) -> str:
    through = [visit for visit in visits if visit.passed]
    shut = [
        visit
        for visit in visits
        if visit.state is DoorState.CLOSED and any(_overlap(visit, other) for other in through)
    ]
    if not shut:
        return ""
    return (
        f"CLOSED while the robot drove through it ({counted(len(shut), 'visit')}): are its line "
        "and the poses right?"
    )


def _overlap(one: Visit, other: Visit) -> bool:
    return one.first_ns <= other.last_ns and other.first_ns <= one.last_ns


def _offset(visits: Sequence[Visit]) -> str:
    told = [visit for visit in visits if isfinite(visit.behind_m)]
    if len({visit.side for visit in told} - {0}) == 2:
        # Seen from both sides a line that is drawn too far left has its leaf before it, and behind.
        sideways = [left_of(visit) for visit in told if visit.side]
        if _is_off(sideways):
            mean = sum(sideways) / len(sideways)
            return (
                f"beams end {abs(mean):.2f} m to the {'left' if mean > 0 else 'right'} of its line "
                f"on average ({counted(len(sideways), 'visit')} from both sides): is it drawn "
                "where the leaf is?"
            )
    behind = [visit.behind_m for visit in told]
    if not _is_off(behind):
        return ""
    mean = sum(behind) / len(behind)
    return (
        f"beams end {abs(mean):.2f} m {'behind' if mean > 0 else 'before'} its line on average "
        f"({counted(len(behind), 'visit')}): is it drawn where the leaf is, and are the poses "
        "right?"
    )


def _is_off(offsets: Sequence[float]) -> bool:
    """Tell whether offsets are one on average, and not by chance."""
    if len(offsets) < LEAST_OFFSETS:
        return False
    mean = sum(offsets) / len(offsets)
    variance = sum((offset - mean) ** 2 for offset in offsets) / (len(offsets) - 1)
    return abs(mean) >= OFF_M and abs(mean) >= SURE * sqrt(variance / len(offsets))


def _undecided(figures: DoorFigures) -> str:
    if figures.visits < FEW or figures.undecided <= MOSTLY * figures.visits:
        return ""
    why = f", mostly: {figures.why}" if figures.why else ""
    return f"{figures.undecided} of {counted(figures.visits, 'visit')} undecided{why}"


def _glass(figures: DoorFigures) -> str:
    """Return a question where the laser may see through what nobody walks through."""
    if figures.closed or figures.passed or figures.open < FEW:
        return ""
    return f"always open ({counted(figures.open, 'visit')}), never driven through: glass?"
