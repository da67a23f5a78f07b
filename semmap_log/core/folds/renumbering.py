"""Numbers of events in a log that is rewritten from others, and the robots that it names.

Also when its commits are recorded there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import Event, Retracted, RobotPose, SightingsThinned


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


BETWEEN_ROBOTS = ", "
AFTER_ROBOT = "/"
"""Between a robot and what its own log says of a source: `tug1/camera`."""


def robots_of(robot: str) -> tuple[str, ...]:
    """Return the robots that the `robot` of a log names: several where logs were joined."""
    return tuple(robot.split(BETWEEN_ROBOTS))


def robots_of_poses(batch: EventBatch, robots: Sequence[str]) -> NDArray[np.intp]:
    """Return, for each pose of a batch, the place of its robot among some; 0 if it names none."""
    if len(robots) < 2 or RobotPose not in batch:
        return np.zeros(len(batch.where(RobotPose)), np.intp)
    places, sources = batch.sources(RobotPose)
    known = {name: place for place, name in enumerate(robots)}
    of_source = [known.get(source.partition(AFTER_ROBOT)[0], 0) for source in sources]
    return np.array(of_source, np.intp)[places]
