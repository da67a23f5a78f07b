"""Tells who appends that events are said to happen in time to come: no answer counts them so."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.batches.taken_columns import TakenColumns
from semmap_log.core.model.events import Event
from semmap_log.core.model.moments import SECOND_NS, format_local
from semmap_log.core.texts import counted
from semmap_log.core.users_line import frames_of_ours
from semmap_log.errors import FutureTimesWarning

SLACK_NS = 60 * SECOND_NS
"""Two clocks may differ by this much."""
WARN_AGAIN = 10
"""What is to come is told at once, and again when it has become so many times as much."""


class FutureWarnings:
    """What was appended and is said to happen later than it was recorded."""

    def __init__(self, timezone: str) -> None:
        """Begin with nothing.

        Args:
            timezone: The log's.
        """
        self._timezone = timezone
        self._count = 0
        self._warned = 0
        self._latest_ns = 0
        self._waiting: list[NDArray[np.int64]] = []

    def passing(self, events: Iterable[Event | EventBatch]) -> Iterator[Event | EventBatch]:
        """Yield the events, and remember when they happen until they are recorded."""
        self._waiting = []
        for event in events:
            self._waiting.append(_times_of(event))
            yield event

    def settle(self, events: Iterable[Event | EventBatch], recorded_ns: int) -> None:
        """Count those that happen later than they were recorded, of these and of what has passed.

        Args:
            events: Of a commit, those that did not pass one by one.
            recorded_ns: When it was recorded.
        """
        parts, self._waiting = self._waiting, []
        if isinstance(events, TakenColumns):
            parts.append(np.array(events.given_times(), np.int64))
        else:
            parts += map(_times_of, events)
        for times in parts:
            ahead = times[times > recorded_ns + SLACK_NS]
            if len(ahead):
                self._count += len(ahead)
                self._latest_ns = max(self._latest_ns, int(ahead.max()))

    def warn(self, *, is_last: bool = False) -> None:
        """Tell of it: at once, when it is ten times as much, and at the end."""
        enough = self._warned + 1 if is_last else max(1, WARN_AGAIN * self._warned)
        if self._count < enough:
            return
        self._warned = self._count
        until = format_local(self._latest_ns, self._timezone)
        events = counted(self._count, "event")
        verb = "happens" if self._count == 1 else "happen"
        counts = "it counts" if self._count == 1 else "they count"
        text = (
            f"{events} {verb} in time to come, at {until} at the latest; {counts} from the time of "
            "recording on. Check date, zone and clock; `retract` takes back what is wrong."
        )
        warnings.warn(FutureTimesWarning(text), stacklevel=frames_of_ours())


def _times_of(event: Event | EventBatch) -> NDArray[np.int64]:
    """Return when events happen that say it."""
    if isinstance(event, EventBatch):
        return np.asarray(event.happened_ns)
    return np.array([] if event.happened_ns is None else [event.happened_ns], np.int64)
