"""Who changed what, when, why: events together with the notes of their commits.

Also the difference between two door maps, door by door and field by field; the robot's patrol
rounds, with their start, end, name and actor; and what each event changed in the map: the value
that a field of a door had before, and since.

Changes are seen in the order of event numbers: from what the log knew before an event was recorded
to what it knew then. A late event that a newer one outranks changes nothing.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent, Retractions
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.registers import NEVER, Writes, writes_of
from semmap_log.core.model import events as ev
from semmap_log.core.model import meaning
from semmap_log.core.model.commits import NoteTexts
from semmap_log.core.model.doors import Door, DoorId, DoorMap, DoorState, Level, ShownAsTable
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError

FIELDS = (*meaning.FIELDS, "annotations", "object_class")
"""The fields that make a door what it is: if one differs, the door was changed."""

STAMPS = ("last_seen_ns", "last_event")
"""Fields that show that a door was mentioned, even if nothing about it changed."""


@dataclass(frozen=True, slots=True)
class FieldChange:
    """One field of a door that is in both maps."""

    door: Door
    """As it is in the later map."""
    field: str
    before: Any
    after: Any


@dataclass(frozen=True, slots=True)
class LevelChange:
    """A level that came, went, or is another now; None: it is not there."""

    number: int
    before: Level | None
    after: Level | None


@dataclass(frozen=True, slots=True, repr=False)
class Diff(ShownAsTable):
    """What leads from one door map to another."""

    before: DoorMap
    after: DoorMap
    added: Sequence[Door]
    removed: Sequence[Door]
    changed: Sequence[FieldChange]
    """Of the doors in both maps, by `FIELDS`."""
    heard: Sequence[FieldChange]
    """Of the same, by `STAMPS`."""
    levels: Sequence[LevelChange]
    events: Sequence[HistoryEntry]
    """Those with happened time after the first moment, up to and including the second."""

    def __repr__(self) -> str:
        changed = len({change.door.door_id for change in self.changed})
        doors = f"{len(self.added)} added, {len(self.removed)} removed, {changed} changed"
        return f"<Diff of doors: {doors}; {counted(len(self.events), 'event')}>"

    def __bool__(self) -> bool:
        """Return whether a door differs from before; a repeated sighting does not count."""
        return bool(self.added or self.removed or self.changed)

    def applied_to(self, before: DoorMap) -> DoorMap:
        """Return the later map, made of the earlier one and what is different: equal in all fields.

        Args:
            before: The earlier map, from wherever.

        Raises:
            CommandError: It is another: a door, a level or a value is not as it was then.
        """
        doors = dict(before.doors)
        for door in self.removed:
            _check(doors.pop(door.door_id, None), door, f"door {door.door_id}")
        for door in self.added:
            _check(doors.get(door.door_id), None, f"door {door.door_id}")
            doors[door.door_id] = door
        for change in (*self.changed, *self.heard):
            door_id = change.door.door_id
            if door_id not in doors:
                _check(None, "a door", f"door {door_id}")
            _check(getattr(doors[door_id], change.field), change.before,
                   f"{change.field} of door {door_id}")  # fmt: skip
            doors[door_id] = replace(doors[door_id], **{change.field: change.after})
        levels = dict(before.levels)
        for level in self.levels:
            _check(levels.pop(level.number, None), level.before, f"level {level.number}")
            if level.after is not None:
                levels[level.number] = level.after
        return replace(
            self.after,  # the moment that it is of: its event, its times
            doors=MappingProxyType(dict(sorted(doors.items()))),
            levels=MappingProxyType(dict(sorted(levels.items()))),
        )


def diff(before: DoorMap, after: DoorMap, events: Sequence[HistoryEntry] = ()) -> Diff:
    """Return the difference; doors ascending, fields in the order of `FIELDS` and `STAMPS`."""
    numbers = sorted({*before.levels, *after.levels})
    levels = (LevelChange(n, before.levels.get(n), after.levels.get(n)) for n in numbers)
    return Diff(
        before=before,
        after=after,
        added=_doors_only_in(after.doors, before.doors),
        removed=_doors_only_in(before.doors, after.doors),
        changed=list(_changes(before, after, FIELDS)),
        heard=list(_changes(before, after, STAMPS)),
        levels=[level for level in levels if not _is_same(level.before, level.after)],
        events=events,
    )


def _doors_only_in(doors: Mapping[DoorId, Door], others: Mapping[DoorId, Door]) -> Sequence[Door]:
    return [door for door_id, door in doors.items() if door_id not in others]


def _changes(before: DoorMap, after: DoorMap, names: Sequence[str]) -> Iterator[FieldChange]:
    """Yield the fields of these names in which doors that are in both maps differ."""
    for door_id, door in after.doors.items():
        known = before.doors.get(door_id)
        for field in names if known is not None else ():
            old, new = getattr(known, field), getattr(door, field)
            if not _is_same(old, new):
                yield FieldChange(door, field, old, new)


def _check(actual: Any, expected: Any, what: str) -> None:
    """Check that the map that a diff is applied to is as the diff knows it.

    Raises:
        CommandError: It is not.
    """
    if not _is_same(actual, expected):
        raise CommandError(
            f"{what}: expected {_said(expected)} before the change, got {_said(actual)}; "
            "this is not the map that the diff is from."
        )


def _said(value: Any) -> str:
    if isinstance(value, DoorState):
        return value.name
    return "none" if value is None else str(value)


def _is_same(one: Any, other: Any) -> bool:
    """Return whether two values are equal, NaN being equal to NaN."""
    if isinstance(one, float) and isinstance(other, float):
        return one == other or (math.isnan(one) and math.isnan(other))
    if isinstance(one, (Door, Level)) and type(one) is type(other):
        return all(_is_same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    return bool(one == other)


ROUND_KINDS = (ev.PatrolStarted, ev.PatrolFinished)


@dataclass(frozen=True, slots=True)
class Round:
    """One patrol round."""

    patrol: int
    """Its number."""
    start_ns: int | None
    """None: its start was not reported."""
    end_ns: int | None
    """None: it continues, or its end was not reported."""
    actor: str
    """Who drove, by the note of its start, else of its end."""
    name: str
    """What it was for, from the same note."""

    @property
    def label(self) -> str:
        """What people call it."""
        return self.name or f"round {self.patrol}"

    def overlaps(self, since_ns: int, until_ns: int) -> bool:
        """Return whether some of it lies between two times, as far as is known."""
        begun = self.start_ns is None or self.start_ns < until_ns
        return begun and (self.end_ns is None or self.end_ns >= since_ns)


def rounds(entries: Iterable[HistoryEntry]) -> list[Round]:
    """Return the rounds, in the order in which they were first heard of.

    Of several starts or ends of one number the first counts; retracted ones do not.

    Args:
        entries: Of a history; other kinds than `ROUND_KINDS` are passed over.
    """
    found: dict[int, Round] = {}
    for entry in entries:
        event = entry.event
        if entry.retracted or not isinstance(event, ROUND_KINDS):
            continue
        known = found.get(event.patrol)
        here = known or Round(event.patrol, None, None, entry.actor, entry.reason)
        if isinstance(event, ev.PatrolStarted) and here.start_ns is None:
            here = replace(here, start_ns=entry.folds_ns, actor=entry.actor, name=entry.reason)
        elif isinstance(event, ev.PatrolFinished) and here.end_ns is None:
            here = replace(here, end_ns=entry.folds_ns)
        found[event.patrol] = here
    return list(found.values())


@dataclass(frozen=True, slots=True)
class HistoryEntry(ShownAsTable):
    """One event, with who and why."""

    number: int
    event: ev.Event
    happened_ns: int
    """As given; it may lie after `recorded_ns` if a clock was wrong."""
    recorded_ns: int
    actor: str = ""
    source: str = ""
    reason: str = ""
    correlation: str = ""
    command_id: bytes = b""
    retracted: bool = False
    retracted_by: int | None = None
    """The number of the first event that took it back; None: it stands."""
    changes: tuple[ValueChange, ...] = ()
    """What it changed in the map when it was recorded, if that was requested."""

    @property
    def folds_ns(self) -> int:
        """When it counts: one that says it happened later than recorded counts as recorded."""
        return min(self.happened_ns, self.recorded_ns)

    @property
    def recorded(self) -> RecordedEvent:
        """The event without who and why."""
        return RecordedEvent(self.number, self.recorded_ns, self.event)

    @property
    def kind(self) -> str:
        """The event's kind, such as `DoorObserved`."""
        return type(self.event).__name__

    @property
    def door_id(self) -> DoorId | None:
        """The door it is about; None: about none."""
        return self.event.door_id if isinstance(self.event, ev.DoorEvent) else None


NoteTextsOf = Callable[[NDArray[np.int64]], Iterable[tuple[NoteTexts, bytes]]]
"""Event numbers, ascending -> of each who and why, and the id of its command."""


def history(
    batches: Iterable[EventBatch],
    note_texts_of: NoteTextsOf,
    retractions: Retractions,
    changes_in: Callable[[EventBatch], Changes] | None = None,
) -> Iterator[HistoryEntry]:
    """Yield the events of the batches with what their commits say.

    Args:
        batches: Events, numbers ascending; gaps allowed.
        note_texts_of: Returns the notes of the commits; called once a batch.
        retractions: What is hidden; it is shown here, and marked.
        changes_in: Returns what the events of a batch changed; None: changes are left out.
    """
    for batch in batches:
        changes = changes_in(batch) if changes_in is not None else {}
        hidden = retractions.hidden(batch).tolist()
        said = note_texts_of(batch.number)
        for recorded, is_hidden, (note, command_id) in zip(batch, hidden, said, strict=True):
            actor, source, reason, correlation = note
            yield HistoryEntry(
                number=recorded.number,
                event=recorded.event,
                happened_ns=recorded.happened_ns,
                recorded_ns=recorded.recorded_ns,
                actor=actor,
                source=source,
                reason=reason,
                correlation=correlation,
                command_id=command_id,
                retracted=is_hidden,
                retracted_by=retractions.first_hiding(recorded.number) if is_hidden else None,
                changes=changes.get(recorded.number, ()),
            )


@dataclass(frozen=True, slots=True)
class ValueChange:
    """A field of a door, or a key of its annotations, that an event gave another value."""

    field: str
    before: Any
    """None: it had none."""
    after: Any


Changes = dict[int, tuple[ValueChange, ...]]
"""Event number -> what it changed; events that changed nothing are left out."""


def changes_of(batch: EventBatch, state: DoorMapState) -> Changes:
    """Return what the events of a batch change.

    Args:
        batch: Events without gaps in their numbers, none of them a retraction.
        state: The map before the first of them.
    """
    found: dict[int, list[ValueChange]] = defaultdict(list)
    by_register: dict[str, list[Writes]] = defaultdict(list)
    for writes in writes_of(batch):
        by_register[writes.register].append(writes)
    for register, parts in by_register.items():
        for number, change in _changes_of_register(batch, state, register, parts):
            found[number].append(change)
    for number, change in _changes_of_texts(batch, state):
        found[number].append(change)
    return {number: tuple(changes) for number, changes in sorted(found.items())}


def _changes_of_register(
    batch: EventBatch, state: DoorMapState, register: str, parts: list[Writes]
) -> Iterator[tuple[int, ValueChange]]:
    """Yield (event number, change) of one register of all doors.

    The value before a write is that of the greatest stamp among those before it, the state's own
    included: a running maximum over the writes to each door, in the order of their numbers.
    """
    where = np.concatenate([part.positions for part in parts])
    in_order = np.argsort(where)
    where = where[in_order]
    doors, group = np.unique(batch.door_ids()[where], return_inverse=True)
    known_ns, known_events, known = state.register_of(doors, register)
    happened = np.concatenate([known_ns, batch.folds_ns[where]])
    numbers = np.concatenate([known_events, batch.number[where]])
    groups = np.concatenate([np.arange(len(doors)), group])
    by_stamp = np.lexsort((numbers, happened, groups))
    rank = np.empty(len(groups), np.int64)
    rank[by_stamp] = np.arange(len(groups))
    rows = np.argsort(groups, kind="stable")  # of each door: what was known, then the writes
    greatest = np.maximum.accumulate(rank[rows])
    counts = rank[rows][1:] > greatest[:-1]
    counts &= rows[1:] >= len(doors)
    before, after = by_stamp[greatest[:-1]][counts], rows[1:][counts]
    written = [part.values_of(np.arange(len(part.positions))) for part in parts]
    for name, old in known.items():
        new = np.concatenate([values[name] for values in written])[in_order]
        values = np.concatenate([old, new])
        was, now = values[before], values[after]
        is_new = numbers[before] == NEVER
        is_empty = np.isnan(now)
        differs = np.where(is_new, ~is_empty, (was != now) & ~(np.isnan(was) & is_empty))
        told = zip(
            numbers[after][differs].tolist(), is_new[differs].tolist(),
            was[differs].tolist(), now[differs].tolist(), strict=True,
        )  # fmt: skip
        for number, first, one, other in told:
            yield number, ValueChange(name, None if first else _value(name, one),
                                      _value(name, other))  # fmt: skip


def _changes_of_texts(batch: EventBatch, state: DoorMapState) -> Iterator[tuple[int, ValueChange]]:
    if ev.DoorAnnotated not in batch:
        return
    where = batch.where(ev.DoorAnnotated)
    said: dict[tuple[int, str], tuple[tuple[int, int], str]] = {}
    stamps = zip(batch.folds_ns[where].tolist(), batch.number[where].tolist(), strict=True)
    for event, stamp in zip(batch.objects[ev.DoorAnnotated.kind], stamps, strict=True):
        assert isinstance(event, ev.DoorAnnotated)
        place = (event.door_id, event.key)
        before = said.get(place) or state.text(*place)
        if before is not None and before[0] > stamp:
            continue
        said[place] = (stamp, event.value)
        if before is None or before[1] != event.value:
            yield stamp[1], ValueChange(event.key, before and before[1], event.value)


def _value(name: str, value: Any) -> Any:
    return DoorState.of(value) if name == "state" else value
