"""The numbers that the events of a log have in another log that is rewritten from it.

Also the new log with the commits of others: made by the ordinary writer, at the times of their
recording.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.clock import KeptClock
from semmap_log.core.model.commits import Commit, Durability, Note
from semmap_log.core.model.events import Event, Retracted, SightingsThinned
from semmap_log.log.replay.care import WrittenState
from semmap_log.log.trimming.trim_log import Retention, trim_log
from semmap_log.store.header import LogInfo
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing.durability import DurabilityPolicy
from semmap_log.store.writing.writer import Environment
from semmap_log.store.writing.writer_opening import create_log


class NewNumbers:
    """Event number -> number in the other log; some are not there."""

    def __init__(self, count: int) -> None:
        """Begin with none of so many events."""
        self._numbers = np.full(count, -1, np.int64)

    def add(self, numbers: NDArray[np.int64] | int, first: int) -> None:
        """Note that events, numbers ascending, follow each other in the other log from a number."""
        if isinstance(numbers, int):
            self._numbers[numbers] = first
        else:
            self._numbers[numbers] = np.arange(first, first + len(numbers))

    def ranges(self, first: int, last: int) -> list[tuple[int, int]]:
        """Return the new numbers of events `first` to `last` that are there, as few ranges."""
        there = self._numbers[first : last + 1]
        there = there[there >= 0]
        cuts = np.flatnonzero(np.diff(there) != 1) + 1
        return [
            (int(there[start]), int(there[end - 1]))
            for start, end in pairwise([0, *cuts.tolist(), len(there)])
            if start < end
        ]


def renamed(event: Event, ranges: Callable[[int, int], list[tuple[int, int]]]) -> list[Event]:
    """Return what an event says with the numbers of another log.

    Of a retraction several where those that it reaches lie apart there, or none where none of
    them is there; all others are one.

    Args:
        event: The event.
        ranges: Returns the numbers there of all events between two numbers, as ranges.
    """
    if isinstance(event, Retracted):
        found = ranges(event.first_event, event.last_event)
        return [replace(event, first_event=first, last_event=last) for first, last in found]
    if isinstance(event, SightingsThinned) and event.first_event:
        ((first, _),) = ranges(event.first_event, event.first_event) or [(0, 0)]
        return [replace(event, first_event=first)]
    return [event]


def begins_ns(recorded_ns: int, lost: int, needed_ns: int) -> int:
    """Return when a commit is recorded in another log that lacks some of its events.

    At the same time, so that it is known from the same moment on. Its events take a nanosecond
    each there, so those after a gap come earlier. One that is dated later than it was recorded
    counts from then: for such an event the commit begins later, by as many nanoseconds as it lost
    events at most.

    Args:
        recorded_ns: When it was recorded.
        lost: How many of its events are not there.
        needed_ns: When it has to begin so that no event is recorded before it happened.
    """
    return recorded_ns + min(max(lost, 0), max(needed_ns - recorded_ns, 0))


class NextPlace(NamedTuple):
    """Where the next commit comes."""

    first_event: int
    """The number of its first event."""
    is_late: bool
    """It is recorded later than it was, since the log has others of that moment."""


class LogAnew:
    """A log that is filled from its beginning, in the order in which all of it was recorded."""

    def __init__(
        self,
        folder: Path,
        info: LogInfo,
        entropy: Callable[[int], bytes],
        *,
        horizon_ns: int = -1,
    ) -> None:
        """Create the log.

        Args:
            folder: Its folder; nothing exists there yet.
            info: Its fixed properties.
            entropy: Where ids and salts come from.
            horizon_ns: What was recorded by this moment is not all known: history begins after
                it; -1: it has no horizon.

        Raises:
            LogExistsError: Something is there.
        """
        policy = DurabilityPolicy(Durability.NONE)
        environment = Environment(policy, KeptClock(1), entropy, compacts=False)
        self._folder, self._entropy = folder, entropy
        self._writer = create_log(folder, info, WrittenState, environment).writer
        self._horizon_ns, self._horizon = horizon_ns, -1

    @property
    def next_event(self) -> int:
        """Number of the event that comes next."""
        return self._writer.next_event

    def place(self, recorded_ns: int) -> NextPlace:
        """Return where the next commit comes, which was recorded then."""
        if self._writer.is_fresh:
            self._writer.begin_at(max(recorded_ns - 1, 1))
        if self._horizon < 0 <= self._horizon_ns < recorded_ns:
            self._begin_history()
        return NextPlace(self._writer.next_event, self._writer.last_ns >= recorded_ns)

    def append(self, events: list[Any], commit: Commit, *, note: Note, command_id: bytes) -> None:
        """Append a rewritten commit; `place` was queried before.

        Args:
            events: At least one, or a batch of them.
            commit: As it was.
            note: Its note now.
            command_id: Its id now.
        """
        self._writer.append(
            events,
            note=note,
            command_id=command_id,
            content=commit.content,
            clock=KeptClock(_begins_ns(events, commit)),
        )

    def _begin_history(self) -> None:
        """Write the state at the horizon: a keyframe at the head of a segment."""
        self._writer.begin_segment(self._horizon_ns)
        self._horizon_ns, self._horizon = self._writer.last_ns, self._writer.next_event

    def close(self) -> None:
        """Close it as it is."""
        self._writer.close()

    def finish(self) -> None:
        """Close it, and leave out what was before its horizon, if it has one."""
        if self._horizon < 0 <= self._horizon_ns:
            self._begin_history()
        self.close()
        if self._horizon_ns < 0:
            return
        until_ns = self._horizon_ns + 1
        rule = Retention(LogReader(self._folder), until_ns, always_has_horizon=True)
        assert rule.horizon == self._horizon, "nothing behind it takes back what was before"
        trim_log(
            self._folder,
            rule,
            note=Note(reason="history begins where it does in what this was made of"),
            writing={
                "durability": Durability.NONE,
                "compact": False,
                "clock": KeptClock(self._writer.last_ns),
                "entropy": self._entropy,
            },
        )


def _begins_ns(events: list[Any], commit: Commit) -> int:
    """Return when a rewritten commit is recorded."""
    times = [
        each.happened_ns if isinstance(each, EventBatch) else [each.happened_ns] for each in events
    ]
    happened_ns = np.concatenate(times)
    needed_ns = int((happened_ns - np.arange(len(happened_ns))).max())
    return begins_ns(commit.recorded_ns, commit.count - len(happened_ns), needed_ns)
