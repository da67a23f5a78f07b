"""What a log holds, in a page: for `info`, and for whoever must judge its health."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.commits import Commit
from semmap_log.doors import DoorMap
from semmap_log.event_batch import EventBatch
from semmap_log.events import KINDS
from semmap_log.log.header import LogInfo
from semmap_log.log.reader import LogReader, Progress
from semmap_log.log.scan import Segment
from semmap_log.projections.door_map import DoorMapState

JUMP_NS = 60 * 10**9
"""A wall clock that moves by more than this against the monotonic clock of its boot is suspect."""


@dataclass(frozen=True, slots=True)
class LogSummary:
    """A log at a glance."""

    info: LogInfo
    segments: tuple[Segment, ...]
    events: int
    commits: int
    counts: dict[str, int]
    """Kind -> events, kinds in their own order."""
    happened_ns: tuple[int, int] | None
    """Least and greatest; None: no events."""
    recorded_ns: tuple[int, int] | None
    head: bytes
    """Hash of the last commit: kept elsewhere, it proves that nothing was cut off."""
    door_map: DoorMap
    warnings: list[str]

    @property
    def bytes(self) -> int:
        """Size of all segments."""
        return sum(len(segment.file) for segment in self.segments)


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
    tally, state, retractions = _Tally(), _state_before(reader), reader.retractions()
    for batch in reader.batches(progress=progress):
        tally.apply(batch)
        state.apply(retractions.visible(batch))
    commits, head, suspects = 0, bytes(32), []
    previous: Commit | None = None
    for commit in reader.commits():
        commits += 1
        head = commit.hash
        if previous is not None and (why := _suspicion(previous, commit)):
            suspects.append(f"event {commit.first_event}: {why}")
        previous = commit
    door_map = state.door_map()
    return LogSummary(
        info=reader.info,
        segments=tuple(reader.segments),
        events=tally.counts.total(),
        commits=commits,
        counts={cls.__name__: tally.counts[cls.kind] for cls in KINDS if tally.counts[cls.kind]},
        happened_ns=tally.happened,
        recorded_ns=tally.recorded,
        head=head,
        door_map=door_map,
        warnings=[*_warnings(reader, tally, door_map), *suspects],
    )


def _state_before(reader: LogReader) -> DoorMapState:
    """Return the state to begin with: of a single segment, what its keyframe holds."""
    first = reader.segments[0]
    known = reader.keyframe(first) if first.header.first_event else None
    return known or DoorMapState()


def _warnings(reader: LogReader, tally: _Tally, door_map: DoorMap) -> list[str]:
    warnings = [
        f"{segment.path.name}: {segment.torn_bytes} bytes behind the last whole commit do not "
        f"count ({segment.problem}); the next writer puts it in order"
        for segment in reader.segments
        if segment.torn_bytes
    ]
    if tally.late_clock:
        warnings.append(
            f"{tally.late_clock} events say that they happened after they were recorded; "
            "they count from their recorded time"
        )
    warnings += [
        f"{door.label}: P(open) + P(closed) = {door.prob_open + door.prob_closed:.3g}, above 1"
        for door in door_map.doors.values()
        if door.prob_open + door.prob_closed > 1 + 1e-9
    ]
    return warnings


def _suspicion(previous: Commit, commit: Commit) -> str:
    """Return why a commit's wall clock cannot be right; empty if it can."""
    walked = commit.wall_clock_ns - previous.wall_clock_ns
    if walked < 0:
        return f"the wall clock went back by {-walked / 1e9:.3g} s"
    ticked = commit.monotonic_clock_ns - previous.monotonic_clock_ns
    if commit.boot_id == previous.boot_id and any(commit.boot_id):
        drift = walked - ticked
        if abs(drift) > JUMP_NS:
            return f"the wall clock jumped by {drift / 1e9:.3g} s"
    return ""


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
