"""Log + a moment -> the events that count, and the door map.

Log + projection + a moment -> a state, from the log's start or on from a checkpoint. Also the
commits of a log, and what stands for those that it no longer keeps.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent, happened_by
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.projection import SAVE_EVERY_S, Projection
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import NO_CONTENT, Commit, Note
from semmap_log.log.replay.running import RunningFold
from semmap_log.log.replay.state import Checkpoint, Position, last_writes, state_at
from semmap_log.store.reading.following import FollowedCommit, commits_after
from semmap_log.store.reading.reader import LogReader, OnPage
from semmap_log.store.reading.window import Window


@dataclass(frozen=True, slots=True)
class Scope:
    """Which events count. Every bound is inclusive; None: no bound."""

    at_ns: int | None = None
    """Happened by then: what was true, with all that is known."""
    known_at_ns: int | None = None
    """Recorded by then, whole commits: what was known. With `at_ns`: bitemporal."""
    event: int | None = None
    """Up to that event number."""

    def limit(self, reader: LogReader) -> int | None:
        """Return the greatest event number that counts; None: all."""
        limits = [] if self.event is None else [self.event]
        if self.known_at_ns is not None:
            limits.append(reader.event_known_at(self.known_at_ns))
        return min(limits, default=None)


def replay(
    reader: LogReader,
    scope: Scope = Scope(),
    *,
    progress: Progress | None = None,
    with_newer: bool = False,
) -> DoorMapState:
    """Return the door map of a scope, from the nearest keyframe.

    Args:
        reader: Of the log.
        scope: Which events count.
        progress: Called with the progress of the reading.
        with_newer: Even where an event of an unknown kind may have changed it.

    Raises:
        NewerLogError: There is such an event.
    """
    return state_at(
        reader,
        at_ns=scope.at_ns,
        limit=scope.limit(reader),
        progress=progress,
        with_newer=with_newer,
    )


def visible_batches(
    reader: LogReader,
    scope: Scope = Scope(),
    *,
    progress: Progress | None = None,
    on_page: OnPage | None = None,
    doors: Collection[int] | None = None,
) -> Iterator[EventBatch]:
    """Yield the events of a scope, without those retracted by what is known in it.

    Args:
        reader: Of the log.
        scope: Which events count.
        progress: Called with the progress of the reading.
        on_page: Called with the records of each batch that comes from the log itself.
        doors: Only events about these; None: all.
    """
    from semmap_log.log.replay.read_model.events_about import events_about

    limit = scope.limit(reader)
    if limit is not None and limit < 0:
        return
    retractions = reader.retractions(limit=limit)
    window = Window.up_to(at_ns=scope.at_ns, event=limit)
    before: Iterable[EventBatch] = ()
    if reader.horizon:
        from semmap_log.log.replay.state import events_at_horizon

        reader.check_horizon(window)
        before = events_at_horizon(reader, window, doors)
        window = replace(window, first_event=reader.horizon)
    found = events_about(reader, window, doors, progress=progress, on_page=on_page)
    for batch in chain(before, found):
        visible = retractions.visible(batch)
        if len(visible):
            yield visible


def kept_commits(
    reader: LogReader, *, at_ns: int | None = None, limit: int | None = None
) -> Iterator[FollowedCommit]:
    """Yield all commits that a log keeps, by the time of their recording.

    Where it has a horizon, the state there is yielded as well, as an update for each event that
    is gone and was the last to write something. The update takes the place of that event in its
    commit, if that is left. Else it gets a commit of its own; when the event was recorded is not
    known then: the update comes as late as it can, so that it counts from when the event happened.

    Args:
        reader: Of the log.
        at_ns: Only events that had happened by then, and what is taken back; None: all.
        limit: Only events up to that number; None: all.

    Raises:
        HorizonError: The requested range ends before the horizon.
        NewerLogError: A commit has an event of an unknown kind that may change others.
        CorruptLogError: A chunk is not what was written.
    """
    ends_before = reader.horizon and limit is not None and limit < reader.horizon - 1
    if ends_before or (at_ns is not None and at_ns < reader.horizon_ns):
        raise reader.horizon_error()
    for followed in _all_kept(reader):
        if limit is not None and followed.commit.first_event > limit:
            return
        batch = followed.batch
        if limit is not None and followed.commit.last_event > limit:
            batch = batch.select(batch.number <= limit)
        if at_ns is not None:
            batch = happened_by(batch, at_ns)
        yield followed if batch is followed.batch else FollowedCommit(followed.commit, batch)


def _all_kept(reader: LogReader) -> Iterator[FollowedCommit]:
    gone = deque(last_writes(reader) if reader.horizon else ())
    for followed in commits_after(reader, -1):
        commit = followed.commit
        before = _taken(gone, commit.first_event)
        if before:
            end_ns = min(commit.recorded_ns - 1, reader.horizon_ns)
            yield _in_place_of(before, end_ns, reader, commit)
        within = _taken(gone, commit.last_event + 1)
        yield followed if not within else _with_updates(followed, within)


def _taken(gone: deque[RecordedEvent], before_event: int) -> list[RecordedEvent]:
    found = []
    while gone and gone[0].number < before_event:
        found.append(gone.popleft())
    return found


def _with_updates(followed: FollowedCommit, updates: list[RecordedEvent]) -> FollowedCommit:
    """Return a commit with updates for events that it lacks, recorded when those were."""
    commit = followed.commit
    events = sorted([*followed.batch, *updates], key=lambda one: one.number)
    numbers = np.array([one.number for one in events], np.int64)
    recorded_ns = commit.recorded_ns + numbers - commit.first_event
    return FollowedCommit(commit, _batch(events, recorded_ns))


def _in_place_of(
    updates: list[RecordedEvent], end_ns: int, reader: LogReader, behind: Commit
) -> FollowedCommit:
    """Return a commit of updates that stand for events which are gone.

    It leaves room for a note where the events had happened early enough.

    Args:
        updates: Numbers ascending.
        end_ns: When it is closed, at the latest.
        reader: Of the log.
        behind: The commit after it.
    """
    first, count = updates[0].number, len(updates)
    recorded_ns = end_ns - count
    has_room = all(one.happened_ns < recorded_ns + i for i, one in enumerate(updates))
    recorded_ns -= has_room
    told = f"event {first} of {reader.info.log_id}"
    commit = replace(
        behind,
        first_event=first,
        count=0,
        recorded_ns=recorded_ns,
        closed_ns=recorded_ns + count,
        command_id=hashlib.sha256(told.encode()).digest()[: len(behind.command_id)],
        content=NO_CONTENT,
        note=Note(),
    )
    return FollowedCommit(commit, _batch(updates, recorded_ns + np.arange(count)))


def _batch(events: list[RecordedEvent], recorded_ns: NDArray[np.int64]) -> EventBatch:
    """Return events as a batch that was recorded at these moments."""
    return replace(
        EventBatch.from_events([one.event for one in events]),
        number=np.array([one.number for one in events], np.int64),
        recorded_ns=recorded_ns,
        known_door_ids=None,
    )


S = TypeVar("S")


def fold(
    reader: LogReader,
    projection: Projection[S],
    scope: Scope = Scope(),
    *,
    checkpoint: Path | None = None,
    save_every_s: float = SAVE_EVERY_S,
    progress: Progress | None = None,
) -> S:
    """Return the state that a projection makes of the events of a scope.

    Args:
        reader: Of the log.
        projection: The fold.
        scope: Which events count.
        checkpoint: File to go on from, if it is of an earlier moment, and to save to. It keeps
            states at the ends of commits, of all that had happened: another scope's answer may
            begin with it, and does not change it.
        save_every_s: How often it is saved at most, before the end.
        progress: Called with the progress of the reading.

    Raises:
        CheckpointError: The file is of something else, or the state cannot be stored in one.
        OutputError: It cannot be written.
        CorruptLogError: The log is damaged.
    """
    if checkpoint is None:
        return _from_the_start(reader, projection, scope, progress)
    file = Checkpoint(checkpoint, projection, reader)
    limit = scope.limit(reader)
    saved = file.load(reader)
    if saved is not None and not _is_earlier(saved[0], scope, limit):
        return _from_the_start(reader, projection, scope, progress)
    running = RunningFold(projection, saved, file, save_every_s=save_every_s)
    running.advance(reader, limit, at_ns=scope.at_ns, progress=progress)
    running.save()
    return running.state


def fold_part(
    reader: LogReader,
    projection: Projection[S],
    first: int,
    last: int,
    *,
    known_event: int | None = None,
) -> S:
    """Return the state that the events `first` to `last`, inclusive, make of `initial()`.

    Retractions count wherever in the log they are, up to the event `known_event` (None: as they are
    known now): so the states of parts that follow each other, merged, are that of the whole log.
    """
    hidden = reader.retractions(limit=known_event)
    state = projection.initial()
    for batch in reader.batches(Window(first_event=first, before_event=last + 1)):
        visible = hidden.visible(batch)
        if len(visible):
            state = projection.apply(state, visible)
    return state


def _from_the_start(
    reader: LogReader, projection: Projection[S], scope: Scope, progress: Progress | None
) -> S:
    state = projection.initial()
    for batch in visible_batches(reader, scope, progress=progress):
        state = projection.apply(state, batch)
    return state


def _is_earlier(position: Position, scope: Scope, limit: int | None) -> bool:
    """Return whether everything folded up to a position counts in the scope."""
    return (limit is None or position.event <= limit) and (
        scope.at_ns is None or position.latest_ns <= scope.at_ns
    )
