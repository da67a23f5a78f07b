"""Intent against state: may this event be appended to the map as it stands?

Checking an intent is separate from applying a fact: what is in the log is never judged again.

Also what a trimmed log no longer knows of its past, and so can neither retract nor correct; what
can be retracted, and what a retraction did; and the events of a commit from before their door was
added.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import repeat
from typing import TYPE_CHECKING
from weakref import WeakMethod

import numpy as np

from semmap_log import errors
from semmap_log.core.batches.columnar_events import ColumnarEvents
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds import door_index
from semmap_log.core.folds.early_events import MAY_BE_EARLY, Addings, EarlyEvents
from semmap_log.core.folds.history import HistoryEntry, history
from semmap_log.core.folds.levels import only_level, told
from semmap_log.core.folds.registers import COMES, state_rows, writes_of
from semmap_log.core.folds.thinned_runs import HOUR_NS, ThinnedRun, ThinnedRuns
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model import events as ev
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.doors import DoorState, is_given
from semmap_log.core.model.meaning import PLACING, Changed
from semmap_log.core.model.moments import format_local
from semmap_log.store.pages import kinds_mask
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window

if TYPE_CHECKING:
    from semmap_log.core.batches.event_batch import Retractions
    from semmap_log.log.door_log.door_log import DoorLog


class Validator:
    """Checks the events of one commit, each against the map and the events before it."""

    def __init__(
        self,
        index: door_index.DoorIndex,
        next_event: int,
        now_ns: Callable[[], int] | None = None,
        *,
        are_facts: bool = False,
        past: KnownPast | None = None,
        first_new: int | None = None,
    ) -> None:
        """Begin a commit.

        Args:
            index: The doors and levels before it.
            next_event: The number of its first event.
            now_ns: The log's clock, by which events without a time happen; None: not known.
            are_facts: Another log took the events; those about a door after its removal stay in
                its history.
            past: What the log still holds of its past; None: all of it.
            first_new: Number of the first event that the log does not hold yet; None: the first of
                this commit.
        """
        self._are_facts = are_facts
        self._past = past
        self._now_ns = now_ns
        self.index = index
        """The index after the events that passed; the one that was given stays as it was."""
        self.is_index_sure = True
        """An index cannot follow a retraction, nor what may have happened before something that
        it knows: then it must be rebuilt."""
        self.has_retraction = False
        self.keeps_names = True
        """Which name means which door is as it was before."""
        self._is_own = False
        self._first = next_event if first_new is None else first_new
        self._next_event = next_event
        self._timeless: list[ev.DoorAdded | ev.DoorRemoved] = []
        self._retracted: dict[int, int] = {}
        """Doors whose adding this commit retracts -> when they had been added."""
        self.early: EarlyCounter | None = None
        """Of what passed and had happened before its door was added; None: nothing did."""

    def check_all(self, events: Sequence[ev.Event | EventBatch]) -> Sequence[ev.Event | EventBatch]:
        """Let these events pass, one after the other; return them, all with their levels.

        Raises:
            CommandError: The map forbids one.
        """
        kinds = set(map(type, events))
        if kinds <= _SIGHTINGS:
            taken = ColumnarEvents(events, kinds)  # type: ignore[arg-type]
            if all(map(self.index.placed.__contains__, taken.door_ids)):  # nearly every commit
                self._next_event += len(events)  # of a patrol: nothing else can be wrong
                self._note_early(taken)
                return taken
        return list(self.checked(events))

    def checked(self, events: Iterable[ev.Event | EventBatch]) -> Iterator[ev.Event | EventBatch]:
        """Yield each of the events once it has passed, with its level.

        Raises:
            CommandError: The map forbids one.
        """
        for event in events:
            if isinstance(event, EventBatch):
                yield from self.check_batch(event)
            else:
                yield self.check(event)

    def check_batch(self, batch: EventBatch) -> Iterator[EventBatch]:
        """Let many events pass, all at once except those that need `check`.

        Yields:
            Batches of them, in their order, with the levels that they did not state.

        Raises:
            InvalidEventError: A value that no event can have.
            CommandError: As `check`.
        """
        batch.check()
        for part in batch.parts(ROWS_AT_A_TIME) if door_index.lacks_levels(batch) else [batch]:
            if door_index.lacks_levels(part) and all(
                kind in door_index.HARMLESS for kind in door_index.kinds_of(part)
            ):
                self._check_rows(part)
                yield door_index.with_levels(part, only_level(self.index.levels))
            elif door_index.lacks_levels(part):
                yield EventBatch.from_events([self.check(event) for event in part.to_events()])
            else:
                self._check_rows(part)
                yield part

    def _check_rows(self, batch: EventBatch) -> None:
        for part in batch.parts(ROWS_AT_A_TIME):
            first = self._next_event
            asked = door_index.rows_to_check(part, self.index)
            if asked is not None:
                rows = np.flatnonzero(asked).tolist()
                for row, recorded in zip(rows, part.select(asked), strict=True):
                    self._next_event = first + row
                    self._let_pass(recorded.event)
            if self._past is not None:
                self._past.check_late(part)
            self._early().note_rows(part, self.index.added_ns)
            self.keeps_names &= ev.DoorUpdated not in part
            self._next_event = first + len(part)

    def check(self, event: ev.Event) -> ev.Event:
        """Let the event pass, and return it with its level.

        Raises:
            InvalidEventError: It is of a kind that a later version has added.
            CommandError: The map forbids it; the message says what is there instead.
        """
        event = self._let_pass(event)
        at_ns = event.happened_ns
        if at_ns is not None and self._past is not None and self._past.is_late(at_ns):
            self._past.check_late(EventBatch.from_events([event]))
        self._early().note(event, self.index.added_ns)
        return event

    def _let_pass(self, event: ev.Event) -> ev.Event:
        if isinstance(event, door_index.SIGHTINGS) and event.door_id in self.index.placed:
            self._next_event += 1  # nearly every event of a patrol: nothing else can be wrong
            return event
        event = self.with_level(event)
        if isinstance(event, ev.DoorAdded):
            self._check_new(event)
        elif isinstance(event, ev.DoorEvent):
            self._check_known(event)
            if isinstance(event, ev.DoorUpdated):
                self._check_update(event)
            elif isinstance(event, ev.DoorRemoved):
                self._check_removal(event)
        elif isinstance(event, ev.Retracted):
            self._check_retraction(event)
            self.is_index_sure, self.has_retraction = False, True
            self._own_index()
            self._retracted |= self.index.take_back(event.first_event, event.last_event)
        elif isinstance(event, ev.UnknownEvent):
            expected = "an event of a kind that this version knows"
            raise errors.InvalidEventError("event", expected, type(event).__name__)
        self.keeps_names &= not isinstance(event, NAMING)
        if self._changes_index(event):
            self._own_index()
            self.index.apply(event, self._next_event)
            if isinstance(event, ev.DoorAdded) and event.happened_ns is not None and self._now_ns:
                # One that is dated in the future counts from when it is recorded.
                self.index.added_ns[event.door_id] = min(event.happened_ns, self._now_ns())
            if event.happened_ns is None and isinstance(event, (ev.DoorAdded, ev.DoorRemoved)):
                self._timeless.append(event)
            if event.happened_ns is not None and isinstance(event, MAY_BE_OUTDONE):
                self.is_index_sure = False
        self._next_event += 1
        return event

    def with_level(self, event: ev.Event) -> ev.Event:
        """Return the event with the level that it did not state: see `levels`.

        Raises:
            UnknownLevelError: There are several.
        """
        if not isinstance(event, door_index.ON_A_LEVEL) or is_given(event.level):
            return event
        if not isinstance(event, ev.DoorUpdated):
            return replace(event, level=self.index.level_meant(event.level))
        if Changed.POSE not in event.changed:
            return event  # its level means nothing
        return replace(event, level=self.index.level_of.get(event.door_id, 0))

    def settle(self, commit: Commit) -> None:
        """Give the doors that came and went without a time the one of their commit."""
        for event in self._timeless:
            if isinstance(event, ev.DoorAdded):
                self.index.added_ns[event.door_id] = commit.wall_clock_ns
            else:
                self.index.removed_ns[event.door_id] = commit.wall_clock_ns

    def _note_early(self, events: ColumnarEvents) -> None:
        """Count those that had happened before their door was added.

        Args:
            events: They passed.
        """
        times, added_ns = events.given_times(), self.index.added_ns
        if not times:
            return
        first = min(times)
        if self._past is not None and self._past.is_late(first):
            self._past.check_late(EventBatch.from_events(list(events)))
        if first < self.index.latest_added_ns and first < _latest(added_ns, events.door_ids):
            early = self._early()
            for event in events:
                early.note(event, added_ns)

    def _early(self) -> EarlyCounter:
        if self.early is None:
            self.early = EarlyCounter(self._now_ns)
        return self.early

    def _own_index(self) -> None:
        if not self._is_own:
            self.index, self._is_own = self.index.copy(), True

    def _changes_index(self, event: ev.Event) -> bool:
        if isinstance(event, ev.DoorUpdated):
            known = self.index.level_of.get(event.door_id, event.level)
            goes = Changed.POSE in event.changed and event.level != known
            places = bool(self._moves(event)) and not self.index.placed.get(event.door_id, True)
            return goes or places
        if isinstance(event, ev.Retracted):
            return self.index.brought_back(event) is not None
        return isinstance(
            event, (ev.DoorAdded, ev.DoorRemoved, ev.LevelAdded, ev.FloorMap, ev.ClassDefined)
        )

    def _check_new(self, event: ev.DoorAdded) -> None:
        door_id = event.door_id
        if door_id in self.index.placed:
            raise errors.DoorExistsError(
                f"door {door_id} is in the map already; choose another id."
            )
        if door_id in self._retracted:
            self._check_correction(event, self._retracted[door_id])
        elif door_id in self.index.used_ids:
            raise errors.DoorRemovedError(
                f"{self.index.told(door_id)} was removed, and an id is never used twice; "
                f"the next free id is {self.index.next_free_id}.{self.index.way_back(door_id)}"
            )
        self._check_level(event.level)

    def _check_correction(self, event: ev.DoorAdded, before_ns: int) -> None:
        """Check that an adding replaces one that the same commit retracts."""
        if event.happened_ns is None or event.happened_ns > before_ns:
            raise errors.DoorRemovedError(
                f"door {event.door_id}: its addition is retracted. It may be added again only in "
                "the same commit, with its id and an earlier time; a later door needs a new id."
            )

    def _check_known(self, event: ev.DoorEvent) -> None:
        door_id = event.door_id
        if door_id in self.index.placed:
            return
        if isinstance(event, ev.SightingsThinned) and door_id in self.index.used_ids:
            return  # of sightings that the log holds
        removed_ns = self.index.removed_ns.get(door_id)
        if removed_ns is None:
            raise errors.UnknownDoorError(door_index.absence_message(door_id))
        is_late = event.happened_ns is None or event.happened_ns > removed_ns
        if is_late and not self._are_facts:
            raise errors.DoorRemovedError(
                f"{self.index.told(door_id)} was removed; only what happened before that can be "
                f"added to it.{self.index.way_back(door_id)}"
            )

    def _check_update(self, event: ev.DoorUpdated) -> None:
        moves = self._moves(event)
        if moves & Changed.POSE:
            self._check_level(event.level)
        if moves and moves != PLACING and not self.index.placed.get(event.door_id, True):
            raise errors.CommandError(
                f"door {event.door_id} has no place yet; to place it, give pose and width together."
            )

    @staticmethod
    def _moves(event: ev.DoorUpdated) -> Changed:
        return event.changed & PLACING

    def _check_removal(self, event: ev.DoorRemoved) -> None:
        if event.door_id not in self.index.placed:
            told, way_back = self.index.told(event.door_id), self.index.way_back(event.door_id)
            raise errors.DoorRemovedError(f"{told} was removed already.{way_back}")
        added_ns = self.index.added_ns.get(event.door_id, 0)
        if event.happened_ns is not None and event.happened_ns < added_ns:
            raise errors.CommandError(
                f"door {event.door_id} cannot be removed before it was added."
            )
        if event.happened_ns is None and self._now_ns and self._now_ns() < added_ns < MAX_TIME_NS:
            raise errors.CommandError(
                f"door {event.door_id} cannot be removed before it was added: the clock has gone "
                "back since then; set it right, or say when it was removed."
            )

    def _check_retraction(self, event: ev.Retracted) -> None:
        first, last, own = event.first_event, event.last_event, range(self._first, self._next_event)
        if self._past is not None:
            self._past.check_retraction(first, last, own=own, are_facts=self._are_facts)
        elif last >= own.stop:
            raise errors.CommandError(
                f"cannot retract events {first}..{last}: the last event is {own.stop - 1}."
            )

    def _check_level(self, level: int) -> None:
        if level != 0 and level not in self.index.level_names:
            raise errors.UnknownLevelError(
                f"no level {level}; there are: {told(self.index.levels) or '0'}."
            )


def _latest(added_ns: Mapping[int, int], door_ids: Iterable[int]) -> int:
    """Return when the last of these doors was added."""
    return max(map(added_ns.get, door_ids, repeat(0)))


ROWS_AT_A_TIME = 8192
"""So many rows of a batch are checked at once."""

_SIGHTINGS = frozenset(door_index.SIGHTINGS)

MAY_BE_OUTDONE = (ev.DoorUpdated, ev.LevelAdded, ev.ClassDefined)
"""Kinds for which a later-happened event may have been appended earlier."""

NAMING = (
    ev.DoorAdded,
    ev.DoorUpdated,
    ev.DoorRemoved,
    ev.DoorAnnotated,
    ev.LevelAdded,
    ev.Retracted,
)
"""Kinds that may change which name means which door (an update: by its level)."""


class EarlyCounter:
    """Counts the events of one commit that had happened before their door was added."""

    def __init__(self, now_ns: Callable[[], int] | None) -> None:
        """Begin with none.

        Args:
            now_ns: The log's clock, by which events without a time happen; None: not known.
        """
        self._now_ns = now_ns
        self._began_ns: int | None = None
        """The time of the first reading of the clock."""
        self.found = EarlyEvents.none()

    def note(self, event: ev.Event, added_ns: Mapping[int, int]) -> None:
        """Count an event that passed if it had happened before its door was added.

        Args:
            event: The event.
            added_ns: When each door was added; a time at the end of time: not known yet.
        """
        if not isinstance(event, MAY_BE_EARLY) or event.happened_ns is None:
            return
        since_ns = added_ns.get(event.door_id, 0)
        if event.happened_ns < since_ns and event.happened_ns < self._since_ns(since_ns):
            self.found.add(event.door_id, event.happened_ns)

    def note_rows(self, batch: EventBatch, added_ns: Mapping[int, int]) -> None:
        """Count those of a batch: as `note`."""
        if len(added_ns) > len(batch):  # only its own doors, or many small batches cost much
            mine = set(batch.door_ids().tolist())
            added_ns = {i: added_ns[i] for i in mine if i in added_ns}
        latest_ns = max(added_ns.values(), default=0)
        times = batch.happened_ns
        if not ((times >= 0) & (times < latest_ns)).any():
            return
        early = Addings.of({i: (ns, -1) for i, ns in added_ns.items()}).early(batch, times)
        timeless = [i for i, ns in added_ns.items() if ns == MAX_TIME_NS]
        unsure = early & np.isin(batch.door_ids(), timeless)
        if unsure.any():
            early &= ~unsure | (times < self._since_ns(MAX_TIME_NS))
        if early.any():
            self.found.add_rows(batch.door_ids()[early], times[early])

    def _since_ns(self, added_ns: int) -> int:
        """Return when a door was added; one that is added without a time: now."""
        if added_ns < MAX_TIME_NS:
            return added_ns
        if self._began_ns is None:
            self._began_ns = 0 if self._now_ns is None else self._now_ns()
        return self._began_ns


class KnownPast:
    """Checks what new events say of the past against what the log still holds of it.

    Thinned sightings are those that it holds at the first query: only the writer's lock allows
    thinning a log.
    """

    def __init__(self, get_reader: WeakMethod[Callable[[], LogReader]]) -> None:
        """Prepare; nothing is read.

        Args:
            get_reader: Returns a reader of the log as it is now.
        """
        self._get_reader = get_reader
        self._starts: dict[ThinnedRun, int] = {}

    @property
    def whole_from(self) -> int:
        """Number of the first event after all segments from which something was taken out."""
        headers = (segment.header for segment in self._reader().segments)
        return max((h.trimmed.next_event for h in headers if h.trimmed is not None), default=0)

    def check_retraction(
        self, first: int, last: int, *, own: range = range(0), are_facts: bool = False
    ) -> None:
        """Check that events can be taken back; as `check_can_retract`."""
        check_can_retract(self._reader(), first, last, own=own, are_facts=are_facts)

    def is_late(self, at_ns: int) -> bool:
        """Return whether a time is earlier than the last sighting that was thinned."""
        return at_ns < self._thinned_until_ns

    def check_late(self, batch: EventBatch) -> None:
        """Check that no event sets a state between sightings of another state that are gone.

        Until when it would hold is not known: until the next sighting, and that is gone.

        Args:
            batch: Events that are about to be appended, with the times they are given.

        Raises:
            CommandError: One does.
        """
        times = batch.happened_ns
        is_late = (times >= 0) & (times < self._thinned_until_ns)
        if not is_late.any():
            return
        for writes in writes_of(batch):
            if writes.register != "state":
                continue
            late = np.flatnonzero(is_late[writes.positions])
            states = writes.values_of(late)["state"].tolist()
            places = writes.positions[late]
            rows = zip(batch.door_ids()[places].tolist(), times[places].tolist(), states,
                       strict=True)  # fmt: skip
            for door_id, at_ns, state in rows:
                self._check_state(door_id, at_ns, state)

    def _check_state(self, door_id: int, at_ns: int, state: int) -> None:
        for run in self._thinned.around(door_id, at_ns):
            if run.state != state and at_ns >= self._start_of(run):
                raise self._refusal(run, at_ns, state)

    def _start_of(self, run: ThinnedRun) -> int:
        """Return when the sighting before a run happened: the last that is left."""
        if run not in self._starts:
            begin_ns = run.first_ns // HOUR_NS * HOUR_NS
            reader = self._reader()
            window = Window(
                happened_from_ns=begin_ns,
                happened_before_ns=run.first_ns + 1,
                first_event=reader.horizon or None,
                kinds=kinds_mask(ev.STATE_KINDS),
            )
            hidden = reader.retractions()
            rows = state_rows(map(hidden.visible, reader.batches(window, doors=[run.door_id])))
            is_state = (rows["door_id"] == run.door_id) & (rows["state"] < COMES)
            start_ns = int(rows["folds_ns"][is_state].max(initial=begin_ns))
            self._starts[run] = start_ns
        return self._starts[run]

    def _reader(self) -> LogReader:
        get_reader = self._get_reader()
        assert get_reader is not None, "who checks holds the map"
        return get_reader()

    @cached_property
    def _thinned_until_ns(self) -> int:
        return self._thinned.until_ns

    @cached_property
    def _thinned(self) -> ThinnedRuns:
        reader, found = self._reader(), ThinnedRuns()
        hidden = reader.retractions()
        kept = Window(kinds=kinds_mask([ev.SightingsThinned]), first_event=reader.horizon or None)
        for batch in reader.batches(kept):
            found.apply(hidden.visible(batch))
        return found

    def _refusal(self, run: ThinnedRun, at_ns: int, state: int) -> errors.CommandError:
        tz = self._reader().info.timezone
        at, start, last = (format_local(ns, tz) for ns in (at_ns, self._start_of(run), run.last_ns))
        was, said = DoorState(run.state).name, DoorState(state).name
        return errors.CommandError(
            f"door {run.door_id} cannot have been {said} at {at}: the sightings of it as {was} "
            f"from {start} to {last} were thinned (retain --thin), so how long it was {said} would "
            "not be known. Give a time outside of that span, or annotate the door."
        )


def check_can_retract(
    reader: LogReader, first: int, last: int, *, own: range, are_facts: bool = False
) -> None:
    """Check that events can be taken back: they are there, and at least one of them still counts.

    Args:
        reader: Of the log.
        first: Number of the first event.
        last: Number of the last, inclusive.
        own: Numbers of the earlier events of its own commit, which can be taken back, too.
        are_facts: Another log took the retraction: it may hide nothing new.

    Raises:
        CommandError: They cannot; the message says what is there instead.
    """
    what = f"event {first}" if first == last else f"events {first}..{last}"
    if last < first:
        raise errors.CommandError(f"cannot retract {what}: the range runs backwards; swap the two.")
    end = own.stop - 1 if last in own else reader.last_event()
    if first < 0 or last > end:
        there = "the log holds none yet" if end < 0 else f"the log holds 0..{end}"
        raise errors.CommandError(f"cannot retract {what}: {there}.")
    if first < (whole := reader.first_whole_event):
        raise errors.CommandError(
            f"cannot retract {what}: what was before event {whole} is no longer kept in full "
            "(retain), so the state without it is unknown; record again what is true."
        )
    if are_facts:
        return
    known = reader.retractions()
    if next(_newly_hidden(first, last, known, known.numbers), None) is not None:
        return
    inside = [number for number in known.numbers if first <= number <= last]
    if inside:
        raise errors.CommandError(
            f"cannot retract {what}: event {inside[0]} is itself a retraction, which cannot be "
            "taken back; record again what is true."
        )
    if first == last and not any(
        known.hidden(b).any()
        for b in reader.batches(Window(first_event=first, before_event=first + 1))
    ):
        return  # it is about the log itself: no range has hidden it
    by = known.first_hiding(first)
    raise errors.CommandError(f"cannot retract {what}: taken back already, by event {by}.")


def newly_hidden(log: DoorLog, number: int) -> Iterator[HistoryEntry]:
    """Yield the events that the retraction of that number hid, and none before it had.

    Raises:
        LogError: There is no such event.
    """
    event = log.event(number).event
    assert isinstance(event, ev.Retracted)
    hidden = log.retractions(limit=number)
    finder = log.note_finder()
    earlier = hidden.up_to(number - 1)
    for first, last in _newly_hidden(event.first_event, event.last_event, earlier, hidden.numbers):
        window = Window(first_event=first, before_event=last + 1)
        batches = log.batches_in(window, on_page=finder.look_at)
        yield from history(batches, finder.note_texts_of, hidden)


def _newly_hidden(
    first: int, last: int, earlier: Retractions, retractions: Iterable[int]
) -> Iterator[tuple[int, int]]:
    """Yield what is left of a range without what was hidden earlier, and without retractions."""
    gaps = [*earlier.ranges, *((number, number) for number in retractions)]
    for gap_first, gap_last in sorted(gaps):
        if gap_first > first:
            yield first, min(gap_first - 1, last)
        first = max(first, gap_last + 1)
        if first > last:
            return
    yield first, last
