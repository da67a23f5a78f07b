"""What a log holds, in a page: for `info`, and for whoever must judge its health."""

from __future__ import annotations

from collections import Counter
from dataclasses import field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.early_events import EarlyEvents
from semmap_log.core.io.progress import Progress
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.commits import Durability
from semmap_log.core.model.doors import DoorMap, suspect_units
from semmap_log.core.model.events import KINDS
from semmap_log.core.model.moments import format_local
from semmap_log.core.texts import counted
from semmap_log.log.door_log.backdating import early_events, remedy
from semmap_log.log.door_log.door_labels import labels_of
from semmap_log.log.door_log.personal_data import PersonalData
from semmap_log.log.replay.read_model.indexing import IndexState, index_state
from semmap_log.log.replay.state import keyframe_at
from semmap_log.store.clock_check import ClockCheck, SuspectCommit
from semmap_log.store.header import LogInfo
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_scan import Segment


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
    """What tells of persons, or may."""
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
        f"{segment.path.name}: behind the last whole commit {counted(segment.torn_bytes, 'byte')} "
        f"that cannot count ({segment.problem}); the next writer puts it in order"
        for segment in reader.segments
        if segment.torn_bytes
    ]
    newer = reader.newer_events
    if newer.first is not None:
        warnings.append(
            f"a newer version of semmap-log has written {newer.in_words()}, from event "
            f"{newer.first} on: unknown here, and the doors may have changed since"
        )
    elif newer.counts:
        warnings.append(
            f"a newer version of semmap-log has written {newer.in_words()}: unknown here; they "
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
        warnings.append(f"{early.in_words(labels, since)}; {remedy(reader.folder)}")
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


def open_any(path: Path) -> LogReader:
    """Open a log's folder, or a single segment of one, for a look.

    Raises:
        NotALogError: It is neither.
    """
    if path.suffix == ".mcap":
        return LogReader(path.parent, only=path)
    return LogReader(path)
