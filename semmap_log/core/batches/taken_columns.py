"""Events one by one, with what was taken out of all of them already.

Whoever checks many events looks at their kinds, doors and times, and so does whoever packs them:
each look at a hundred events is a fiftieth of the time that a durable commit of them takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorEvent


class TakenColumns(list[DoorEvent]):
    """Events about doors in a list that stays as it is; doors and times are columns, too."""

    __slots__ = ("_are_timed", "door_ids", "happened_ns", "kinds")

    def __init__(self, events: Sequence[DoorEvent], kinds: set[type[Any]]) -> None:
        """Take doors and times out of events.

        Args:
            events: The events.
            kinds: Their classes.
        """
        super().__init__(events)
        self.kinds = kinds
        self.door_ids: list[DoorId] = [event.door_id for event in events]
        self.happened_ns: list[int | None] = [event.happened_ns for event in events]
        self._are_timed = None not in self.happened_ns

    def given_times(self) -> list[int]:
        """Return when those happened that say it."""
        if self._are_timed:
            return self.happened_ns  # type: ignore[return-value]
        return [time for time in self.happened_ns if time is not None]

    def times_or(self, wall_ns: int) -> list[int]:
        """Return when each happened; one that does not say it: then."""
        if self._are_timed:
            return self.happened_ns  # type: ignore[return-value]
        return [wall_ns if time is None else time for time in self.happened_ns]
