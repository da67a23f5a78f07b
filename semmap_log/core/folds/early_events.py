"""Events that happened before their door was added: they are kept, but no query counts them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, distinct
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    SETTING_KINDS,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorUpdated,
    Event,
    defaults_of,
)
from semmap_log.core.model.meaning import PART_OF, PLACING, Presence, changed
from semmap_log.core.texts import command_line, counted

MAY_BE_EARLY: tuple[type[DoorEvent], ...] = (
    *(kind for kind in SETTING_KINDS if kind.effect.presence is Presence.STAYS),
    DoorAnnotated,
)
"""Kinds that say something of a door, which is lost where the door is not there yet."""

_KINDS = np.array([kind.kind for kind in MAY_BE_EARLY], np.uint8)


@dataclass(frozen=True, slots=True)
class Addings:
    """When doors were added, to find events about earlier times."""

    door_ids: NDArray[np.int64]
    """Ascending."""
    happened_ns: NDArray[np.int64]
    number: NDArray[np.int64]
    """Of each adding; -1: it is older than all that is queried."""

    @classmethod
    def of(cls, stamps: Mapping[int, tuple[int, int]]) -> Addings:
        """Return the addings of doors: id -> (happened, event number)."""
        ids = sorted(stamps)
        rows = np.array([stamps[door_id] for door_id in ids], np.int64).reshape(-1, 2)
        return cls(np.array(ids, np.int64), rows[:, 0], rows[:, 1])

    @property
    def latest_ns(self) -> int:
        """When the last of the doors was added; 0: there are no doors."""
        return int(self.happened_ns.max(initial=0))

    def early(self, batch: EventBatch, happened_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which events of a batch count before the adding of their door.

        Args:
            batch: Events, of any kinds.
            happened_ns: When each counts; below 0: that is not known, and not early.
        """
        none: NDArray[np.bool_] = np.zeros(len(batch), np.bool_)
        asked = (happened_ns <= self.latest_ns) & (happened_ns >= 0)
        if not len(self.door_ids) or not asked.any():
            return none
        asked &= np.isin(batch.kind, _KINDS)
        where = np.flatnonzero(asked)
        ids = batch.door_ids()[where]
        place = np.minimum(np.searchsorted(self.door_ids, ids), len(self.door_ids) - 1)
        times, added_ns = happened_ns[where], self.happened_ns[place]
        is_older = (times == added_ns) & (batch.number[where] < self.number[place])
        none[where] = (self.door_ids[place] == ids) & ((times < added_ns) | is_older)
        return none


@dataclass(slots=True)
class EarlyEvents:
    """How many such events there are of each door, and when the first of them happened."""

    counts: dict[DoorId, int]
    first_ns: dict[DoorId, int]

    @classmethod
    def none(cls) -> EarlyEvents:
        """Return that there are none."""
        return cls({}, {})

    def __len__(self) -> int:
        return sum(self.counts.values())

    def add(self, door_id: DoorId, happened_ns: int, count: int = 1) -> None:
        """Count some events of a door; the first of them happened then."""
        self.counts[door_id] = self.counts.get(door_id, 0) + count
        self.first_ns[door_id] = min(self.first_ns.get(door_id, happened_ns), happened_ns)

    def add_rows(self, door_ids: NDArray[np.uint32], happened_ns: NDArray[np.int64]) -> None:
        """Count events, given the door and the time of each."""
        for door_id in distinct(door_ids).tolist():
            times = happened_ns[door_ids == door_id]
            self.add(DoorId(door_id), int(times.min()), len(times))

    def add_all(self, others: EarlyEvents) -> None:
        """Count what others counted, too."""
        for door_id, count in others.counts.items():
            self.add(door_id, others.first_ns[door_id], count)

    def of(self, door_id: DoorId) -> EarlyEvents:
        """Return those of one door."""
        if door_id not in self.counts:
            return EarlyEvents.none()
        return EarlyEvents({door_id: self.counts[door_id]}, {door_id: self.first_ns[door_id]})

    def as_text(self, names: Mapping[DoorId, str], since: str) -> str:
        """Return how many there are, and of which doors.

        Args:
            names: Of doors that have one.
            since: When the first of them happened, in words.
        """
        told = [names.get(door_id) or f"door {door_id}" for door_id in sorted(self.counts)]
        shown = ", ".join(told[:MOST_NAMED]) + (", …" if len(told) > MOST_NAMED else "")
        return (
            f"{counted(len(self), 'event')} of {counted(len(told), 'door')} ({shown}), "
            f"from {since} on, happened before the "
            f"{'door was' if len(told) == 1 else 'doors were'} added: no answer counts "
            f"{'it' if len(self) == 1 else 'them'}"
        )


MOST_NAMED = 5


def remedy(log: PurePath) -> str:
    """Return what to do about events from before their door was added."""
    line = command_line("import", log, "--since-ever")
    return f"if they were there already, say so: {line}"


def added_since(added: DoorAdded, since_ns: int | None) -> Iterator[Event]:
    """Yield an adding at an earlier time, and what it says of the state at its own time."""
    defaults = defaults_of(DoorAdded)
    unsaid = {name: defaults[name] for name, part in PART_OF.items() if not part & PLACING}
    yield replace(added, happened_ns=since_ns, **unsaid)
    said = {name: getattr(added, name) for name in unsaid}
    told = {name: value for name, value in said.items() if _is_reported(value)}
    if told:
        yield DoorUpdated(
            happened_ns=added.happened_ns,
            door_id=added.door_id,
            changed=changed(told),
            **told,
        )


def _is_reported(value: Any) -> bool:
    return value is not DoorState.UNKNOWN and not math.isnan(value)
