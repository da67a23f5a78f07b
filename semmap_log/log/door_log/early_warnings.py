"""Tells who appends that no answer counts something: it happened before its door was added."""

from __future__ import annotations

import warnings

from semmap_log.core.folds.early_events import EarlyEvents
from semmap_log.core.model.moments import format_local
from semmap_log.core.users_line import frames_of_ours
from semmap_log.errors import EarlyEventsWarning
from semmap_log.log.door_log.backdating import remedy
from semmap_log.log.door_log.current_map import CurrentMap
from semmap_log.log.door_log.door_labels import labels_ever

TOLD_AGAIN = 10
"""What no answer counts is told at once, and again when it has become so many times as much."""


class EarlyWarnings:
    """What was appended and had happened before its door was added, and how much of it was told."""

    def __init__(self, now: CurrentMap, timezone: str) -> None:
        """Begin with nothing.

        Args:
            now: The map, of which the doors' names are.
            timezone: The log's.
        """
        self._now, self._timezone = now, timezone
        self.found = EarlyEvents.none()
        self._told = 0

    def begin_anew(self) -> None:
        """Forget what was found: a retraction may have moved addings."""
        self.found, self._told = EarlyEvents.none(), 0

    def warn(self, *, is_last: bool = False) -> None:
        """Tell of it: at once, when it is ten times as much, and at the end."""
        count = len(self.found)
        enough = self._told + 1 if is_last else TOLD_AGAIN * self._told
        if not count or count < enough:
            return
        self._told = count
        since = format_local(min(self.found.first_ns.values()), self._timezone)
        said = self.found.in_words(labels_ever(self._now.state), since)
        text = f"{said}; {remedy(self._now.path)}"
        warnings.warn(EarlyEventsWarning(text), stacklevel=frames_of_ours())
