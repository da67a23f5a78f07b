"""When a door was in which state: intervals as numpy columns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import DoorId, DoorState
from semmap_log.event_batch import EventBatch
from semmap_log.events import DoorAdded, DoorRemoved, Event
from semmap_log.projections.state_words import STATE_WORDS, sets_state, states_of

if TYPE_CHECKING:
    from semmap_log.arrow.sdk import DataFrame

Times = NDArray[np.int64]


class Interval(NamedTuple):
    """A time through which a door was in one state; the fields are those of `Timeline`."""

    start_ns: int
    end_ns: int
    state: DoorState
    event: int
    sightings: int

    @property
    def duration_ns(self) -> int:
        """How long it lasted, nanoseconds."""
        return self.end_ns - self.start_ns


@dataclass(frozen=True, slots=True)
class Timeline:
    """The states of a door, one row an interval, from its adding to its removal or the end.

    Each interval begins where the one before ends, in another state. Intervals are half-open; only
    the last one of a door that was not removed holds at its end, too, and may be of no length.
    """

    door_id: DoorId
    start_ns: Times
    """When the state began: nanoseconds since the Unix epoch, UTC."""
    end_ns: Times
    """When it ended; of the last: when the door was removed, else the moment asked for."""
    state: NDArray[np.uint8]
    """`DoorState` of each."""
    event: NDArray[np.int64]
    """Number of the event that began it."""
    sightings: NDArray[np.int64]
    """How many events said so, the first one included: sightings, passages, updates."""
    removed: bool = False
    """The last interval ends because the door was removed."""

    def __len__(self) -> int:
        return len(self.start_ns)

    def __iter__(self) -> Iterator[Interval]:
        """Yield the intervals, the earliest first."""
        columns = (self.start_ns, self.end_ns, self.state, self.event, self.sightings)
        for start, end, state, event, sightings in zip(*(c.tolist() for c in columns), strict=True):
            yield Interval(start, end, DoorState.of(state), event, sightings)

    @property
    def duration_ns(self) -> Times:
        """How long each interval lasted, nanoseconds."""
        return self.end_ns - self.start_ns

    def total_ns(self, state: DoorState) -> int:
        """Return how long the door was in a state, all in all, nanoseconds."""
        return int(self.duration_ns[self.state == state].sum())

    def between(self, since_ns: int | None = None, until_ns: int | None = None) -> Timeline:
        """Return what lies between two times: intervals are cut there, and keep their events."""
        start, end, removed = self.start_ns, self.end_ns, self.removed
        goes_on = np.arange(len(self)) == (len(self) if removed else len(self) - 1)
        inside = np.ones(len(self), np.bool_)
        if since_ns is not None:
            inside &= (end > since_ns) | (goes_on & (end == since_ns))
            start = np.maximum(start, since_ns)
        if until_ns is not None:
            inside &= start < until_ns
            removed = removed and bool((end <= until_ns).all())
            end = np.minimum(end, until_ns)
        return Timeline(
            self.door_id,
            start_ns=start[inside],
            end_ns=end[inside],
            state=self.state[inside],
            event=self.event[inside],
            sightings=self.sightings[inside],
            removed=removed,
        )

    def to_pandas(self) -> DataFrame:
        """Return it as a pandas.DataFrame: start, end (UTC), state, event, sightings.

        Raises:
            MissingExtraError: pyarrow or pandas is not installed.
        """
        from semmap_log.arrow.intervals import interval_table
        from semmap_log.arrow.sdk import frame_of

        return frame_of(
            interval_table(self.start_ns, self.end_ns, self.state, self.event, self.sightings)
        )


def timeline(
    batches: Iterable[EventBatch], door_id: DoorId, *, end_ns: int | None = None
) -> Timeline:
    """Return the states of a door; no intervals where its adding is not among the events.

    Args:
        batches: Events in any order, retracted ones left out, none later than `end_ns`.
        door_id: The door.
        end_ns: Where the last interval ends; default, and at the least: the latest event's time.
    """
    told = _Told(door_id)
    for batch in batches:
        told.take(batch)
    return _intervals(told, max(told.latest_ns, end_ns or 0))


class _Told:
    """What the events say about one door: its adding, its removal, and its states, in any order."""

    def __init__(self, door_id: DoorId) -> None:
        self.door_id = door_id
        self.added: tuple[int, int] | None = None
        """(time, event number)."""
        self._removed: tuple[int, int] | None = None
        self.latest_ns = 0
        """Of all events, whatever they are about."""
        self._parts: list[tuple[Times, NDArray[np.int64], NDArray[np.uint8]]] = []

    def take(self, batch: EventBatch) -> None:
        """Read a batch."""
        times = batch.folds_ns
        self.latest_ns = max(self.latest_ns, int(times.max(initial=0)))
        for kind in STATE_WORDS:
            if kind not in batch:
                continue
            rows = batch[kind]
            chosen = sets_state(kind, rows) & (rows["door_id"] == self.door_id)
            if chosen.any():
                where = batch.where(kind)[chosen]
                self._note(kind, rows[chosen], times[where], batch.number[where])

    def _note(
        self, kind: type[Event], rows: NDArray[np.void], times: Times, numbers: Times
    ) -> None:
        if kind is DoorRemoved:
            self._removed = int(times[0]), int(numbers[0])
            return
        if kind is DoorAdded:
            self.added = int(times[0]), int(numbers[0])
        self._parts.append((times, numbers, states_of(kind, rows)))

    @property
    def removed_ns(self) -> int | None:
        """When it was removed; a removal before the adding was of no door, and does not count."""
        if self._removed is None or (self.added is not None and self._removed < self.added):
            return None
        return self._removed[0]

    def states(self) -> tuple[Times, NDArray[np.int64], NDArray[np.uint8]]:
        """Return (time, event number, state) from the adding on, in the order of the fold."""
        if self.added is None:
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, np.uint8)
        times, numbers, states = (np.concatenate(part) for part in zip(*self._parts, strict=True))
        added_ns, added = self.added
        counts = (times > added_ns) | ((times == added_ns) & (numbers >= added))
        if self.removed_ns is not None:
            counts &= times < self.removed_ns
        times, numbers, states = times[counts], numbers[counts], states[counts]
        order = np.lexsort((numbers, times))
        return times[order], numbers[order], states[order]


def _intervals(told: _Told, end_ns: int) -> Timeline:
    """Join neighbours of one state; of events at the same time only the last one's state holds."""
    times, numbers, states = told.states()
    held = np.ones(len(times), np.bool_)
    held[:-1] = times[1:] != times[:-1]
    held_states = states[held]
    begins = np.ones(len(held_states), np.bool_)
    begins[1:] = held_states[1:] != held_states[:-1]
    # The time that each event is of, counted; and the interval that each such time is in.
    interval = (np.cumsum(begins) - 1)[np.cumsum(held) - held]
    state = held_states[begins]
    start = times[held][begins]
    agrees = np.flatnonzero(states == state[interval])
    first = agrees[np.searchsorted(interval[agrees], np.arange(len(state)))]
    last_ns = end_ns if told.removed_ns is None else told.removed_ns
    return Timeline(
        told.door_id,
        start_ns=start,
        end_ns=np.append(start, last_ns)[1:],
        state=state,
        event=numbers[first],
        sightings=np.bincount(interval[agrees], minlength=len(state)),
        removed=told.removed_ns is not None,
    )
