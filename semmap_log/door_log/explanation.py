"""The answer to why a door was in a state: what was true, what was believed, what speaks against.

`beliefs.explaining` finds it, since P(open) is a part of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from semmap_log.domain.doors import DoorId, DoorState
from semmap_log.door_log.state_reason import StateReason
from semmap_log.folds.history import HistoryEntry


class OpenChance(Protocol):
    """How likely a door is open: a `beliefs.DoorBelief`."""

    @property
    def p_open(self) -> float:
        """P(open)."""

    @property
    def low(self) -> float:
        """Of its 90 % interval."""

    @property
    def high(self) -> float:
        """Of the same."""

    @property
    def is_known(self) -> bool:
        """False: there is too little evidence, and the numbers are of doors in general."""


@dataclass(frozen=True, slots=True)
class NextChange:
    """What became of a door after a moment, as is known today."""

    time_ns: int
    state: DoorState | None
    """None: it was removed."""
    entry: HistoryEntry
    """The event that did it."""


@dataclass(frozen=True, slots=True)
class Explanation:
    """What a log tells of a door at a moment, and of what was believed of it."""

    door_id: DoorId
    label: str
    """Its name, or level/name where several bear it; its number, where it has none."""
    time_ns: int
    """The moment."""
    known_ns: int | None
    """What had been recorded by then was known; None: up to `known_event`, or all."""
    known_event: int | None
    """The last event that was known; None: all were, -1: none."""
    end_ns: int
    """The log's end: of the time after it nothing is told."""
    true: StateReason
    """By all that is known today."""
    believed: StateReason
    """By what was known then."""
    told_since: HistoryEntry | None
    """What is true rests on this event, which was recorded later."""
    taken_back: HistoryEntry | None
    """What was believed rested on this event, which was retracted later."""
    otherwise: tuple[HistoryEntry, ...]
    """Events that tell another state than the true one, as they happened: readings that were taken
    back, requests, robots that gave up, and what was told shortly before and after."""
    otherwise_ns: tuple[int, int]
    """From when to when these are told, both included."""
    retractions: dict[int, HistoryEntry]
    """By their numbers, those that took back what is named here."""
    belief: OpenChance | None
    """P(open) then, by what was known then; None: the door was not known."""
    next: NextChange | None
    """None: no other was told."""

    @property
    def agrees(self) -> bool:
        """Whether what was believed was true, and rested on the same event."""
        same = self.true.state is self.believed.state and self.true.number == self.believed.number
        return same and self.true.is_removed == self.believed.is_removed
