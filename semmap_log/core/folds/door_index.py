"""Which doors and levels a log has, as far as commands must know it.

Finds the door that a person means by a name, removed doors included, and the events of a batch that
can be wrong, and so must be checked one by one. Also what doors are called in a message, so that
nobody needs to guess which one is meant.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import cast

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, distinct
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.levels import level_called, level_numbers, only_level
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.messages import OBJECT_KINDS
from semmap_log.core.model import doors as door_model
from semmap_log.core.model.events import (
    KINDS,
    NO_LEVEL,
    ClassDefined,
    DoorAdded,
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
    is_whole_number,
)
from semmap_log.core.model.meaning import PLACING, Changed, Presence
from semmap_log.core.texts import command_line
from semmap_log.errors import CommandError, DoorRemovedError, InvalidEventError, UnknownDoorError

MOST_ID_DIGITS = len(str(door_model.MAX_DOOR_ID))


def _is_door_id(text: str) -> bool:
    """Return whether a text can be a door's id."""
    return text.isdecimal() and len(text) <= MOST_ID_DIGITS


def resolve_door(text: str | int, door_map: door_model.DoorMap) -> door_model.DoorId:
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
    if isinstance(text, str) and _is_door_id(text):
        numbered = door_map.doors.get(door_model.DoorId(int(text)))
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
    if not isinstance(text, str) or _is_door_id(text):
        raise UnknownDoorError(absence_message(int(text)))
    raise UnknownDoorError(f"no door is called {text!r}.{_similar(str(text), door_map)}")


def _door_of_id(text: str, door_map: door_model.DoorMap) -> door_model.DoorId:
    digits = text.removeprefix(ID_PREFIX)
    if not _is_door_id(digits):
        raise UnknownDoorError(f"{text!r}: expected a door's id, such as {ID_PREFIX}7.")
    if int(digits) not in door_map.doors:
        raise UnknownDoorError(absence_message(int(digits)))
    return door_model.DoorId(int(digits))


def _similar(text: str, door_map: door_model.DoorMap) -> str:
    from difflib import get_close_matches

    names = sorted({door.name for door in door_map.doors.values() if door.name})
    close = get_close_matches(text, names, n=3)
    return f" Did you mean {' or '.join(close)}?" if close else ""


_ROWS: tuple[type[DoorEvent], ...] = tuple(
    kind for kind in KINDS if issubclass(kind, DoorEvent) and kind.kind not in OBJECT_KINDS
)
"""Kinds about a door that a batch holds as columns."""

SIGHTINGS = tuple(
    kind
    for kind in _ROWS
    if kind.effect.presence is Presence.STAYS and not kind.effect.can_set & ~Changed.STATE
)
"""Kinds that can be about every door in the map, and change neither doors nor names."""

HARMLESS: tuple[type[Event], ...] = (*SIGHTINGS, PatrolStarted, PatrolFinished, RobotPose)
"""Those, and the kinds that are about no door: nothing of a batch of them can be wrong."""

ON_A_LEVEL = (DoorAdded, DoorUpdated, RobotPose, FloorMap)
"""Kinds that may leave it to the log which level they mean."""

FEW_ROWS = 256


def rows_to_check(batch: EventBatch, index: DoorIndex) -> NDArray[np.bool_] | None:
    """Return which events `Validator.check` must see; the others it lets pass whatever they say.

    None stands for none. Those are the kinds that change the index, and what is about doors that
    are not in the map or that the batch takes out of it.

    Args:
        batch: Events that state their levels.
        index: The doors and levels before it.
    """
    kinds = kinds_of(batch)
    about = [batch[kind] for kind in kinds if issubclass(kind, DoorEvent) and kind in _ROWS]
    doors = set().union(*(_distinct(rows["door_id"]) for rows in about))
    is_known = doors <= index.placed.keys()
    if is_known and all(kind in HARMLESS for kind in kinds):
        return None
    ids = batch.door_ids()
    harmless = np.isin(batch.kind, [kind.kind for kind in HARMLESS])
    if DoorUpdated in batch:
        placing = batch[DoorUpdated]["changed"] & int(PLACING) != 0
        harmless[batch.where(DoorUpdated)] = ~placing
    if not is_known:
        harmless &= ~np.isin(ids, list(doors - index.placed.keys()))
    if DoorRemoved in batch:
        harmless &= ~np.isin(ids, batch[DoorRemoved]["door_id"])
    if Retracted in batch:
        for first, last in batch[Retracted][["first_event", "last_event"]].tolist():
            harmless &= ~np.isin(ids, index.added_by(first, last))
    return ~harmless


def with_levels(batch: EventBatch, level: int) -> EventBatch:
    """Return poses, and what else makes no level, with this level where they state none."""
    poses = batch[RobotPose].copy()
    poses["level"][poses["level"] == NO_LEVEL] = level
    return replace(batch, columns={**batch.columns, RobotPose.kind: poses})


def kinds_of(batch: EventBatch) -> list[type[Event]]:
    """Return the kinds of a batch."""
    return [KINDS[kind - 1] for kind in (*batch.columns, *batch.objects)]


def lacks_levels(batch: EventBatch) -> bool:
    """Return whether some of the events leave their level to the log."""
    columns = (batch.columns[kind.kind] for kind in ON_A_LEVEL if kind.kind in batch.columns)
    if any((rows["level"] == NO_LEVEL).any() for rows in columns):
        return True
    maps = batch.objects.get(FloorMap.kind, ())
    return any(
        isinstance(event, FloorMap) and not door_model.is_given(event.level) for event in maps
    )


def _distinct(ids: NDArray[np.uint32]) -> set[int]:
    """Return the ids that occur."""
    return set(ids.tolist() if len(ids) <= FEW_ROWS else distinct(ids).tolist())


@dataclass(frozen=True, slots=True)
class Removal:
    """How a door left the map."""

    event: int
    """The number of its removal."""
    was_placed: bool
    level: int


@dataclass(slots=True)
class DoorIndex:
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
    classes: dict[str, door_model.ObjectClass]
    """The classes of objects that are defined."""
    log: PurePath = field(default=PurePath("LOG"), repr=False, compare=False)
    """Where the log is, for messages."""
    names: Callable[[], Mapping[door_model.DoorId, str]] = field(
        default=dict, repr=False, compare=False
    )
    """What doors are called, removed ones too: for messages."""
    _levels: dict[int, str | None] | None = field(default=None, repr=False, compare=False)
    _on_level: Counter[int] | None = field(default=None, repr=False, compare=False)
    """How many doors with a place are on each level; None: not counted yet."""
    _latest_added_ns: int | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, state: DoorMapState) -> DoorIndex:
        """Return the index of a door map."""
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
            classes=state.classes(),
        )

    @classmethod
    def of_map(cls, door_map: door_model.DoorMap, used_ids: Iterable[int]) -> DoorIndex:
        """Return the index of doors as values, where nothing is known of when they came."""
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
            classes=dict(door_map.classes),
        )

    def copy(self) -> DoorIndex:
        """Return one that can be changed without changing this."""
        return DoorIndex(
            dict(self.placed),
            dict(self.added_ns),
            dict(self.removed_ns),
            dict(self.added_event),
            set(self.used_ids),
            dict(self.level_of),
            dict(self.level_names),
            dict(self.removals),
            dict(self.classes),
            self.log,
            self.names,
        )

    @property
    def latest_added_ns(self) -> int:
        """When the last door was added; for an index that does not change any more."""
        if self._latest_added_ns is None:
            self._latest_added_ns = max(self.added_ns.values(), default=0)
        return self._latest_added_ns

    @property
    def levels(self) -> dict[int, str | None]:
        """The levels that there are: see `levels.level_numbers`; with their names."""
        if self._on_level is None:
            placed = (self.level_of[door] for door, is_placed in self.placed.items() if is_placed)
            self._on_level, self._levels = Counter(placed), None
        if self._levels is None:
            numbers = level_numbers(self.level_names, self._on_level)
            self._levels = {number: self.level_names.get(number) for number in numbers}
        return self._levels

    def level_meant(self, level: int | str | None) -> int:
        """Return the level that a name or number means: see `levels`.

        Args:
            level: Its name or number; None, or `LEVEL_NOT_GIVEN`: not given. The `Validator` checks
                whether a level of that number exists.

        Raises:
            UnknownLevelError: There is none of that name, or there are several and none is given.
        """
        if isinstance(level, str):
            return level_called(level, self.levels)
        if level is None or not door_model.is_given(level):
            return only_level(self.levels)
        return int(level) if isinstance(level, np.integer) else level

    @property
    def next_free_id(self) -> door_model.DoorId:
        """The id after the greatest that was ever given: see `next_door_id`."""
        return door_model.next_door_id(self.used_ids, max(self.used_ids, default=0))

    def told(self, door_id: int) -> str:
        """Return a door in words, with its name."""
        return described_door(door_id, self.names().get(door_model.DoorId(door_id)))

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
        return UnknownDoorError(absence_message(door_id))

    def brought_back(self, event: Retracted) -> int | None:
        """Return the door whose removal is the first that is taken back, or None.

        Its adding came before and stands. Where a range begins earlier that is not known: the door
        counts as removed until the commit is whole.
        """
        found = (i for i, removal in self.removals.items() if removal.event == event.first_event)
        return next(found, None)

    def bring_back(self, door_id: int) -> None:
        """Take in that a door's removal is taken back: the door is as it was before."""
        self._on_level = None
        removal = self.removals.pop(door_id)
        self.placed[door_id], self.level_of[door_id] = removal.was_placed, removal.level
        self.removed_ns.pop(door_id)

    def added_by(self, first: int, last: int) -> list[int]:
        """Return the doors whose adding is one of these events."""
        return [i for i, number in self.added_event.items() if first <= number <= last]

    def take_back(self, first: int, last: int) -> dict[int, int]:
        """Take doors out whose adding is retracted; return when each had been added."""
        self._on_level = None
        gone = self.added_by(first, last)
        for door_id in gone:
            self.placed.pop(door_id, None)
            self.level_of.pop(door_id, None)
            del self.added_event[door_id]
        return {door_id: self.added_ns.pop(door_id) for door_id in gone}

    def apply(self, event: Event, number: int) -> None:
        """Take in what an event changes; one without a time counts from the end of time."""
        if isinstance(event, DoorEvent):
            before = self._level_with(event.door_id)
            self._take_in(event, number)
            self._count_moved(before, self._level_with(event.door_id))
        else:
            self._take_in(event, number)
            self._levels = None

    def _level_with(self, door_id: int) -> int | None:
        """Return the level on which a door has a place; None: it has none."""
        return self.level_of[door_id] if self.placed.get(door_id) else None

    def _count_moved(self, before: int | None, after: int | None) -> None:
        """Count a door that went from a level, or from nowhere, to another."""
        if self._on_level is None or before == after:
            return
        if after is not None:
            self._on_level[after] += 1
            self._levels = self._levels if self._on_level[after] > 1 else None
        if before is not None:
            self._on_level[before] -= 1
            if not self._on_level[before]:
                del self._on_level[before]
                self._levels = None

    def _take_in(self, event: Event, number: int) -> None:
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
        elif isinstance(event, ClassDefined):
            self.classes[event.class_name] = event.object_class
        elif isinstance(event, FloorMap):
            self.level_names.setdefault(event.level, None)


ID_PREFIX = "id:"
"""`id:7` is the door of that id, whatever doors are called."""


def removed_by_name(text: str | int, state: DoorMapState) -> list[door_model.DoorId]:
    """Return the removed doors of that id, name, or level/name, ids ascending."""
    levels = state.level_names()
    found = []
    for door_id in map(door_model.DoorId, sorted(state.used_door_ids)):
        removed = state.removed_door(door_id)
        if removed is None:
            continue
        calls = {str(door_id), f"{ID_PREFIX}{door_id}"}
        if name := removed.door.name:
            level = removed.door.level
            calls |= {name, f"{levels.get(level) or level}/{name}"}
        if str(text) in calls:
            found.append(door_id)
    return found


def removal_message(doors: Sequence[door_model.DoorId], state: DoorMapState) -> str:
    """Return that doors were removed, and how to ask of the time when they were there."""
    said = []
    for door_id in doors:
        removed = state.removed_door(door_id)
        assert removed is not None, "one that `removed_by_name` gave"
        called = described_door(door_id, removed.door.name)
        before = f"event:{removed.event - 1}"
        said.append(f"{called} was removed by event {removed.event}; as it was then: --at {before}")
    return ". ".join(said) + "."


def ambiguous_removed(text: str | int, doors: Sequence[door_model.DoorId]) -> str:
    """Return that a name can mean several removed doors, and how to say which."""
    return (
        f"{text!r} is the name of {len(doors)} doors that were removed; say which by "
        f"{which_id(doors)}."
    )


def described_door(door_id: int, name: str | None) -> str:
    """Return a door in words: `door 'front' (id 7)`, or `door 7`, which has no name."""
    return f"door {name!r} (id {door_id})" if name else f"door {door_id}"


def absence_message(door_id: int) -> str:
    """Return that a door is not in the map, and of door 0 why."""
    why = "" if door_id else ": ids are given from 1 on, and 0 comes with the thesis's doors only"
    return f"door {door_id} is not in the map{why}."


def which_id(doors: Sequence[door_model.DoorId]) -> str:
    """Return how one of several doors is meant: `id:1 or id:4`."""
    return " or ".join(f"{ID_PREFIX}{door_id}" for door_id in doors)


def doors_listed(
    doors: Iterable[door_model.DoorId | str] | door_model.DoorId | str,
) -> Iterable[door_model.DoorId | str]:
    """Return doors as a list of them; one alone, too."""
    one_alone = isinstance(doors, str) or is_whole_number(doors)
    return cast("Iterable[door_model.DoorId | str]", [doors] if one_alone else doors)


def labels_of(door_map: door_model.DoorMap) -> dict[door_model.DoorId, str]:
    """Return what to call each door of a map that has a name: see `distinct_labels`."""
    doors = door_map.doors.values()
    return distinct_labels((door, door_map.level_name(door.level)) for door in doors)


def all_door_labels(state: DoorMapState) -> dict[door_model.DoorId, str]:
    """Return the same, and the names of doors that were removed."""
    return {**state.names(), **labels_of(state.door_map())}


def distinct_labels(doors: Iterable[tuple[door_model.Door, str]]) -> dict[door_model.DoorId, str]:
    """Return what to call each door that has a name, given the name of its level.

    Its name; where several bear it level/name, as commands take it; where even that is another's,
    with the id.
    """
    named = {door.door_id: (door.name, level) for door, level in doors if door.name}
    bearers = Counter(name for name, _ in named.values())
    on_level = Counter(named.values())
    labels = {}
    for door_id, (name, level) in named.items():
        if bearers[name] == 1:
            labels[door_id] = name
        elif on_level[name, level] == 1:
            labels[door_id] = f"{level}/{name}"
        else:
            labels[door_id] = f"{level}/{name} (id {door_id})"
    return labels
