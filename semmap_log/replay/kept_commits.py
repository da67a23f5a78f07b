"""The commits of a log, and what stands for those that it no longer keeps."""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from semmap_log.batches.event_batch import EventBatch, RecordedEvent
from semmap_log.domain.commits import NO_CONTENT, Commit, Note
from semmap_log.domain.events import Retracted
from semmap_log.replay.horizon import last_writes
from semmap_log.store.reading.following import FollowedCommit, commits_after
from semmap_log.store.reading.reader import LogReader

NS_OF_ONE = 3
"""So many log times a commit of one event and a note takes."""


def kept_commits(
    reader: LogReader, *, at_ns: int | None = None, limit: int | None = None
) -> Iterator[FollowedCommit]:
    """Yield all commits that a log keeps, by the time of their recording.

    Where it has a horizon, the state there is told as well, by a commit with an update for each
    event that is gone and was the last to write something. It comes in the place of that event:
    when that was recorded is not known, but for what was recorded before and after, and when it
    happened.

    Args:
        reader: Of the log.
        at_ns: Only events that had happened by then, and what is taken back; None: all.
        limit: Only events up to that number; None: all.

    Raises:
        HorizonError: What is asked for ends before the horizon.
        NewerLogError: A commit has an event of an unknown kind that may change others.
        CorruptLogError: A chunk is not what was written.
    """
    ends_before = reader.horizon and limit is not None and limit < reader.horizon
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
    last_ns = 0
    for followed in commits_after(reader, -1):
        behind = followed.commit
        while gone and gone[0].number <= behind.last_event:
            before_ns = min(behind.recorded_ns, reader.horizon_ns) - NS_OF_ONE
            last_ns = min(max(gone[0].happened_ns, last_ns + 1), before_ns)
            yield _in_place_of(gone.popleft(), last_ns, reader, behind)
            last_ns += NS_OF_ONE - 1
        yield followed
        last_ns = behind.closed_ns


def _in_place_of(
    update: RecordedEvent, recorded_ns: int, reader: LogReader, behind: Commit
) -> FollowedCommit:
    """Return the commit of an update that stands for an event which is gone."""
    number = update.number
    told = f"event {number} of {reader.info.log_id}"
    commit = replace(
        behind,
        first_event=number,
        count=0,
        recorded_ns=recorded_ns,
        command_id=hashlib.sha256(told.encode()).digest()[: len(behind.command_id)],
        content=NO_CONTENT,
        note=Note(reason=f"as event {number} said, which is no longer kept"),
    )
    batch = replace(
        EventBatch.from_events([update.event]),
        number=np.array([number]),
        recorded_ns=np.array([recorded_ns]),
        known_door_ids=None,
    )
    return FollowedCommit(commit, batch)
