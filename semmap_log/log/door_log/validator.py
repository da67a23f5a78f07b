"""Intent against state: may this event be appended to the map as it stands?

Checking an intent is apart from applying a fact: what is in the log is never judged again.

What a commit tells of doors before they were added.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import repeat

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.batches.taken_columns import TakenColumns
from semmap_log.core.folds.early_events import MAY_BE_EARLY, Addings, EarlyEvents
from semmap_log.core.folds.levels import only_level, told
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.doors import is_given
from semmap_log.core.model.events import (
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorRemoved,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    Retracted,
    SightingsThinned,
    UnknownEvent,
)
from semmap_log.core.model.meaning import PLACING, Changed
from semmap_log.errors import (
    CommandError,
    DoorExistsError,
    DoorRemovedError,
    InvalidEventError,
    UnknownDoorError,
    UnknownLevelError,
)
from semmap_log.log.door_log.door_index import (
    HARMLESS,
    ON_A_LEVEL,
    SIGHTINGS,
    DoorIndex,
    kinds_of,
    lacks_levels,
    rows_to_check,
    told_absent,
    with_levels,
)
from semmap_log.log.door_log.known_past import KnownPast


class Validator:
    """Checks the events of one commit, each against the map and the events before it."""

    def __init__(
        self,
        index: DoorIndex,
        next_event: int,
        now_ns: Callable[[], int] | None = None,
        *,
        are_facts: bool = False,
        past: KnownPast | None = None,
        first_new: int | None = None,
    ) -> None:
        """Take up a commit.

        Args:
            index: The doors and levels before it.
            next_event: The number of its first event.
            now_ns: The log's clock, by which events without a time happen; None: not known.
            are_facts: Another log took the events; what is said there of a door after its removal
                stays in its history.
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
        it knows: then it must be made anew."""
        self.has_retraction = False
        self.keeps_names = True
        """Which name means which door is as it was before."""
        self._is_own = False
        self._first = next_event if first_new is None else first_new
        self._next_event = next_event
        self._timeless: list[DoorAdded | DoorRemoved] = []
        self._taken_back: dict[int, int] = {}
        """Doors whose adding this commit retracts -> when they had been added."""
        self.early: EarlyCounter | None = None
        """Of what passed and had happened before its door was added; None: nothing did."""

    def check_all(self, events: Sequence[Event | EventBatch]) -> Sequence[Event | EventBatch]:
        """Let these events pass, one after the other; return them, all with their levels.

        Raises:
            CommandError: The map forbids one.
        """
        kinds = set(map(type, events))
        if kinds <= _SIGHTINGS:
            taken = TakenColumns(events, kinds)  # type: ignore[arg-type]
            if all(map(self.index.placed.__contains__, taken.door_ids)):  # nearly every commit
                self._next_event += len(events)  # of a patrol: nothing else can be wrong
                self._note_early(taken)
                return taken
        return list(self.checked(events))

    def checked(self, events: Iterable[Event | EventBatch]) -> Iterator[Event | EventBatch]:
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
        """Let many events pass, all at once but for those that `check` has more to ask about.

        Yields:
            Batches of them, in their order, with the levels that they did not tell.

        Raises:
            InvalidEventError: A value that no event can have.
            CommandError: As `check`.
        """
        batch.check()
        for part in batch.parts(ROWS_AT_A_TIME) if lacks_levels(batch) else [batch]:
            if lacks_levels(part) and all(kind in HARMLESS for kind in kinds_of(part)):
                self._check_rows(part)
                yield with_levels(part, only_level(self.index.levels))
            elif lacks_levels(part):
                yield EventBatch.from_events([self.check(event) for event in part.to_events()])
            else:
                self._check_rows(part)
                yield part

    def _check_rows(self, batch: EventBatch) -> None:
        for part in batch.parts(ROWS_AT_A_TIME):
            first = self._next_event
            asked = rows_to_check(part, self.index)
            if asked is not None:
                rows = np.flatnonzero(asked).tolist()
                for row, recorded in zip(rows, part.select(asked), strict=True):
                    self._next_event = first + row
                    self._let_pass(recorded.event)
            if self._past is not None:
                self._past.check_late(part)
            self._early().note_rows(part, self.index.added_ns)
            self.keeps_names &= DoorUpdated not in part
            self._next_event = first + len(part)

    def check(self, event: Event) -> Event:
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

    def _let_pass(self, event: Event) -> Event:
        if isinstance(event, SIGHTINGS) and event.door_id in self.index.placed:
            self._next_event += 1  # nearly every event of a patrol: nothing else can be wrong
            return event
        event = self.with_level(event)
        if isinstance(event, DoorAdded):
            self._check_new(event)
        elif isinstance(event, DoorEvent):
            self._check_known(event)
            if isinstance(event, DoorUpdated):
                self._check_update(event)
            elif isinstance(event, DoorRemoved):
                self._check_removal(event)
        elif isinstance(event, Retracted):
            self._check_retraction(event)
            self.is_index_sure, self.has_retraction = False, True
            self._own_index()
            self._taken_back |= self.index.take_back(event.first_event, event.last_event)
        elif isinstance(event, UnknownEvent):
            expected = "an event of a kind that this version knows"
            raise InvalidEventError("event", expected, type(event).__name__)
        self.keeps_names &= not isinstance(event, NAMING)
        if self._changes_index(event):
            self._own_index()
            self.index.apply(event, self._next_event)
            if isinstance(event, DoorAdded) and event.happened_ns is not None and self._now_ns:
                # One that is said to come later counts from when it is recorded.
                self.index.added_ns[event.door_id] = min(event.happened_ns, self._now_ns())
            if event.happened_ns is None and isinstance(event, (DoorAdded, DoorRemoved)):
                self._timeless.append(event)
            if event.happened_ns is not None and isinstance(event, MAY_BE_OUTDONE):
                self.is_index_sure = False
        self._next_event += 1
        return event

    def with_level(self, event: Event) -> Event:
        """Return the event with the level that it did not tell: see `levels`.

        Raises:
            UnknownLevelError: There are several.
        """
        if not isinstance(event, ON_A_LEVEL) or is_given(event.level):
            return event
        if not isinstance(event, DoorUpdated):
            return replace(event, level=self.index.level_meant(event.level))
        if Changed.POSE not in event.changed:
            return event  # its level means nothing
        return replace(event, level=self.index.level_of.get(event.door_id, 0))

    def settle(self, commit: Commit) -> None:
        """Give the doors that came and went without a time the one of their commit."""
        for event in self._timeless:
            if isinstance(event, DoorAdded):
                self.index.added_ns[event.door_id] = commit.wall_clock_ns
            else:
                self.index.removed_ns[event.door_id] = commit.wall_clock_ns

    def _note_early(self, events: TakenColumns) -> None:
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

    def _changes_index(self, event: Event) -> bool:
        if isinstance(event, DoorUpdated):
            known = self.index.level_of.get(event.door_id, event.level)
            goes = Changed.POSE in event.changed and event.level != known
            places = bool(self._moves(event)) and not self.index.placed.get(event.door_id, True)
            return goes or places
        if isinstance(event, Retracted):
            return self.index.brought_back(event) is not None
        return isinstance(event, (DoorAdded, DoorRemoved, LevelAdded, FloorMap, ClassDefined))

    def _check_new(self, event: DoorAdded) -> None:
        door_id = event.door_id
        if door_id in self.index.placed:
            raise DoorExistsError(f"door {door_id} is in the map already; choose another id.")
        if door_id in self._taken_back:
            self._check_correction(event, self._taken_back[door_id])
        elif door_id in self.index.used_ids:
            raise DoorRemovedError(
                f"{self.index.told(door_id)} was removed, and an id is never used twice; "
                f"the next free id is {self.index.next_free_id}.{self.index.way_back(door_id)}"
            )
        self._check_level(event.level)

    def _check_correction(self, event: DoorAdded, before_ns: int) -> None:
        """Return if an adding takes the place of the one that the same commit retracts."""
        if event.happened_ns is None or event.happened_ns > before_ns:
            raise DoorRemovedError(
                f"door {event.door_id}: its adding is retracted, and may be told again in the same "
                "commit, under its id, at an earlier time only; a later door wants a new id."
            )

    def _check_known(self, event: DoorEvent) -> None:
        door_id = event.door_id
        if door_id in self.index.placed:
            return
        if isinstance(event, SightingsThinned) and door_id in self.index.used_ids:
            return  # of sightings that the log holds
        removed_ns = self.index.removed_ns.get(door_id)
        if removed_ns is None:
            raise UnknownDoorError(told_absent(door_id))
        is_late = event.happened_ns is None or event.happened_ns > removed_ns
        if is_late and not self._are_facts:
            raise DoorRemovedError(
                f"{self.index.told(door_id)} was removed; only what happened before that can be "
                f"added to it.{self.index.way_back(door_id)}"
            )

    def _check_update(self, event: DoorUpdated) -> None:
        moves = self._moves(event)
        if moves & Changed.POSE:
            self._check_level(event.level)
        if moves and moves != PLACING and not self.index.placed.get(event.door_id, True):
            raise CommandError(
                f"door {event.door_id} has no place yet; to place it, give pose and width together."
            )

    @staticmethod
    def _moves(event: DoorUpdated) -> Changed:
        return event.changed & PLACING

    def _check_removal(self, event: DoorRemoved) -> None:
        if event.door_id not in self.index.placed:
            told, way_back = self.index.told(event.door_id), self.index.way_back(event.door_id)
            raise DoorRemovedError(f"{told} was removed already.{way_back}")
        added_ns = self.index.added_ns.get(event.door_id, 0)
        if event.happened_ns is not None and event.happened_ns < added_ns:
            raise CommandError(f"door {event.door_id} cannot be removed before it was added.")
        if event.happened_ns is None and self._now_ns and self._now_ns() < added_ns < MAX_TIME_NS:
            raise CommandError(
                f"door {event.door_id} cannot be removed before it was added: the clock has gone "
                "back since then; set it right, or say when it was removed."
            )

    def _check_retraction(self, event: Retracted) -> None:
        first, last, own = event.first_event, event.last_event, range(self._first, self._next_event)
        if self._past is not None:
            self._past.check_retraction(first, last, own=own, are_facts=self._are_facts)
        elif last >= own.stop:
            raise CommandError(
                f"cannot retract events {first}..{last}: the last event is {own.stop - 1}."
            )

    def _check_level(self, level: int) -> None:
        if level != 0 and level not in self.index.level_names:
            raise UnknownLevelError(
                f"no level {level}; there are: {told(self.index.levels) or '0'}."
            )


def _latest(added_ns: Mapping[int, int], door_ids: Iterable[int]) -> int:
    """Return when the last of these doors was added."""
    return max(map(added_ns.get, door_ids, repeat(0)))


ROWS_AT_A_TIME = 8192
"""So many rows of a batch are checked at once."""

_SIGHTINGS = frozenset(SIGHTINGS)

MAY_BE_OUTDONE = (DoorUpdated, LevelAdded, ClassDefined)
"""Kinds of which another may have happened later, and been told before."""

NAMING = (DoorAdded, DoorUpdated, DoorRemoved, DoorAnnotated, LevelAdded, Retracted)
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
        """What the clock said when it was first asked."""
        self.found = EarlyEvents.none()

    def note(self, event: Event, added_ns: Mapping[int, int]) -> None:
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
