"""A log's content in a page, for `info` and for whoever must judge its health.

Also what it holds, or may hold, about persons, for `info` and for whoever decides what is redacted;
and doors with events from before they were added, and how to correct that.

A correction moves an adding to an earlier time: one commit retracts the DoorAdded and adds the door
again, under its id, at the earlier time. Queries as known before still see the first.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent
from semmap_log.core.folds.door_index import labels_of
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.early_events import (
    MAY_BE_EARLY,
    Addings,
    EarlyEvents,
    added_since,
    remedy,
)
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Commit, Durability, Note
from semmap_log.core.model.doors import CLASS, DoorId, DoorMap, suspect_units
from semmap_log.core.model.events import (
    KINDS,
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    Event,
    FloorMap,
    LevelAdded,
    PatrolStarted,
    Retracted,
    RobotPose,
)
from semmap_log.core.model.moments import SECOND_NS, format_local
from semmap_log.core.texts import counted
from semmap_log.log.replay.read_model.indexing import IndexState, index_state
from semmap_log.log.replay.state import keyframe_at
from semmap_log.store.clock_check import ClockCheck, SuspectCommit
from semmap_log.store.header import LogInfo
from semmap_log.store.pages import kinds_mask
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window


@dataclass(frozen=True, slots=True)
class LogSummary:
    """A log at a glance."""

    info: LogInfo
    segments: tuple[Segment, ...]
    events: int
    commits: int
    counts: dict[str, int]
    """Kind -> events, kinds in their own order; those of a later version come last."""
    happened_ns: tuple[int, int] | None
    """Least and greatest; None: no events."""
    recorded_ns: tuple[int, int] | None
    head: bytes
    """Hash of the last commit: kept elsewhere, it proves that nothing was cut off."""
    durability: dict[str, int]
    """What was promised when they were written (`event`, `batch` …) -> commits."""
    suspects: list[SuspectCommit]
    """Commits whose wall clock cannot be right."""
    door_map: DoorMap
    warnings: list[str]
    """What else looks wrong."""
    personal: PersonalData
    """What is, or may be, about persons."""
    index: IndexState | None = None
    """How far the tables by door are; None: the log has none."""
    is_understood: bool = True
    """Whether this program knows all that may have changed a door."""

    @property
    def bytes(self) -> int:
        """Size of all segments."""
        return sum(segment.size for segment in self.segments)


@dataclass(slots=True)
class _Tally:
    """Counts over all events."""

    counts: Counter[int] = field(default_factory=Counter)
    happened: tuple[int, int] | None = None
    recorded: tuple[int, int] | None = None
    late_clock: int = 0

    def apply(self, batch: EventBatch) -> None:
        self.counts.update(dict(enumerate(np.bincount(batch.kind).tolist())))
        self.happened = _wider(self.happened, batch.folds_ns)
        self.recorded = _wider(self.recorded, batch.recorded_ns)
        self.late_clock += int(np.count_nonzero(batch.happened_ns > batch.recorded_ns))


def summarize(reader: LogReader, *, progress: Progress | None = None) -> LogSummary:
    """Return a log's summary; reads all of it."""
    tally, personal, state = _Tally(), PersonalData(), _state_before(reader)
    retractions = reader.retractions(with_newer=True)
    for batch in reader.batches(progress=progress, with_newer=True):
        tally.apply(batch)
        personal.take(batch)
        state.apply(retractions.visible(batch))
    promised: Counter[Durability] = Counter()
    clock, head, suspects = ClockCheck(), bytes(32), []
    for commit in reader.commits():
        promised[commit.durability] += 1
        personal.take_note(commit.note)
        head = commit.hash
        if (suspect := clock.add(commit)) is not None:
            suspects.append(suspect)
    door_map = state.door_map()
    return LogSummary(
        info=reader.info,
        segments=tuple(reader.segments),
        events=tally.counts.total(),
        commits=promised.total(),
        counts={
            **{cls.__name__: tally.counts[cls.kind] for cls in KINDS if tally.counts[cls.kind]},
            **reader.newer_events.counts,
        },
        happened_ns=tally.happened,
        recorded_ns=tally.recorded,
        head=head,
        durability={d.name.lower(): promised[d] for d in Durability if promised[d]},
        suspects=suspects,
        door_map=door_map,
        warnings=_warnings(reader, tally, door_map),
        personal=personal,
        index=index_state(reader),
        is_understood=reader.newer_events.first is None,
    )


def _state_before(reader: LogReader) -> DoorMapState:
    """Return the state to begin with: of a single segment, what its keyframe holds."""
    first = reader.segments[0]
    known = keyframe_at(first, 0) if first.header.first_event and len(first.chunks) else None
    return known or DoorMapState()


def _warnings(reader: LogReader, tally: _Tally, door_map: DoorMap) -> list[str]:
    warnings = [
        f"{segment.path.name}: {counted(segment.torn_bytes, 'byte')} after the last whole commit "
        f"do not count ({segment.problem}); the next writer repairs it"
        for segment in reader.segments
        if segment.torn_bytes
    ]
    newer = reader.newer_events
    if newer.first is not None:
        warnings.append(
            f"a newer version of semmap-log has written {newer.as_text()}, from event "
            f"{newer.first} on: unknown here, and the doors may have changed since"
        )
    elif newer.counts:
        warnings.append(
            f"a newer version of semmap-log has written {newer.as_text()}: unknown here; they "
            "change nothing else"
        )
    if tally.late_clock:
        warnings.append(
            f"events said to have happened after they were recorded: {tally.late_clock:,}; "
            "they count from their recorded time"
        )
    labels = labels_of(door_map)
    early = EarlyEvents.none() if newer.first is not None else early_events(reader)
    if early.counts:
        since = format_local(min(early.first_ns.values()), reader.info.timezone)
        warnings.append(f"{early.as_text(labels, since)}; {remedy(reader.folder)}")
    warnings += [
        f"{labels.get(door.door_id, door.label)}: P(open) + P(closed) = "
        f"{door.prob_open + door.prob_closed:.3g}, above 1"
        for door in door_map.doors.values()
        if door.prob_open + door.prob_closed > 1 + 1e-9
    ]
    warnings += [
        f"{labels.get(door.door_id, door.label)}: {what}"
        for door in door_map.doors.values()
        for what in suspect_units(theta=door.theta, width=door.width)
    ]
    return warnings


def _wider(span: tuple[int, int] | None, times: NDArray[np.int64]) -> tuple[int, int]:
    low, high = int(times.min()), int(times.max())
    return (low, high) if span is None else (min(span[0], low), max(span[1], high))


@dataclass(slots=True)
class PersonalData:
    """Counts of what names somebody, says where a robot was, or is free text."""

    notes: int = 0
    """Commits whose notes state who did it, with what, or why."""
    actors: Counter[str] = field(default_factory=Counter)
    """Who did it -> notes."""
    sources: Counter[str] = field(default_factory=Counter)
    """With what -> notes."""
    reasons: int = 0
    """Notes that give a reason, in words."""
    annotations: Counter[str] = field(default_factory=Counter)
    """Key -> how often a door was annotated under it; names of doors, too."""
    poses: int = 0
    """Where the robot was, and when."""
    patrols: int = 0
    """Rounds that began: when somebody was about."""

    def __bool__(self) -> bool:
        """Return whether there is any."""
        return bool(self.notes or self.annotations or self.poses or self.patrols)

    def take(self, batch: EventBatch) -> None:
        """Count events, retracted ones included: they can still be read."""
        for event in batch.objects.get(DoorAnnotated.kind, ()):
            assert isinstance(event, DoorAnnotated), "that is its kind"
            if event.value:
                self.annotations[event.key] += 1
        self.poses += len(batch.where(RobotPose))
        self.patrols += len(batch.where(PatrolStarted))

    def take_note(self, note: Note) -> None:
        """Count what a commit's note contains."""
        self.notes += bool(note)
        self.actors.update([note.actor] * bool(note.actor))
        self.sources.update([note.source] * bool(note.source))
        self.reasons += bool(note.reason)


def early_events(reader: LogReader) -> EarlyEvents:
    """Return the events from before their door was added; retracted ones are left out."""
    hidden = reader.retractions()
    stamps: dict[int, tuple[int, int]] = {}
    for batch in reader.batches(Window(kinds=kinds_mask([DoorAdded]))):
        seen = hidden.visible(batch)
        times = zip(seen.folds_ns.tolist(), seen.number.tolist(), strict=True)
        stamps |= dict(zip(seen.door_ids().tolist(), times, strict=True))
    addings, found = Addings.of(stamps), EarlyEvents.none()
    window = Window(
        happened_before_ns=addings.latest_ns + 1,
        first_event=reader.horizon or None,
        kinds=kinds_mask(MAY_BE_EARLY),
    )
    for batch in reader.batches(window):
        seen = hidden.visible(batch)
        early = addings.early(seen, seen.folds_ns)
        if early.any():
            found.add_rows(seen.door_ids()[early], seen.folds_ns[early])
    return found


def before_first_ns(reader: LogReader) -> int | None:
    """Return a whole second before the earliest event; None: the log has none."""
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
    said = _notes_with(reader, addings)
    told_of = _told_of(reader, since_ns)
    made: list[Event] = [*_floors(reader, levels, since_ns), *_classes(reader, said, since_ns)]
    numbers = sorted(each.number for each in [*addings, *said])
    made += [Retracted(first_event=a, last_event=b) for a, b in _runs(numbers)]
    for each in addings:
        assert isinstance(each.event, DoorAdded)
        door_id = each.event.door_id
        # Of two events of one time the later number counts: the door's event then comes after it.
        from_ns = max(since_ns - (door_id in told_of), 0)
        made += added_since(replace(each.event, happened_ns=_folds_ns(each)), from_ns)
        made += [
            replace(note.event, happened_ns=from_ns)
            for note in said
            if isinstance(note.event, DoorAnnotated) and note.event.door_id == door_id
        ]
    return made


def _notes_with(reader: LogReader, addings: Iterable[RecordedEvent]) -> list[RecordedEvent]:
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
    """Return the doors with events that happened at that very time."""
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
    for batch in reader.batches(Window(kinds=kinds_mask([kind]))):
        yield from hidden.visible(batch)


def _folds_ns(each: RecordedEvent) -> int:
    return min(each.happened_ns, each.recorded_ns)


def _runs(numbers: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Yield the first and the last of each run of numbers without gaps; they ascend."""
    for _, run in groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0]):
        members = [number for _, number in run]
        yield members[0], members[-1]
