"""Doors that were there before they were added: what was told of them then, and how to say so.

An adding is moved to an earlier time by a correction: one commit retracts the DoorAdded and adds
the door again, under its id, at the earlier time. Questions as known before still see the first.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import PurePath
from typing import Any

from semmap_log.core.batches.event_batch import RecordedEvent
from semmap_log.core.folds.early_events import MAY_BE_EARLY, Addings, EarlyEvents
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    Retracted,
    defaults_of,
)
from semmap_log.core.model.meaning import PART_OF, PLACING, changed
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.core.model.object_classes import CLASS
from semmap_log.core.texts import command_line
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window


def early_events(reader: LogReader) -> EarlyEvents:
    """Return what the log tells of doors before they were added; retracted events left out."""
    hidden = reader.retractions()
    stamps: dict[int, tuple[int, int]] = {}
    for batch in reader.batches(Window(kinds=bits_of_kinds([DoorAdded]))):
        seen = hidden.visible(batch)
        times = zip(seen.folds_ns.tolist(), seen.number.tolist(), strict=True)
        stamps |= dict(zip(seen.door_ids().tolist(), times, strict=True))
    addings, found = Addings.of(stamps), EarlyEvents.none()
    window = Window(
        happened_before_ns=addings.latest_ns + 1,
        first_event=reader.horizon or None,
        kinds=bits_of_kinds(MAY_BE_EARLY),
    )
    for batch in reader.batches(window):
        seen = hidden.visible(batch)
        early = addings.early(seen, seen.folds_ns)
        if early.any():
            found.add_rows(seen.door_ids()[early], seen.folds_ns[early])
    return found


def remedy(log: PurePath) -> str:
    """Return what to do about events that are told of doors before they were added."""
    line = command_line("import", log, "--since-ever")
    return f"if they were there already, say so: {line}"


def since_ever_ns(reader: LogReader) -> int | None:
    """Return a whole second before the first thing that the log tells; None: it tells nothing."""
    spans = [segment.span for segment in reader.segments if len(segment.chunks)]
    least_ns = min((least for least, _ in spans if least >= 0), default=None)
    return None if least_ns is None else max(least_ns - 1, 0) // SECOND_NS * SECOND_NS


def backdated(reader: LogReader, doors: Collection[DoorId], since_ns: int) -> list[Event]:
    """Return the events of one commit by which doors are in the map from an earlier time on.

    The door's place, its annotations, its level and the level's floor plan count from then on, if
    the log has none of an earlier time. A state and probabilities that came with the adding stay at
    the time that they are from. Doors that were added by then are left alone.

    Args:
        reader: Of the log.
        doors: Which.
        since_ns: From then on.
    """
    addings = [
        each
        for each in _visible(reader, DoorAdded)
        if isinstance(each.event, DoorAdded)
        and each.event.door_id in doors
        and _folds_ns(each) > since_ns
    ]
    if not addings:
        return []
    levels = {each.event.level for each in addings if isinstance(each.event, DoorAdded)}
    said = _said_with(reader, addings)
    told_of = _told_of(reader, since_ns)
    made: list[Event] = [*_floors(reader, levels, since_ns), *_classes(reader, said, since_ns)]
    numbers = sorted(each.number for each in [*addings, *said])
    made += [Retracted(first_event=a, last_event=b) for a, b in _runs(numbers)]
    for each in addings:
        assert isinstance(each.event, DoorAdded)
        door_id = each.event.door_id
        # Of two events of one time the later number counts: what is told of then comes after it.
        from_ns = max(since_ns - (door_id in told_of), 0)
        made += added_since(replace(each.event, happened_ns=_folds_ns(each)), from_ns)
        made += [
            replace(note.event, happened_ns=from_ns)
            for note in said
            if isinstance(note.event, DoorAnnotated) and note.event.door_id == door_id
        ]
    return made


def added_since(added: DoorAdded, since_ns: int | None) -> Iterator[Event]:
    """Yield an adding at an earlier time, and what it says of the state at its own time."""
    defaults = defaults_of(DoorAdded)
    unsaid = {name: defaults[name] for name, part in PART_OF.items() if not part & PLACING}
    yield replace(added, happened_ns=since_ns, **unsaid)
    said = {name: getattr(added, name) for name in unsaid}
    told = {name: value for name, value in said.items() if _is_told(value)}
    if told:
        yield DoorUpdated(
            happened_ns=added.happened_ns,
            door_id=added.door_id,
            changed=changed(told),
            **told,
        )


def _is_told(value: Any) -> bool:
    return value is not DoorState.UNKNOWN and not math.isnan(value)


def _said_with(reader: LogReader, addings: Iterable[RecordedEvent]) -> list[RecordedEvent]:
    """Return what the commits that added doors say of them in words."""
    commits: dict[DoorId, Commit] = {}
    last: Commit | None = None
    for added in addings:  # their numbers ascend
        if last is None or added.number > last.last_event:
            last = reader.find_commit(added.number)
        assert last is not None
        assert isinstance(added.event, DoorEvent)
        commits[added.event.door_id] = last
    return [
        note
        for note in _visible(reader, DoorAnnotated)
        if isinstance(note.event, DoorAnnotated)
        and (commit := commits.get(note.event.door_id)) is not None
        and commit.first_event <= note.number <= commit.last_event
    ]


def _told_of(reader: LogReader, at_ns: int) -> set[int]:
    """Return the doors of which something is told that happened at that very time."""
    window = Window(happened_from_ns=at_ns, happened_before_ns=at_ns + 1)
    return {door_id for batch in reader.batches(window) for door_id in batch.door_ids().tolist()}


def _floors(reader: LogReader, levels: Collection[int], since_ns: int) -> Iterator[Event]:
    """Yield the first name and floor plan of levels, from that time on, if they are from later."""
    for kind in (LevelAdded, FloorMap):
        first: dict[int, RecordedEvent] = {}
        for each in _visible(reader, kind):
            assert isinstance(each.event, (LevelAdded, FloorMap))
            level = each.event.level
            if level not in first or _folds_ns(each) < _folds_ns(first[level]):
                first[level] = each
        for level in sorted(first.keys() & levels):
            if _folds_ns(first[level]) > since_ns:
                yield replace(first[level].event, happened_ns=since_ns)


def _classes(
    reader: LogReader, said: Iterable[RecordedEvent], since_ns: int
) -> Iterator[ClassDefined]:
    """Yield the first definitions of the objects' classes, from that time on, if they are later."""
    named = {each.event.value for each in said
             if isinstance(each.event, DoorAnnotated) and each.event.key == CLASS}  # fmt: skip
    first: dict[str, tuple[int, ClassDefined]] = {}
    for each in _visible(reader, ClassDefined) if named else ():
        assert isinstance(each.event, ClassDefined)
        known = first.get(each.event.class_name)
        if known is None or _folds_ns(each) < known[0]:
            first[each.event.class_name] = _folds_ns(each), each.event
    for name in sorted(first.keys() & named):
        if first[name][0] > since_ns:
            yield replace(first[name][1], happened_ns=max(since_ns - 1, 0))


def _visible(reader: LogReader, kind: type[Event]) -> Iterator[RecordedEvent]:
    hidden = reader.retractions()
    for batch in reader.batches(Window(kinds=bits_of_kinds([kind]))):
        yield from hidden.visible(batch)


def _folds_ns(each: RecordedEvent) -> int:
    return min(each.happened_ns, each.recorded_ns)


def _runs(numbers: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Yield the first and the last of each run of numbers without gaps; they ascend."""
    for _, run in groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0]):
        members = [number for _, number in run]
        yield members[0], members[-1]
