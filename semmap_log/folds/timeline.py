"""When doors were in which state: intervals as numpy columns."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.batches.event_batch import EventBatch
from semmap_log.common.late_answers import answer_of
from semmap_log.common.late_dataclass import dataclass
from semmap_log.common.shown_as_table import ShownAsTable
from semmap_log.common.texts import counted
from semmap_log.domain.doors import DoorId, DoorState
from semmap_log.domain.meaning import Presence
from semmap_log.folds.door_changes import (
    STATE,
    STATE_CHANGE,
    THERE,
    Changes,
    is_before,
    known_states,
    of_presence,
    parts_of,
)

if TYPE_CHECKING:
    from semmap_log.arrow.arrow_sdk import DataFrame

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


@dataclass(frozen=True, slots=True, repr=False)
class Timeline(ShownAsTable):
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

    @classmethod
    def empty(cls, door_id: DoorId) -> Timeline:
        """Return that of a door that was never there."""
        none = np.empty(0, np.int64)
        return cls(door_id, none, none, np.empty(0, np.uint8), none, none)

    def __repr__(self) -> str:
        return f"<Timeline of door {self.door_id}: {counted(len(self), 'interval')}>"

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

    def spent_ns(self, state: DoorState, edges_ns: Times) -> Times:
        """Return how much of each slot of time the door was in a state, nanoseconds.

        Args:
            state: The state.
            edges_ns: (slots + 1,), ascending: where each slot begins, and the last one ends.
        """
        start_ns, end_ns = self.start_ns[self.state == state], self.end_ns[self.state == state]
        before_ns = np.concatenate([np.zeros(1, np.int64), np.cumsum(end_ns - start_ns)])
        begun = np.searchsorted(start_ns, edges_ns, "right")
        # Of all that began by an edge, only the last interval may reach beyond it.
        last_end_ns = np.concatenate([edges_ns[:1], end_ns])[begun]
        beyond_ns = np.where(begun, np.maximum(last_end_ns - edges_ns, 0), 0)
        spent: Times = np.diff(before_ns[begun] - beyond_ns)
        return spent

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

    def plot(self, *, name: str = "", tz: str = "UTC") -> Any:
        """Return it as a lane in a matplotlib.figure.Figure, which a notebook shows.

        Args:
            name: What the door is called; "": its number.
            tz: IANA zone of the times.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        return answer_of("plot of a timeline")(self, name=name, tz=tz)

    def to_pandas(self) -> DataFrame:
        """Return it as a pandas.DataFrame: start, end (UTC), state, event, sightings.

        Raises:
            MissingExtraError: pyarrow or pandas is not installed.
        """
        from semmap_log.arrow.arrow_sdk import frame_of
        from semmap_log.arrow.intervals import interval_table

        return frame_of(
            interval_table(self.start_ns, self.end_ns, self.state, self.event, self.sightings)
        )


def timeline(
    batches: Iterable[EventBatch], door_id: DoorId, *, end_ns: int | None = None
) -> Timeline:
    """Return the states of one door, as `timelines` does of many; empty where it was never added.

    Args:
        batches: As for `timelines`.
        door_id: The door.
        end_ns: As for `timelines`.
    """
    found = timelines(batches, [door_id], end_ns=end_ns)
    return found[door_id] if found else Timeline.empty(door_id)


def timelines(
    batches: Iterable[EventBatch],
    doors: Collection[DoorId] | None = None,
    *,
    end_ns: int | None = None,
) -> dict[DoorId, Timeline]:
    """Return the states of doors, ids ascending; only of those whose adding is among the events.

    Some 22 bytes an event that tells a state are kept until the end.

    Args:
        batches: Events in any order, retracted ones left out, none later than `end_ns`.
        doors: Only these; None: all.
        end_ns: Where the last interval ends; default, and at the least: the latest event's time.
    """
    reports = _Reports(None if doors is None else np.array(sorted(doors), np.int64))
    for batch in batches:
        reports.take(batch)
    end_ns = max(reports.latest_ns, end_ns or 0)
    return {life.door_id: _intervals(life, end_ns) for life in reports.doors()}


class _Reports:
    """What the events say about the states of doors, in any order."""

    def __init__(self, doors: NDArray[np.int64] | None) -> None:
        self._doors = doors
        self._parts: list[Changes] = []
        self.latest_ns = 0
        """Of all events, whatever they are about."""

    def take(self, batch: EventBatch) -> None:
        """Read a batch."""
        self.latest_ns = max(self.latest_ns, int(batch.folds_ns.max(initial=0)))
        self._parts += parts_of(batch, STATE_CHANGE, setting=STATE | THERE, doors=self._doors)

    def doors(self) -> Iterator[_Life]:
        """Yield what was said of each door that was added, ids ascending."""
        changes = np.concatenate([np.empty(0, STATE_CHANGE), *self._parts])
        changes["state"] = known_states(changes["state"])
        order = np.lexsort((changes["number"], changes["folds_ns"], changes["door_id"]))
        changes = changes[order]
        starts = np.flatnonzero(np.diff(changes["door_id"].astype(np.int64), prepend=-1))
        for rows in np.split(changes, starts[1:]) if len(changes) else []:
            life = _Life(DoorId(int(rows["door_id"][0])), rows)
            if life.added is not None:
                yield life


class _Life:
    """What was said about one door, in the order of the fold."""

    def __init__(self, door_id: DoorId, changes: Changes) -> None:
        self.door_id = door_id
        self._changes = changes
        self.added = self._stamp(Presence.COMES)
        """(time, event number)."""
        removed = self._stamp(Presence.GOES)
        # A removal before the adding was of no door, and does not count.
        counts = removed is not None and (self.added is None or removed >= self.added)
        self.removed_ns = removed[0] if removed is not None and counts else None

    def _stamp(self, presence: Presence) -> tuple[int, int] | None:
        found = np.flatnonzero(of_presence(self._changes, presence))
        if not len(found):
            return None
        first = self._changes[found[0]]
        return int(first["folds_ns"]), int(first["number"])

    def states(self) -> Changes:
        """Return what counts: from the adding on, before the removal."""
        assert self.added is not None
        changes = self._changes[~of_presence(self._changes, Presence.GOES)]
        counts = ~is_before(changes, self.added)
        if self.removed_ns is not None:
            counts &= changes["folds_ns"] < self.removed_ns
        found: Changes = changes[counts]
        return found


def _intervals(life: _Life, end_ns: int) -> Timeline:
    """Join neighbours of one state; of events at the same time only the last one's state holds."""
    changes = life.states()
    times, states = changes["folds_ns"], changes["state"]
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
    last_ns = end_ns if life.removed_ns is None else life.removed_ns
    return Timeline(
        life.door_id,
        start_ns=start,
        end_ns=np.append(start, last_ns)[1:],
        state=state,
        event=changes["number"][first],
        sightings=np.bincount(interval[agrees], minlength=len(state)),
        removed=life.removed_ns is not None,
    )
