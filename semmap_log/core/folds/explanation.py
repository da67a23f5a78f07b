"""The answer to why a door was in a state: what was true, what was believed, what speaks against.

`beliefs.explaining` finds it, since P(open) is a part of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.model.doors import Door, DoorId, DoorState, ShownAsTable
from semmap_log.core.model.moments import format_utc


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
class StateReason:
    """A door's state at a moment, since when, and the events that made it so."""

    door: Door | None
    """As it was; None: it was not in the map."""
    is_removed: bool = False
    """Of a door that was not in the map: no more; else not yet."""
    since_ns: int | None = None
    """Since when it was in that state, or removed; None: it was not yet in the map."""
    begun_by: HistoryEntry | None = None
    """The event with which that began."""
    last: HistoryEntry | None = None
    """The last event that set the state, which may have been the same before."""
    added_by: HistoryEntry | None = None
    """The event that put the door into the map; None: it is not yet in it."""
    times_told: int = 0
    """How many events reported this state from its beginning on, the first included."""

    @property
    def state(self) -> DoorState | None:
        """None: it was not in the map."""
        return None if self.door is None else self.door.state

    @property
    def number(self) -> int | None:
        """Number of the event on which it rests: the state, or that the door is gone."""
        return None if self.last is None else self.last.number


@dataclass(frozen=True, slots=True)
class NextChange:
    """What became of a door after a moment, as is known today."""

    time_ns: int
    state: DoorState | None
    """None: it was removed."""
    entry: HistoryEntry
    """The event that did it."""


@dataclass(frozen=True, slots=True, repr=False)
class Explanation(ShownAsTable):
    """Why a door was in a state at a moment, and what was believed about it."""

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
    """The log's end: nothing is known of the time after it."""
    true: StateReason
    """By all that is known today."""
    believed: StateReason
    """By what was known then."""
    told_since: HistoryEntry | None
    """What is true rests on this event, which was recorded later."""
    taken_back: HistoryEntry | None
    """What was believed rested on this event, which was retracted later."""
    otherwise: tuple[HistoryEntry, ...]
    """Events that report another state than the true one, as they happened: readings that were
    retracted, requests, robots that gave up, and reports from shortly before and after."""
    otherwise_ns: tuple[int, int]
    """The span of time of these events, both ends included."""
    retractions: dict[int, HistoryEntry]
    """By their numbers, those that took back what is named here."""
    belief: OpenChance | None
    """P(open) then, by what was known then; None: the door was not known."""
    next: NextChange | None
    """None: no other was reported."""

    def __repr__(self) -> str:
        told = f"true {_phrase(self.true)}, believed {_phrase(self.believed)}"
        return f"<Explanation of {self.label!r} at {format_utc(self.time_ns)}: {told}>"

    @property
    def agrees(self) -> bool:
        """Whether what was believed was true, and rested on the same event."""
        same = self.true.state is self.believed.state and self.true.number == self.believed.number
        return same and self.true.is_removed == self.believed.is_removed


def _phrase(known: StateReason) -> str:
    if known.state is not None:
        return known.state.name
    return "removed" if known.is_removed else "not there"
