"""What the events of a log are called in another that retells it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semmap_log.domain.events import Event, Retracted, SightingsThinned


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

    def renamed(self, event: Event) -> Iterator[Event]:
        """Yield what an event says with the numbers of the other log.

        Of a retraction several where those that it reaches lie apart there, or none where none of
        them is there; all others are one.
        """
        if isinstance(event, Retracted):
            for first, last in self._ranges(event.first_event, event.last_event):
                yield replace(event, first_event=first, last_event=last)
        elif isinstance(event, SightingsThinned):
            yield replace(event, first_event=self._of(event.first_event))
        else:
            yield event

    def _of(self, number: int) -> int:
        """Return the new number of an event; 0: it is not there."""
        return max(0, int(self._numbers[number])) if 0 < number < len(self._numbers) else 0

    def _ranges(self, first: int, last: int) -> Iterator[tuple[int, int]]:
        there = self._numbers[first : last + 1]
        there = there[there >= 0]
        cuts = np.flatnonzero(np.diff(there) != 1) + 1
        for start, end in pairwise([0, *cuts.tolist(), len(there)]):
            if start < end:
                yield int(there[start]), int(there[end - 1])
