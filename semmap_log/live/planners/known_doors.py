"""The doors of now, and what was looked up of other moments since they are so."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import TypeVar

from semmap_log.core.model.moments import Moment
from semmap_log.live.planners.door_view import DoorView
from semmap_log.log.door_log.door_log import DoorLog

T = TypeVar("T")

MOST_REMEMBERED = 64
"""Moments."""


class KnownDoors:
    """What is known until the next change; may be used by several threads."""

    def __init__(self, view: DoorView) -> None:
        self.view = view
        self._remembered: OrderedDict[object, object] = OrderedDict()
        self._mutex = threading.Lock()

    def view_at(self, log: DoorLog, when: Moment, known_at: Moment) -> DoorView:
        """Return the doors of a moment; of none: those of now.

        Args:
            log: At least as new as the doors of now.
            when: What was true then.
            known_at: Only what was known then.

        Raises:
            LogError: The log cannot be read, or has no such event.
        """
        if when == known_at == Moment():
            return self.view
        return self.remembered(
            (when, known_at), lambda: DoorView(log.replay(at=when, known_at=known_at))
        )

    def remembered(self, key: object, look_up: Callable[[], T]) -> T:
        """Return what was looked up before, or look it up."""
        with self._mutex:
            if key in self._remembered:
                self._remembered.move_to_end(key)
                return self._remembered[key]  # type: ignore[return-value]
        found = look_up()
        with self._mutex:
            self._remembered[key] = found
            if len(self._remembered) > MOST_REMEMBERED:
                self._remembered.popitem(last=False)
        return found
