"""Intent against state: may this event be appended to the map as it stands?

Checking an intent is apart from applying a fact: what is in the log is never judged again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.commits import Commit
from semmap_log.doors import MAX_DOOR_ID, DoorId, DoorMap
from semmap_log.errors import (
    CommandError,
    DoorExistsError,
    DoorRemovedError,
    InvalidEventError,
    UnknownDoorError,
    UnknownLevelError,
)
from semmap_log.event_batch import EventBatch
from semmap_log.events import (
    KINDS,
    MAX_TIME_NS,
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
    is_whole_number,
)
from semmap_log.projections.door_map import DoorMapState
from semmap_log.projections.early_events import MAY_BE_EARLY, Addings, EarlyEvents


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
    levels: set[int]

    @classmethod
    def of(cls, state: DoorMapState) -> Roster:
        """Return the roster of a door map."""
        ids = state.used_door_ids
        return cls(
            placed={i: state.is_placed(i) for i in ids if state.is_present(i)},
            added_ns={i: stamp[0] for i in ids if (stamp := state.stamp(i, "added"))},
            removed_ns={i: stamp[0] for i in ids if (stamp := state.stamp(i, "removed"))},
            added_event={i: stamp[1] for i in ids if (stamp := state.stamp(i, "added"))},
            used_ids=set(ids),
            levels=state.known_levels() | {0},
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
            levels=set(door_map.levels) | {0},
        )

    def copy(self) -> Roster:
        """Return one that can be changed without changing this."""
        return Roster(
            dict(self.placed),
            dict(self.added_ns),
            dict(self.removed_ns),
            dict(self.added_event),
            set(self.used_ids),
            set(self.levels),
        )

    @property
    def next_free_id(self) -> DoorId:
        """The id after the greatest that was ever given.

        Raises:
            CommandError: There is none any more.
        """
        following = max(self.used_ids, default=0) + 1
        if following > MAX_DOOR_ID:
            raise CommandError(f"no id is free behind door {MAX_DOOR_ID}; give one yourself.")
        return DoorId(following)

    def take_back(self, first: int, last: int) -> dict[int, int]:
        """Take doors out whose adding is retracted; return when each had been added."""
        gone = [i for i, number in self.added_event.items() if first <= number <= last]
        for door_id in gone:
            self.placed.pop(door_id, None)
            del self.added_event[door_id]
        return {door_id: self.added_ns.pop(door_id) for door_id in gone}

    def apply(self, event: Event) -> None:
        """Take in what an event changes; one without a time counts from the end of time."""
        happened_ns = MAX_TIME_NS if event.happened_ns is None else event.happened_ns
        if isinstance(event, DoorAdded):
            self.placed[event.door_id] = not math.isnan(event.x)
            self.added_ns[event.door_id] = happened_ns
            self.used_ids.add(event.door_id)
        elif isinstance(event, DoorRemoved):
            self.placed.pop(event.door_id, None)
            self.removed_ns[event.door_id] = happened_ns
        elif isinstance(event, DoorUpdated) and event.door_id in self.placed:
            self.placed[event.door_id] = True
        elif isinstance(event, (LevelAdded, FloorMap)):
            self.levels.add(event.level)


class Gatekeeper:
    """Checks the events of one commit, each against the map and the events before it."""

    def __init__(
        self, roster: Roster, next_event: int, now_ns: Callable[[], int] | None = None
    ) -> None:
        """Take up a commit.

        Args:
            roster: The doors and levels before it.
            next_event: The number of its first event.
            now_ns: The log's clock, by which events without a time happen; None: not known.
        """
        self._now_ns = now_ns
        self._began_ns: int | None = None
        """What the clock said when it was first asked."""
        self.roster = roster
        """The roster after the events that passed; the one that was given stays as it was."""
        self.has_retraction = False
        """A roster cannot follow a retraction: it must be made anew."""
        self.keeps_names = True
        """Which name means which door is as it was before."""
        self._is_own = False
        self._next_event = next_event
        self._timeless: list[DoorAdded | DoorRemoved] = []
        self._taken_back: dict[int, int] = {}
        """Doors whose adding this commit retracts -> when they had been added."""
        self.early: EarlyEvents | None = None
        """What passed and had happened before its door was added; None: nothing."""

    def check_all(self, events: Sequence[Event | EventBatch]) -> None:
        """Let these events pass, one after the other.

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
            return
        for event in events:
            if isinstance(event, EventBatch):
                self.check_batch(event)
            else:
                self.check(event)

    def check_batch(self, batch: EventBatch) -> None:
        """Let many events pass, all at once but for those that `check` has more to ask about.

        Raises:
            InvalidEventError: A value that no event can have.
            CommandError: As `check`.
        """
        batch.check()
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
        kinds = [KINDS[kind - 1] for kind in (*batch.columns, *batch.objects)]
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
        return ~harmless

    def check(self, event: Event) -> None:
        """Let the event pass.

        Raises:
            CommandError: The map forbids it; the message says what is there instead.
        """
        self._let_pass(event)
        self._note_early(event)

    def _let_pass(self, event: Event) -> None:
        if isinstance(event, _SIGHTINGS) and event.door_id in self.roster.placed:
            self._next_event += 1  # nearly every event of a patrol: nothing else can be wrong
            return
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
            self.has_retraction = True
            self._own_roster()
            self._taken_back |= self.roster.take_back(event.first_event, event.last_event)
        self.keeps_names &= not isinstance(event, NAMING)
        if self._changes_roster(event):
            self._own_roster()
            self.roster.apply(event)
            if isinstance(event, DoorAdded):
                self.roster.added_event[event.door_id] = self._next_event
            if isinstance(event, DoorAdded) and event.happened_ns is not None and self._now_ns:
                # One that is said to come later counts from when it is recorded.
                self.roster.added_ns[event.door_id] = min(event.happened_ns, self._now_ns())
            if event.happened_ns is None and isinstance(event, (DoorAdded, DoorRemoved)):
                self._timeless.append(event)
        self._next_event += 1

    def settle(self, commit: Commit) -> None:
        """Give the doors that came and went without a time the one of their commit."""
        for event in self._timeless:
            if isinstance(event, DoorAdded):
                self.roster.added_ns[event.door_id] = commit.wall_clock_ns
            else:
                self.roster.removed_ns[event.door_id] = commit.wall_clock_ns

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
        stamps = {i: (self._since_ns(ns), -1) for i, ns in self.roster.added_ns.items()}
        early = Addings.of(stamps).early(batch, batch.happened_ns)
        if early.any():
            self.early = self.early or EarlyEvents.none()
            self.early.add_rows(batch.door_ids()[early], batch.happened_ns[early])

    def _since_ns(self, added_ns: int) -> int:
        """Return when a door was added; one that is added without a time: now."""
        if added_ns < MAX_TIME_NS:
            return added_ns
        if self._began_ns is None:
            self._began_ns = 0 if self._now_ns is None else self._now_ns()
        return self._began_ns

    def _changes_roster(self, event: Event) -> bool:
        if isinstance(event, DoorUpdated):
            return bool(self._moves(event)) and not self.roster.placed.get(event.door_id, True)
        return isinstance(event, (DoorAdded, DoorRemoved, LevelAdded, FloorMap))

    def _check_new(self, event: DoorAdded) -> None:
        door_id = event.door_id
        if door_id in self.roster.placed:
            raise DoorExistsError(f"door {door_id} is in the map already; choose another id.")
        if door_id in self._taken_back:
            self._check_correction(event, self._taken_back[door_id])
        elif door_id in self.roster.used_ids:
            raise DoorRemovedError(
                f"door {door_id} was removed, and an id is never used twice; "
                f"the next free id is {self.roster.next_free_id}."
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
            raise UnknownDoorError(f"door {door_id} is not in the map.")
        if event.happened_ns is None or event.happened_ns > removed_ns:
            raise DoorRemovedError(
                f"door {door_id} was removed; only what happened before that can be added to it."
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
            raise DoorRemovedError(f"door {event.door_id} was removed already.")
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
        if level not in self.roster.levels:
            known = ", ".join(str(number) for number in sorted(self.roster.levels))
            raise UnknownLevelError(f"no level {level}; there are: {known}.")


_SIGHTINGS = (DoorObserved, DoorPassed, DoorRequested)
"""Kinds that can be said of every door in the map, and change neither doors nor names."""

_HARMLESS = (*_SIGHTINGS, PatrolStarted, PatrolFinished, RobotPose)
"""Those, and the kinds that are about no door: nothing of a batch of them can be wrong."""

_ROWS = (DoorAdded, DoorUpdated, DoorRemoved, *_SIGHTINGS)
"""Kinds about a door that a batch holds as columns."""

ROWS_AT_A_TIME = 8192
FEW_ROWS = 256

NAMING = (DoorAdded, DoorUpdated, DoorRemoved, DoorAnnotated, LevelAdded, Retracted)
"""Kinds that may change which name means which door (an update: by its level)."""

PLACING = Changed.POSE | Changed.WIDTH
"""What an update must set together to give a door its first place."""


def _distinct(ids: NDArray[np.uint32]) -> set[int]:
    """Return the ids that occur."""
    return set(ids.tolist() if len(ids) <= FEW_ROWS else np.unique(ids).tolist())


MOST_ID_DIGITS = len(str(MAX_DOOR_ID))


def resolve_door(text: str | int, door_map: DoorMap) -> DoorId:
    """Return the door that a person means by an id, a name, or level/name.

    Raises:
        UnknownDoorError: None, or more than one.
        InvalidEventError: It is neither a text nor a whole number.
    """
    if not (isinstance(text, str) or is_whole_number(text)):
        raise InvalidEventError("door", "an id, a name, or level/name", text)
    doors = [door for door in door_map.doors.values() if text in (door.door_id, door.name)]
    if not doors and isinstance(text, str) and "/" in text:
        doors = [
            door
            for door in door_map.doors.values()
            if door.name and f"{door_map.level_name(door.level)}/{door.name}" == text
        ]
    if isinstance(text, str) and text.isdecimal() and len(text) <= MOST_ID_DIGITS:
        numbered = door_map.doors.get(DoorId(int(text)))
        doors += [numbered] if numbered and numbered not in doors else []
    if len(doors) == 1:
        return doors[0].door_id
    if doors:
        which = ", ".join(
            f"{door_map.level_name(door.level)}/{door.label} (id {door.door_id})" for door in doors
        )
        raise UnknownDoorError(f"{text!r} can mean {len(doors)} doors: {which}; use the id.")
    if str(text).isdecimal():
        raise UnknownDoorError(f"door {text} is not in the map.")
    raise UnknownDoorError(f"no door is called {text!r}.{_similar(str(text), door_map)}")


def resolve_level(text: str | int | None, door_map: DoorMap) -> int:
    """Return the level that a person means by a number or a name.

    Args:
        text: None means the only level there is, or level 0 where there is none.
        door_map: The map as it is.

    Raises:
        UnknownLevelError: No such level, or several and none was named.
    """
    levels = door_map.levels
    known = ", ".join(
        f"{n} ({level.name})" if level.name else str(n) for n, level in levels.items()
    )
    if text is None:
        if len(levels) > 1:
            raise UnknownLevelError(f"there are several levels; say which: {known}.")
        return next(iter(levels), 0)
    for number, level in levels.items():
        if text in (number, level.name, str(number)):
            return number
    if text in (0, "0"):
        return 0
    raise UnknownLevelError(f"no level {text!r}; there are: {known or '0'}.")


def _similar(text: str, door_map: DoorMap) -> str:
    from difflib import get_close_matches

    names = sorted({door.name for door in door_map.doors.values() if door.name})
    close = get_close_matches(text, names, n=3)
    return f" Did you mean {' or '.join(close)}?" if close else ""
