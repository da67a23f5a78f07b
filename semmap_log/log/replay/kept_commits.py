"""The commits of a log, and what stands for those that it no longer keeps."""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent
from semmap_log.core.model.commits import NO_CONTENT, Commit, Note
from semmap_log.core.model.events import Retracted
from semmap_log.log.replay.horizon import last_writes
from semmap_log.store.reading.following import FollowedCommit, commits_after
from semmap_log.store.reading.reader import LogReader


def kept_commits(
    reader: LogReader, *, at_ns: int | None = None, limit: int | None = None
) -> Iterator[FollowedCommit]:
    """Yield all commits that a log keeps, by the time of their recording.

    Where it has a horizon, the state there is told as well, by an update for each event that is
    gone and was the last to write something. It comes in the place of that event, with its commit
    if that is left, else in one of its own. When the event was recorded is not known: the update
    comes as late as it can, so that it counts from when the event happened.

    Args:
        reader: Of the log.
        at_ns: Only events that had happened by then, and what is taken back; None: all.
        limit: Only events up to that number; None: all.

    Raises:
        HorizonError: What is asked for ends before the horizon.
        NewerLogError: A commit has an event of an unknown kind that may change others.
        CorruptLogError: A chunk is not what was written.
    """
    ends_before = reader.horizon and limit is not None and limit < reader.horizon - 1
    if ends_before or (at_ns is not None and at_ns < reader.horizon_ns):
        raise reader.behind_horizon()
    for followed in _all_kept(reader):
        if limit is not None and followed.commit.first_event > limit:
            return
        batch = followed.batch
        if limit is not None and followed.commit.last_event > limit:
            batch = batch.select(batch.number <= limit)
        if at_ns is not None:
            batch = happened_by(batch, at_ns)
        yield followed if batch is followed.batch else FollowedCommit(followed.commit, batch)


def happened_by(batch: EventBatch, at_ns: int) -> EventBatch:
    """Return events that had happened by a moment, and retractions, which count whenever made."""
    return batch.select((batch.folds_ns <= at_ns) | (batch.kind == Retracted.kind))


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
    """Return a commit with updates for events that it lacks, closed when it was."""
    commit = followed.commit
    events = sorted([*followed.batch, *updates], key=lambda one: one.number)
    recorded_ns = commit.closed_ns - len(events) - bool(commit.note)
    return FollowedCommit(replace(commit, recorded_ns=recorded_ns), _batch(events, recorded_ns))


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
    return FollowedCommit(commit, _batch(updates, recorded_ns))


def _batch(events: list[RecordedEvent], recorded_ns: int) -> EventBatch:
    """Return events as a batch that is recorded from a moment on."""
    return replace(
        EventBatch.from_events([one.event for one in events]),
        number=np.array([one.number for one in events], np.int64),
        recorded_ns=np.arange(recorded_ns, recorded_ns + len(events)),
        known_door_ids=None,
    )
