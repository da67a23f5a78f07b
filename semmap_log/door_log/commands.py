"""Intent against state: may this event be appended to the map as it stands?

Checking an intent is apart from applying a fact: what is in the log is never judged again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.batches.event_batch import EventBatch
from semmap_log.common.texts import command_line
from semmap_log.domain.commits import Commit
from semmap_log.domain.doors import MAX_DOOR_ID, DoorId, DoorMap, is_given, next_door_id
from semmap_log.domain.events import (
    KINDS,
    NO_LEVEL,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorRemoved,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
    UnknownEvent,
    is_whole_number,
)
from semmap_log.domain.meaning import PLACING, Changed, Presence
from semmap_log.door_log.removed_doors import ID_PREFIX, told_absent, told_door, which_id
from semmap_log.errors import (
    CommandError,
    DoorExistsError,
    DoorRemovedError,
    InvalidEventError,
    UnknownDoorError,
    UnknownLevelError,
)
from semmap_log.folds.door_map import DoorMapState
from semmap_log.folds.early_events import MAY_BE_EARLY, Addings, EarlyEvents
from semmap_log.folds.levels import level_called, only_level, told
from semmap_log.io.clock import MAX_TIME_NS
from semmap_log.messages import OBJECT_KINDS


@dataclass(frozen=True, slots=True)
class Removal:
    """How a door left the map."""

    event: int
    """The number of its removal."""
    was_placed: bool
    level: int


@dataclass(slots=True)
class Roster:
    """Which doors and levels there are, as far as commands need to know: cheap to keep current."""

    placed: dict[int, bool]
    """Doors in the map -> whether they have a place."""
    added_ns: dict[int, int]
    removed_ns: dict[int, int]
    added_event: dict[int, int]
    """Doors that were added -> the number of that event, where it is known."""
    used_ids: set[int]
    """Every id that was ever given."""
    level_of: dict[int, int]
    """Doors in the map -> their level."""
    level_names: dict[int, str | None]
    """Levels that have a name or a floor map -> the name."""
    removals: dict[int, Removal]
    """Doors that were removed, as far as that can be taken back."""
    log: Path = field(default=Path("LOG"), repr=False, compare=False)
    """Where the log is, for messages."""
    names: Callable[[], Mapping[DoorId, str]] = field(default=dict, repr=False, compare=False)
    """What doors are called, removed ones too: for messages."""
    _levels: dict[int, str | None] | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, state: DoorMapState) -> Roster:
        """Return the roster of a door map."""
        ids = state.used_door_ids
        placed = {i: state.is_placed(i) for i in ids if state.is_present(i)}
        return cls(
            placed=placed,
            added_ns={i: stamp[0] for i in ids if (stamp := state.stamp(i, "added"))},
            removed_ns={i: stamp[0] for i in ids if (stamp := state.stamp(i, "removed"))},
            added_event={i: stamp[1] for i in ids if (stamp := state.stamp(i, "added"))},
            used_ids=set(ids),
            level_of={i: state.level_of(i) for i in placed},
            level_names=state.level_names(),
            removals={
                i: Removal(found.event, found.door.is_placed, found.door.level)
                for i in ids
                if (found := state.removed_door(i))
            },
        )

    @classmethod
    def of_map(cls, door_map: DoorMap, used_ids: Iterable[int]) -> Roster:
        """Return the roster of doors as values, where nothing is known of when they came."""
        doors = door_map.doors.values()
        return cls(
            placed={door.door_id: door.is_placed for door in doors},
            added_ns={door.door_id: 0 for door in doors},
            removed_ns={i: 0 for i in used_ids if i not in door_map.doors},
            added_event={},
            used_ids=set(used_ids),
            level_of={door.door_id: door.level for door in doors},
            level_names={number: level.name for number, level in door_map.levels.items()},
            removals={},
        )

    def copy(self) -> Roster:
        """Return one that can be changed without changing this."""
        return Roster(
            dict(self.placed),
            dict(self.added_ns),
            dict(self.removed_ns),
            dict(self.added_event),
            set(self.used_ids),
            dict(self.level_of),
            dict(self.level_names),
            dict(self.removals),
            self.log,
            self.names,
        )

    @property
    def levels(self) -> dict[int, str | None]:
        """The levels that there are, as `levels.levels_of` says, with their names."""
        if self._levels is None:
            numbers = {self.level_of[door] for door, is_placed in self.placed.items() if is_placed}
            numbers |= self.level_names.keys()
            self._levels = {n: self.level_names.get(n) for n in sorted(numbers)}
        return self._levels

    def level_meant(self, level: int | str | None) -> int:
        """Return the level that somebody means: see `levels`.

        Args:
            level: Its name or number; None, or `LEVEL_NOT_GIVEN`: not told. Whether there is one
                of a number, the `Gatekeeper` says.

        Raises:
            UnknownLevelError: There is none of that name, or there are several and none is told.
        """
        if isinstance(level, str):
            return level_called(level, self.levels)
        if level is None or not is_given(level):
            return only_level(self.levels)
        return int(level) if isinstance(level, np.integer) else level

    @property
    def next_free_id(self) -> DoorId:
        """The id after the greatest that was ever given: see `next_door_id`."""
        return next_door_id(self.used_ids, max(self.used_ids, default=0))

    def told(self, door_id: int) -> str:
        """Return a door in words, with its name."""
        return told_door(door_id, self.names().get(DoorId(door_id)))

    def way_back(self, door_id: int) -> str:
        """Return how a door that was removed comes back under its id, in words."""
        removal = self.removals.get(door_id)
        if removal is None:
            return ""
        line = command_line("retract", self.log, str(removal.event))
        return f" To bring it back, take the removal back: {line}"

    def absent(self, door_id: int) -> CommandError:
        """Return the error that a door is not in the map, and why."""
        if door_id in self.removed_ns:
            return DoorRemovedError(f"{self.told(door_id)} was removed.{self.way_back(door_id)}")
        return UnknownDoorError(told_absent(door_id))

    def brought_back(self, event: Retracted) -> int | None:
        """Return the door whose removal is the first that is taken back; None: there is none.

        Its adding came before and stands. Where a range begins earlier that is not known: the door
        counts as removed until the commit is whole.
        """
        found = (i for i, removal in self.removals.items() if removal.event == event.first_event)
        return next(found, None)

    def bring_back(self, door_id: int) -> None:
        """Take in that a door's removal is taken back: the door is as it was before."""
        self._levels = None
        removal = self.removals.pop(door_id)
        self.placed[door_id], self.level_of[door_id] = removal.was_placed, removal.level
        self.removed_ns.pop(door_id)

    def added_by(self, first: int, last: int) -> list[int]:
        """Return the doors whose adding is one of these events."""
        return [i for i, number in self.added_event.items() if first <= number <= last]

    def take_back(self, first: int, last: int) -> dict[int, int]:
        """Take doors out whose adding is retracted; return when each had been added."""
        self._levels = None
        gone = self.added_by(first, last)
        for door_id in gone:
            self.placed.pop(door_id, None)
            self.level_of.pop(door_id, None)
            del self.added_event[door_id]
        return {door_id: self.added_ns.pop(door_id) for door_id in gone}

    def apply(self, event: Event, number: int) -> None:
        """Take in what an event changes; one without a time counts from the end of time."""
        self._levels = None
        happened_ns = MAX_TIME_NS if event.happened_ns is None else event.happened_ns
        if isinstance(event, DoorAdded):
            self.placed[event.door_id] = not math.isnan(event.x)
            self.level_of[event.door_id] = event.level
            self.added_ns[event.door_id] = happened_ns
            self.added_event[event.door_id] = number
            self.used_ids.add(event.door_id)
        elif isinstance(event, DoorRemoved):
            was_placed = self.placed.pop(event.door_id, False)
            level = self.level_of.pop(event.door_id, 0)
            self.removed_ns[event.door_id] = happened_ns
            self.removals[event.door_id] = Removal(number, was_placed, level)
        elif isinstance(event, Retracted) and (door_id := self.brought_back(event)) is not None:
            self.bring_back(door_id)
        elif isinstance(event, DoorUpdated) and event.door_id in self.placed:
            self.placed[event.door_id] = True
            if event.changed & Changed.POSE:
                self.level_of[event.door_id] = event.level
        elif isinstance(event, LevelAdded):
            self.level_names[event.level] = event.name
        elif isinstance(event, FloorMap):
            self.level_names.setdefault(event.level, None)


class Gatekeeper:
    """Checks the events of one commit, each against the map and the events before it."""

    def __init__(
        self,
        roster: Roster,
        next_event: int,
        now_ns: Callable[[], int] | None = None,
        *,
        are_facts: bool = False,
    ) -> None:
        """Take up a commit.

        Args:
            roster: The doors and levels before it.
            next_event: The number of its first event.
            now_ns: The log's clock, by which events without a time happen; None: not known.
            are_facts: Another log took the events; what is said there of a door after its removal
                stays in its history.
        """
        self._are_facts = are_facts
        self._now_ns = now_ns
        self._began_ns: int | None = None
        """What the clock said when it was first asked."""
        self.roster = roster
        """The roster after the events that passed; the one that was given stays as it was."""
        self.is_roster_sure = True
        """A roster cannot follow a retraction, nor what may have happened before something that
        it knows: then it must be made anew."""
        self.has_retraction = False
        self.keeps_names = True
        """Which name means which door is as it was before."""
        self._is_own = False
        self._next_event = next_event
        self._timeless: list[DoorAdded | DoorRemoved] = []
        self._taken_back: dict[int, int] = {}
        """Doors whose adding this commit retracts -> when they had been added."""
        self.early: EarlyEvents | None = None
        """What passed and had happened before its door was added; None: nothing."""

    def check_all(self, events: Sequence[Event | EventBatch]) -> Sequence[Event | EventBatch]:
        """Let these events pass, one after the other; return them, all with their levels.

        Raises:
            CommandError: The map forbids one.
        """
        placed = self.roster.placed
        for event in events:
            if type(event) in _SIGHTINGS and event.door_id in placed:  # type: ignore[union-attr]
                continue
            break
        else:  # nearly every commit of a patrol: nothing else can be wrong
            self._next_event += len(events)
            for event in events:
                if event.happened_ns is not None:
                    self._note_early(event)  # type: ignore[arg-type]
            return events
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
        for part in batch.parts(ROWS_AT_A_TIME) if _lacks_levels(batch) else [batch]:
            if _lacks_levels(part) and all(kind in _HARMLESS for kind in _kinds_of(part)):
                self._check_rows(part)
                yield self._with_levels(part)
            elif _lacks_levels(part):
                yield EventBatch.from_events([self.check(event) for event in part.to_events()])
            else:
                self._check_rows(part)
                yield part

    def _check_rows(self, batch: EventBatch) -> None:
        for part in batch.parts(ROWS_AT_A_TIME):
            first = self._next_event
            asked = self._to_be_asked(part)
            if asked is not None:
                rows = np.flatnonzero(asked).tolist()
                for row, recorded in zip(rows, part.select(asked), strict=True):
                    self._next_event = first + row
                    self._let_pass(recorded.event)
            self._note_early_rows(part)
            self.keeps_names &= DoorUpdated not in part
            self._next_event = first + len(part)

    def _to_be_asked(self, batch: EventBatch) -> NDArray[np.bool_] | None:
        """Return which events `check` must see; the others it would let pass whatever they say.

        None stands for none. Those are the kinds that change the roster, and what is about doors
        that are not in the map or that the batch takes out of it.
        """
        kinds = _kinds_of(batch)
        about = [batch[kind] for kind in kinds if issubclass(kind, DoorEvent) and kind in _ROWS]
        doors = set().union(*(_distinct(rows["door_id"]) for rows in about))
        is_known = doors <= self.roster.placed.keys()
        if is_known and all(kind in _HARMLESS for kind in kinds):
            return None
        ids = batch.door_ids()
        harmless = np.isin(batch.kind, [kind.kind for kind in _HARMLESS])
        if DoorUpdated in batch:
            placing = batch[DoorUpdated]["changed"] & int(PLACING) != 0
            harmless[batch.where(DoorUpdated)] = ~placing
        if not is_known:
            harmless &= ~np.isin(ids, list(doors - self.roster.placed.keys()))
        if DoorRemoved in batch:
            harmless &= ~np.isin(ids, batch[DoorRemoved]["door_id"])
        if Retracted in batch:
            for first, last in batch[Retracted][["first_event", "last_event"]].tolist():
                harmless &= ~np.isin(ids, self.roster.added_by(first, last))
        return ~harmless

    def check(self, event: Event) -> Event:
        """Let the event pass, and return it with its level.

        Raises:
            InvalidEventError: It is of a kind that a later version has added.
            CommandError: The map forbids it; the message says what is there instead.
        """
        event = self._let_pass(event)
        self._note_early(event)
        return event

    def _let_pass(self, event: Event) -> Event:
        if isinstance(event, _SIGHTINGS) and event.door_id in self.roster.placed:
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
            self.is_roster_sure, self.has_retraction = False, True
            self._own_roster()
            self._taken_back |= self.roster.take_back(event.first_event, event.last_event)
        elif isinstance(event, UnknownEvent):
            expected = "an event of a kind that this version knows"
            raise InvalidEventError("event", expected, type(event).__name__)
        self.keeps_names &= not isinstance(event, NAMING)
        if self._changes_roster(event):
            self._own_roster()
            self.roster.apply(event, self._next_event)
            if isinstance(event, DoorAdded) and event.happened_ns is not None and self._now_ns:
                # One that is said to come later counts from when it is recorded.
                self.roster.added_ns[event.door_id] = min(event.happened_ns, self._now_ns())
            if event.happened_ns is None and isinstance(event, (DoorAdded, DoorRemoved)):
                self._timeless.append(event)
            if event.happened_ns is not None and isinstance(event, (DoorUpdated, LevelAdded)):
                self.is_roster_sure = False
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
            return replace(event, level=self.roster.level_meant(event.level))
        if Changed.POSE not in event.changed:
            return event  # its level means nothing
        return replace(event, level=self.roster.level_of.get(event.door_id, 0))

    def settle(self, commit: Commit) -> None:
        """Give the doors that came and went without a time the one of their commit."""
        for event in self._timeless:
            if isinstance(event, DoorAdded):
                self.roster.added_ns[event.door_id] = commit.wall_clock_ns
            else:
                self.roster.removed_ns[event.door_id] = commit.wall_clock_ns

    def _with_levels(self, batch: EventBatch) -> EventBatch:
        """Return poses, and what else makes no level, with the one that the poses did not tell."""
        poses = batch[RobotPose].copy()
        poses["level"][poses["level"] == NO_LEVEL] = only_level(self.roster.levels)
        return replace(batch, columns={**batch.columns, RobotPose.kind: poses})

    def _own_roster(self) -> None:
        if not self._is_own:
            self.roster, self._is_own = self.roster.copy(), True

    def _note_early(self, event: Event) -> None:
        """Count an event that passed if it had happened before its door was added."""
        if not isinstance(event, MAY_BE_EARLY) or event.happened_ns is None:
            return
        added_ns = self.roster.added_ns.get(event.door_id, 0)
        if event.happened_ns < added_ns and event.happened_ns < self._since_ns(added_ns):
            self.early = self.early or EarlyEvents.none()
            self.early.add(event.door_id, event.happened_ns)

    def _note_early_rows(self, batch: EventBatch) -> None:
        latest_ns = max(self.roster.added_ns.values(), default=0)
        times = batch.happened_ns
        if not ((times >= 0) & (times < latest_ns)).any():
            return
        added_ns = self.roster.added_ns
        early = Addings.of({i: (ns, -1) for i, ns in added_ns.items()}).early(batch, times)
        timeless = [i for i, ns in added_ns.items() if ns == MAX_TIME_NS]
        unsure = early & np.isin(batch.door_ids(), timeless)
        if unsure.any():
            early &= ~unsure | (times < self._since_ns(MAX_TIME_NS))
        if early.any():
            self.early = self.early or EarlyEvents.none()
            self.early.add_rows(batch.door_ids()[early], times[early])

    def _since_ns(self, added_ns: int) -> int:
        """Return when a door was added; one that is added without a time: now."""
        if added_ns < MAX_TIME_NS:
            return added_ns
        if self._began_ns is None:
            self._began_ns = 0 if self._now_ns is None else self._now_ns()
        return self._began_ns

    def _changes_roster(self, event: Event) -> bool:
        if isinstance(event, DoorUpdated):
            known = self.roster.level_of.get(event.door_id, event.level)
            goes = Changed.POSE in event.changed and event.level != known
            places = bool(self._moves(event)) and not self.roster.placed.get(event.door_id, True)
            return goes or places
        if isinstance(event, Retracted):
            return self.roster.brought_back(event) is not None
        return isinstance(event, (DoorAdded, DoorRemoved, LevelAdded, FloorMap))

    def _check_new(self, event: DoorAdded) -> None:
        door_id = event.door_id
        if door_id in self.roster.placed:
            raise DoorExistsError(f"door {door_id} is in the map already; choose another id.")
        if door_id in self._taken_back:
            self._check_correction(event, self._taken_back[door_id])
        elif door_id in self.roster.used_ids:
            raise DoorRemovedError(
                f"{self.roster.told(door_id)} was removed, and an id is never used twice; "
                f"the next free id is {self.roster.next_free_id}.{self.roster.way_back(door_id)}"
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
        if door_id in self.roster.placed:
            return
        removed_ns = self.roster.removed_ns.get(door_id)
        if removed_ns is None:
            raise UnknownDoorError(told_absent(door_id))
        is_late = event.happened_ns is None or event.happened_ns > removed_ns
        if is_late and not self._are_facts:
            raise DoorRemovedError(
                f"{self.roster.told(door_id)} was removed; only what happened before that can be "
                f"added to it.{self.roster.way_back(door_id)}"
            )

    def _check_update(self, event: DoorUpdated) -> None:
        moves = self._moves(event)
        if moves & Changed.POSE:
            self._check_level(event.level)
        if moves and moves != PLACING and not self.roster.placed.get(event.door_id, True):
            raise CommandError(
                f"door {event.door_id} has no place yet; to place it, give pose and width together."
            )

    @staticmethod
    def _moves(event: DoorUpdated) -> Changed:
        return event.changed & PLACING

    def _check_removal(self, event: DoorRemoved) -> None:
        if event.door_id not in self.roster.placed:
            told, way_back = self.roster.told(event.door_id), self.roster.way_back(event.door_id)
            raise DoorRemovedError(f"{told} was removed already.{way_back}")
        added_ns = self.roster.added_ns.get(event.door_id, 0)
        if event.happened_ns is not None and event.happened_ns < added_ns:
            raise CommandError(f"door {event.door_id} cannot be removed before it was added.")
        if event.happened_ns is None and self._now_ns and self._now_ns() < added_ns < MAX_TIME_NS:
            raise CommandError(
                f"door {event.door_id} cannot be removed before it was added: the clock has gone "
                "back since then; set it right, or say when it was removed."
            )

    def _check_retraction(self, event: Retracted) -> None:
        if event.last_event >= self._next_event:
            raise CommandError(
                f"cannot retract events {event.first_event}..{event.last_event}: "
                f"the last event is {self._next_event - 1}."
            )

    def _check_level(self, level: int) -> None:
        if level != 0 and level not in self.roster.level_names:
            raise UnknownLevelError(
                f"no level {level}; there are: {told(self.roster.levels) or '0'}."
            )


_ROWS: tuple[type[DoorEvent], ...] = tuple(
    kind for kind in KINDS if issubclass(kind, DoorEvent) and kind.kind not in OBJECT_KINDS
)
"""Kinds about a door that a batch holds as columns."""

_SIGHTINGS = tuple(
    kind
    for kind in _ROWS
    if kind.effect.presence is Presence.STAYS and not kind.effect.can_set & ~Changed.STATE
)
"""Kinds that can be said of every door in the map, and change neither doors nor names."""

_HARMLESS: tuple[type[Event], ...] = (*_SIGHTINGS, PatrolStarted, PatrolFinished, RobotPose)
"""Those, and the kinds that are about no door: nothing of a batch of them can be wrong."""

ON_A_LEVEL = (DoorAdded, DoorUpdated, RobotPose, FloorMap)
"""Kinds that may leave it to the log which level they mean."""

ROWS_AT_A_TIME = 8192
FEW_ROWS = 256

NAMING = (DoorAdded, DoorUpdated, DoorRemoved, DoorAnnotated, LevelAdded, Retracted)
"""Kinds that may change which name means which door (an update: by its level)."""


def _kinds_of(batch: EventBatch) -> list[type[Event]]:
    return [KINDS[kind - 1] for kind in (*batch.columns, *batch.objects)]


def _lacks_levels(batch: EventBatch) -> bool:
    """Tell whether some of the events leave it to the log which level they mean."""
    columns = (batch.columns[kind.kind] for kind in ON_A_LEVEL if kind.kind in batch.columns)
    if any((rows["level"] == NO_LEVEL).any() for rows in columns):
        return True
    maps = batch.objects.get(FloorMap.kind, ())
    return any(isinstance(event, FloorMap) and not is_given(event.level) for event in maps)


def _distinct(ids: NDArray[np.uint32]) -> set[int]:
    """Return the ids that occur."""
    return set(ids.tolist() if len(ids) <= FEW_ROWS else np.unique(ids).tolist())


MOST_ID_DIGITS = len(str(MAX_DOOR_ID))


def is_door_id(text: str) -> bool:
    """Tell whether a text can be a door's id."""
    return text.isdecimal() and len(text) <= MOST_ID_DIGITS


def resolve_door(text: str | int, door_map: DoorMap) -> DoorId:
    """Return the door that a person means by an id, `id:7`, a name, or level/name.

    A text of digits can be a name, too; `id:7` is the id, whatever doors are called.

    Raises:
        UnknownDoorError: None, or more than one.
        InvalidEventError: It is neither a text nor a whole number.
    """
    if not (isinstance(text, str) or is_whole_number(text)):
        raise InvalidEventError("door", "an id, a name, or level/name", text)
    if isinstance(text, str) and text.startswith(ID_PREFIX):
        return _door_of_id(text, door_map)
    doors = [door for door in door_map.doors.values() if text in (door.door_id, door.name)]
    if not doors and isinstance(text, str) and "/" in text:
        doors = [
            door
            for door in door_map.doors.values()
            if door.name and f"{door_map.level_name(door.level)}/{door.name}" == text
        ]
    if isinstance(text, str) and is_door_id(text):
        numbered = door_map.doors.get(DoorId(int(text)))
        doors += [numbered] if numbered and numbered not in doors else []
    if len(doors) == 1:
        return doors[0].door_id
    if doors:
        which = ", ".join(
            f"{door_map.level_name(door.level)}/{door.label} (id {door.door_id})" for door in doors
        )
        ids = which_id([door.door_id for door in doors])
        raise UnknownDoorError(
            f"{text!r} can mean {len(doors)} doors: {which}; say which by {ids}."
        )
    if str(text).isdecimal():
        raise UnknownDoorError(told_absent(int(text)))
    raise UnknownDoorError(f"no door is called {text!r}.{_similar(str(text), door_map)}")


def _door_of_id(text: str, door_map: DoorMap) -> DoorId:
    digits = text.removeprefix(ID_PREFIX)
    if not is_door_id(digits):
        raise UnknownDoorError(f"{text!r}: expected a door's id, such as {ID_PREFIX}7.")
    if int(digits) not in door_map.doors:
        raise UnknownDoorError(told_absent(int(digits)))
    return DoorId(int(digits))


def _similar(text: str, door_map: DoorMap) -> str:
    from difflib import get_close_matches

    names = sorted({door.name for door in door_map.doors.values() if door.name})
    close = get_close_matches(text, names, n=3)
    return f" Did you mean {' or '.join(close)}?" if close else ""
