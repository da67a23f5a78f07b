"""When doors were in which state: intervals as numpy columns. Pure numpy.

Also how much of each time slot a door was open, and how much of it that was known; and when a door
was looked at, and how long a sighting of it holds.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds import door_changes
from semmap_log.core.folds.thinned_runs import sightings_of_runs
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.late_answers import answer_of
from semmap_log.core.model.doors import DoorId, DoorState, ShownAsTable
from semmap_log.core.model.events import SightingsThinned
from semmap_log.core.model.meaning import Presence
from semmap_log.core.model.moments import HOUR_NS, SECOND_NS
from semmap_log.core.texts import counted

if TYPE_CHECKING:
    from semmap_log.core.arrow.arrow_sdk import DataFrame


Shares = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TimeShares:
    """What is known about a door in consecutive time slots."""

    opened: Shares
    """(slots,): share of the time known to be open or closed in which it was open; NaN: none."""
    known: Shares
    """(slots,): share of the slot in which that was known: a sighting held, or a set state."""
    there: Shares
    """(slots,): share of the slot in which the door was in the map."""


def time_shares(timeline: Timeline, edges_ns: Times) -> TimeShares:
    """Return how a door spent slots of time.

    Args:
        timeline: The door's.
        edges_ns: (slots + 1,), ascending: where each slot begins, and the last one ends.
    """
    length_ns = np.diff(edges_ns)
    open_ns, closed_ns = (
        timeline.spent_ns(state, edges_ns) for state in (DoorState.OPEN, DoorState.CLOSED)
    )
    there_ns = sum(
        timeline.spent_ns(state, edges_ns) + timeline.lapsed_ns(state, edges_ns)
        for state in DoorState
    )
    known_ns = open_ns + closed_ns
    opened = np.full(len(length_ns), np.nan)
    np.divide(open_ns, known_ns, out=opened, where=known_ns > 0)
    return TimeShares(opened, known_ns / length_ns, there_ns / length_ns)


Times = NDArray[np.int64]
NO_TIMES: Times = np.empty(0, np.int64)


class Interval(NamedTuple):
    """A time through which a door was in one state; the fields are those of `Timeline`."""

    start_ns: int
    end_ns: int
    state: DoorState
    event: int
    sightings: int
    not_seen_ns: int = 0

    @property
    def duration_ns(self) -> int:
        """How long it lasted, nanoseconds."""
        return self.end_ns - self.start_ns

    @property
    def seen_ns(self) -> int:
        """How much of it a sighting held, or a state that somebody set, nanoseconds."""
        return self.duration_ns - self.not_seen_ns


@dataclass(frozen=True, slots=True, repr=False)
class Timeline(ShownAsTable):
    """The states of a door, one row an interval, from its adding to its removal or the end.

    Each interval begins where the one before ends, in another state. Intervals are half-open; only
    the last one of a door that was not removed holds at its end, too, and may be of no length.

    A door keeps its state until another one is reported, but a sighting holds only for a time:
    after that the door was not seen, until the next report. Those times are the lapses. A state
    that was set holds until the next report.
    """

    door_id: DoorId
    start_ns: Times
    """When the state began: nanoseconds since the Unix epoch, UTC."""
    end_ns: Times
    """When it ended; for the last: when the door was removed, else the requested moment."""
    state: NDArray[np.uint8]
    """`DoorState` of each."""
    event: NDArray[np.int64]
    """Number of the event that began it."""
    sightings: NDArray[np.int64]
    """How many events reported it, the first one included: sightings, passages, updates."""
    removed: bool = False
    """The last interval ends because the door was removed."""
    lapse_start_ns: Times = field(default_factory=NO_TIMES.copy)
    """When a sighting stopped holding, ascending; each lapse lies in an OPEN or CLOSED interval."""
    lapse_end_ns: Times = field(default_factory=NO_TIMES.copy)
    """When the door was next reported on; of the last lapse perhaps the end."""
    hold: Hold | None = None
    """How long a sighting holds; None: until the next report."""

    @classmethod
    def empty(cls, door_id: DoorId) -> Timeline:
        """Return that of a door that was never there."""
        return cls(door_id, NO_TIMES, NO_TIMES, np.empty(0, np.uint8), NO_TIMES, NO_TIMES)

    def __repr__(self) -> str:
        return f"<Timeline of door {self.door_id}: {counted(len(self), 'interval')}>"

    def __len__(self) -> int:
        return len(self.start_ns)

    def __iter__(self) -> Iterator[Interval]:
        """Yield the intervals, the earliest first."""
        columns = (
            self.start_ns, self.end_ns, self.state, self.event, self.sightings, self.not_seen_ns,
        )  # fmt: skip
        for start, end, state, *others in zip(*(c.tolist() for c in columns), strict=True):
            yield Interval(start, end, DoorState.of(state), *others)

    @property
    def duration_ns(self) -> Times:
        """How long each interval lasted, nanoseconds."""
        return self.end_ns - self.start_ns

    @property
    def not_seen_ns(self) -> Times:
        """How much of each interval no sighting held, nanoseconds."""
        lapsed_ns = np.zeros(len(self), np.int64)
        np.add.at(lapsed_ns, self._lapsed_in(), self.lapse_end_ns - self.lapse_start_ns)
        return lapsed_ns

    @property
    def seen_ns(self) -> Times:
        """How much of each interval is covered by a sighting or a set state, nanoseconds."""
        seen: Times = self.duration_ns - self.not_seen_ns
        return seen

    @property
    def lapse_state(self) -> NDArray[np.uint8]:
        """`DoorState` that each lapse carries on."""
        return self.state[self._lapsed_in()]

    @property
    def not_seen_since_ns(self) -> int | None:
        """When the lapse began in which it ends; None: its end is known."""
        lapsed = len(self.lapse_end_ns) > 0 and self.lapse_end_ns[-1] == self.end_ns[-1]
        return int(self.lapse_start_ns[-1]) if lapsed and not self.removed else None

    def total_ns(self, state: DoorState) -> int:
        """Return how long the door was known to be in a state, nanoseconds; lapses do not count."""
        return int(self.seen_ns[self.state == state].sum())

    def spent_ns(self, state: DoorState, edges_ns: Times) -> Times:
        """Return how much of each slot the door was known to be in a state, nanoseconds.

        Args:
            state: The state.
            edges_ns: (slots + 1,), ascending: where each slot begins, and the last one ends.
        """
        chosen = self.state == state
        spent = _in_slots(self.start_ns[chosen], self.end_ns[chosen], edges_ns)
        return spent - self.lapsed_ns(state, edges_ns)

    def lapsed_ns(self, state: DoorState, edges_ns: Times) -> Times:
        """Return how much of each slot the door was not seen since it was in a state, nanoseconds.

        Args:
            state: The state.
            edges_ns: As for `spent_ns`.
        """
        chosen = self.lapse_state == state
        return _in_slots(self.lapse_start_ns[chosen], self.lapse_end_ns[chosen], edges_ns)

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
        lapse_start = np.maximum(self.lapse_start_ns, 0 if since_ns is None else since_ns)
        lapse_end = np.minimum(self.lapse_end_ns, MAX_TIME_NS if until_ns is None else until_ns)
        has_length = lapse_start < lapse_end
        return Timeline(
            self.door_id,
            start_ns=start[inside],
            end_ns=end[inside],
            state=self.state[inside],
            event=self.event[inside],
            sightings=self.sightings[inside],
            removed=removed,
            lapse_start_ns=lapse_start[has_length],
            lapse_end_ns=lapse_end[has_length],
            hold=self.hold,
        )

    def _lapsed_in(self) -> NDArray[np.intp]:
        """Return which interval each lapse lies in."""
        return np.searchsorted(self.start_ns, self.lapse_start_ns, "right") - 1

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
        """Return it as a pandas.DataFrame: start, end (UTC), state, event, sightings, seen_seconds.

        Raises:
            MissingExtraError: pyarrow or pandas is not installed.
        """
        from semmap_log.core.arrow.arrow_sdk import frame_of
        from semmap_log.core.arrow.event_view import interval_table

        return frame_of(
            interval_table(
                start_ns=self.start_ns,
                end_ns=self.end_ns,
                state=self.state,
                event=self.event,
                sightings=self.sightings,
                seen_ns=self.seen_ns,
            )
        )


def _in_slots(start_ns: Times, end_ns: Times, edges_ns: Times) -> Times:
    """Return how much of each slot of time is in intervals that do not overlap, nanoseconds."""
    before_ns = np.concatenate([np.zeros(1, np.int64), np.cumsum(end_ns - start_ns)])
    begun = np.searchsorted(start_ns, edges_ns, "right")
    # Of all that began by an edge, only the last interval may reach beyond it.
    last_end_ns = np.concatenate([edges_ns[:1], end_ns])[begun]
    beyond_ns = np.where(begun, np.maximum(last_end_ns - edges_ns, 0), 0)
    spent: Times = np.diff(before_ns[begun] - beyond_ns)
    return spent


def timeline(
    batches: Iterable[EventBatch], door_id: DoorId, *, end_ns: int | None = None, holds: int = 0
) -> Timeline:
    """Return the states of one door, as `timelines` does of many; empty where it was never added.

    Args:
        batches: As for `timelines`.
        door_id: The door.
        end_ns: As for `timelines`.
        holds: As for `timelines`.
    """
    found = timelines(batches, [door_id], end_ns=end_ns, holds=holds)
    return found[door_id] if found else Timeline.empty(door_id)


def timelines(
    batches: Iterable[EventBatch],
    doors: Collection[DoorId] | None = None,
    *,
    end_ns: int | None = None,
    holds: int = 0,
) -> dict[DoorId, Timeline]:
    """Return the states of doors, ids ascending; only of those whose adding is among the events.

    Some 22 bytes for each event that shows a state are kept until the end.

    Args:
        batches: Events in any order, retracted ones left out, none later than `end_ns`.
        doors: Only these; None: all.
        end_ns: Where the last interval ends; default, and at the least: the latest event's time.
        holds: A sighting holds for this many of its door's median gaps between looks (`hold_of`);
            0: until the next report.
    """
    reports = _Reports(None if doors is None else np.array(sorted(doors), np.int64))
    for batch in batches:
        reports.take(batch)
    end_ns = max(reports.latest_ns, end_ns or 0)
    return {life.door_id: _intervals(life, end_ns, holds) for life in reports.doors()}


class _Reports:
    """What the events say about the states of doors, in any order."""

    def __init__(self, doors: NDArray[np.int64] | None) -> None:
        self._doors = doors
        self._parts: list[door_changes.Changes] = []
        self.latest_ns = 0
        """Of all events, whatever they are about."""

    def take(self, batch: EventBatch) -> None:
        """Read a batch."""
        self.latest_ns = max(self.latest_ns, int(batch.folds_ns.max(initial=0)))
        self._parts += door_changes.parts_of(
            batch,
            door_changes.STATE_CHANGE,
            setting=door_changes.STATE | door_changes.THERE,
            doors=self._doors,
        )
        if SightingsThinned in batch:
            self._take_thinned(batch[SightingsThinned])

    def _take_thinned(self, told: NDArray[np.void]) -> None:
        if self._doors is not None:
            told = told[np.isin(told["door_id"], self._doors)]
        of_row, seen_ns = sightings_of_runs(told)
        rows = np.zeros(len(of_row), door_changes.STATE_CHANGE)
        rows["kind"], rows["folds_ns"] = SightingsThinned.kind, seen_ns
        rows["door_id"], rows["number"] = told["door_id"][of_row], told["first_event"][of_row]
        self._parts.append(rows)

    def doors(self) -> Iterator[_Life]:
        """Yield the changes of each door that was added, ids ascending."""
        changes = np.concatenate([np.empty(0, door_changes.STATE_CHANGE), *self._parts])
        changes["state"] = door_changes.known_states(changes["state"])
        order = np.lexsort((changes["number"], changes["folds_ns"], changes["door_id"]))
        changes = changes[order]
        starts = np.flatnonzero(np.diff(changes["door_id"].astype(np.int64), prepend=-1))
        for rows in np.split(changes, starts[1:]) if len(changes) else []:
            life = _Life(DoorId(int(rows["door_id"][0])), rows)
            if life.added is not None:
                yield life


class _Life:
    """The changes of one door, in the order of the fold."""

    def __init__(self, door_id: DoorId, changes: door_changes.Changes) -> None:
        self.door_id = door_id
        is_thinned = changes["kind"] == SightingsThinned.kind
        self._changes = changes[~is_thinned]
        self._thinned = changes[is_thinned]
        self.added = self._stamp(Presence.COMES)
        """(time, event number)."""
        removed = self._stamp(Presence.GOES)
        # A removal before the adding was of no door, and does not count.
        counts = removed is not None and (self.added is None or removed >= self.added)
        self.removed_ns = removed[0] if removed is not None and counts else None

    def _stamp(self, presence: Presence) -> tuple[int, int] | None:
        found = np.flatnonzero(door_changes.of_presence(self._changes, presence))
        if not len(found):
            return None
        first = self._changes[found[0]]
        return int(first["folds_ns"]), int(first["number"])

    def states(self) -> door_changes.Changes:
        """Return what counts: from the adding on, before the removal."""
        changes = self._changes[~door_changes.of_presence(self._changes, Presence.GOES)]
        found: door_changes.Changes = changes[self._counts(changes)]
        return found

    def thinned_ns(self) -> Times:
        """Return when sightings happened that were taken out; those still there do not count."""
        if not len(self._thinned):
            return NO_TIMES
        numbers = self._changes["number"]
        is_there = np.isin(self._thinned["number"], numbers) & (self._thinned["number"] > 0)
        counting = self._thinned[~is_there & self._counts(self._thinned)]
        found: Times = np.sort(counting["folds_ns"])
        return found

    def _counts(self, changes: door_changes.Changes) -> NDArray[np.bool_]:
        assert self.added is not None
        counts: NDArray[np.bool_] = ~door_changes.is_before(changes, self.added)
        if self.removed_ns is not None:
            counts &= changes["folds_ns"] < self.removed_ns
        return counts


def _intervals(life: _Life, end_ns: int, holds: int) -> Timeline:
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
    found = Timeline(
        life.door_id,
        start_ns=start,
        end_ns=np.append(start, last_ns)[1:],
        state=state,
        event=changes["number"][first],
        sightings=np.bincount(interval[agrees], minlength=len(state)),
        removed=life.removed_ns is not None,
    )
    if not holds or not len(found):
        return found
    return _with_lapses(found, changes[held], changes, life.thinned_ns(), holds)


def _with_lapses(
    found: Timeline,
    deciding: door_changes.Changes,
    changes: door_changes.Changes,
    thinned_ns: Times,
    holds: int,
) -> Timeline:
    """Return a timeline with the times in which no sighting held.

    Args:
        found: Without them.
        deciding: The reports whose states hold: of each time the last one.
        changes: All reports.
        thinned_ns: When sightings happened that were taken out, ascending.
        holds: As for `timelines`.
    """
    seen_ns = np.sort(
        np.append(changes["folds_ns"][door_changes.are_sightings(changes)], thinned_ns)
    )
    hold = hold_of(seen_ns, holds)
    told_ns = np.append(deciding["folds_ns"], thinned_ns)
    lapses = np.append(door_changes.are_sightings(deciding), np.ones(len(thinned_ns), np.bool_))
    order = np.argsort(told_ns, kind="stable")
    told_ns, lapses = told_ns[order], lapses[order]
    start_ns = np.minimum(told_ns, MAX_TIME_NS - hold.ns) + hold.ns
    end_ns = np.append(told_ns[1:], found.end_ns[-1])
    state = found.state[np.searchsorted(found.start_ns, told_ns, "right") - 1]
    lapses &= ((state == DoorState.OPEN) | (state == DoorState.CLOSED)) & (start_ns < end_ns)
    return replace(found, lapse_start_ns=start_ns[lapses], lapse_end_ns=end_ns[lapses], hold=hold)


REPEATS_NS = 60 * SECOND_NS
"""A sighting less than that after the one before is of the same pass."""
PASS_NS = 300 * SECOND_NS
"""A pass lasts at most this long: a robot that stays longer looks again."""
USUAL_GAP_NS = HOUR_NS
"""Taken as the gap between looks at a door that has fewer than `LEAST_GAPS`."""
LEAST_GAPS = 2


class Hold(NamedTuple):
    """How long a sighting of a door holds."""

    gaps: int
    """The log's setting: this many median gaps between looks."""
    gap_ns: int
    """The door's median gap; `USUAL_GAP_NS` where `looks` are too few."""
    looks: int
    """How many times the door was looked at."""

    @property
    def ns(self) -> int:
        """How long a sighting holds, nanoseconds."""
        return min(self.gaps * self.gap_ns, MAX_TIME_NS)

    @property
    def is_measured(self) -> bool:
        """False where the looks are too few for a median gap."""
        return self.looks > LEAST_GAPS


def hold_of(seen_ns: NDArray[np.int64], gaps: int) -> Hold:
    """Return how long a sighting of a door holds.

    A look is a pass, however many sightings it consists of; a gap is the time from the beginning of
    one look to the beginning of the next.

    Args:
        seen_ns: When the door was sighted, ascending.
        gaps: The log's setting.
    """
    looks_ns = seen_ns[pass_begins(seen_ns)]
    measured = len(looks_ns) > LEAST_GAPS
    gap_ns = _median(np.diff(looks_ns)) if measured else USUAL_GAP_NS
    return Hold(gaps, gap_ns, len(looks_ns))


def _median(values: NDArray[np.int64]) -> int:
    low, high = np.sort(values)[[(len(values) - 1) // 2, len(values) // 2]].tolist()
    return int(low + (high - low) // 2)


def pass_begins(
    seen_ns: NDArray[np.int64], is_parted: NDArray[np.bool_] | None = None
) -> NDArray[np.bool_]:
    """Return which sightings begin a pass.

    Args:
        seen_ns: (k,), ascending where nothing parts them.
        is_parted: (k - 1,): whether a pass ends before the second, the third sighting, and so on.
    """
    begins = np.ones(len(seen_ns), np.bool_)
    begins[1:] = np.diff(seen_ns) >= REPEATS_NS
    if is_parted is not None:
        begins[1:] |= is_parted
    starts = np.flatnonzero(begins)
    ends = np.append(starts, len(begins))[1:]
    is_long = seen_ns[ends - 1] - seen_ns[starts] > PASS_NS
    for start, end in zip(starts[is_long].tolist(), ends[is_long].tolist(), strict=True):
        times = seen_ns[start:end]
        following = np.searchsorted(times, times + PASS_NS, "right").tolist()
        at = following[0]
        while at < len(following):
            begins[start + at] = True
            at = following[at]
    return begins
