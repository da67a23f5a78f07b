"""A local day of all doors, half hour by half hour: for `info`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.core.folds.timeline import Times, TimeShares, time_shares
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import HOUR_NS, Moment, format_local

if TYPE_CHECKING:
    from semmap_log.core.model.moments import Time
    from semmap_log.log import DoorLog

SLOT_NS = HOUR_NS // 2


@dataclass(frozen=True, slots=True)
class DoorDay:
    """A door's day."""

    door_id: DoorId
    label: str
    """What people call it."""
    changes: int
    """How often its state changed."""
    shares: TimeShares
    """Half hour by half hour."""


@dataclass(frozen=True, slots=True)
class Day:
    """A local day of a building's doors."""

    tz: str
    edges_ns: Times
    """(slots + 1,): half hours from midnight to midnight: 48, or as many as the day has."""
    doors: Sequence[DoorDay]
    """Those that were in the map at some time of it, ids ascending."""

    @property
    def date(self) -> str:
        """Such as 2026-03-08."""
        return format_local(int(self.edges_ns[0]), self.tz)[: len("2026-03-08")]

    def liveliest(self, most: int) -> list[DoorDay]:
        """Return at most so many doors, those whose state changed most; ids ascending."""
        ranked = sorted(self.doors, key=lambda door: (-door.changes, door.door_id))
        return sorted(ranked[:most], key=lambda door: door.door_id)


def day_of_doors(log: DoorLog, day: Time = None) -> Day:
    """Return the states of all doors on a local day, as far as they are known today.

    Args:
        log: The log.
        day: A moment of that day; None: the last one with a report of a door's state, or the log's
            last day where no door was in the map on that one yet.

    Raises:
        MomentError: The time cannot be read.
    """
    requested_ns = log.instant(day)
    if requested_ns is None:
        found = _states_of_day(log, log.states_end_ns())
        return found if found.doors else _states_of_day(log, log.end_ns())
    return _states_of_day(log, requested_ns)


def _states_of_day(log: DoorLog, moment_ns: int) -> Day:
    clock = LocalClock(log.info.timezone)
    number = clock.hour_of(np.array([moment_ns])) // 24
    start_ns, end_ns = clock.midnights_ns(np.append(number, number + 1)).tolist()
    known_ns = max(start_ns, log.horizon_ns(), 0)  # what was before is no longer kept
    found = log.timelines(since=Moment(ns=known_ns), until=Moment(ns=max(end_ns, known_ns)))
    names = log.door_names()
    edges_ns = np.arange(start_ns, end_ns + 1, SLOT_NS)
    return Day(
        log.info.timezone,
        edges_ns,
        [
            DoorDay(
                door_id,
                names.get(door_id, str(door_id)),
                len(timeline) - 1,
                time_shares(timeline, edges_ns),
            )
            for door_id, timeline in found.items()
            if len(timeline)
        ],
    )
