"""The commits of a log, and one more at its horizon: what stands for those that are gone."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from semmap_log.batches.event_batch import EventBatch
from semmap_log.domain.commits import NO_CONTENT, Commit, Note
from semmap_log.domain.events import Retracted
from semmap_log.replay.horizon import last_writes
from semmap_log.store.reading.following import FollowedCommit, commits_after
from semmap_log.store.reading.reader import LogReader


def kept_commits(
    reader: LogReader, *, at_ns: int | None = None, limit: int | None = None
) -> Iterator[FollowedCommit]:
    """Yield all commits that a log keeps, by the time of their recording.

    Where it has a horizon, the state there comes before what was recorded since, as a commit of
    updates. Without it, whoever folds them knows nothing of a door until something is told of it.

    Args:
        reader: Of the log.
        at_ns: Only events that had happened by then, and what is taken back; None: all.
        limit: Only events up to that number; None: all.

    Raises:
        HorizonError: What is asked for ends before the horizon.
        NewerLogError: A commit has an event of an unknown kind that may change others.
        CorruptLogError: A chunk is not what was written.
    """
    ends_before = limit is not None and limit < reader.horizon
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
    left: list[int] | None = [] if reader.horizon else None
    for followed in commits_after(reader, -1):
        if left is not None:
            numbers = followed.batch.number
            left += numbers[numbers < reader.horizon].tolist()
            if followed.commit.last_event >= reader.horizon:
                yield _state(reader, followed.commit, left)
                left = None
        yield followed


def _state(reader: LogReader, behind: Commit, left: list[int]) -> FollowedCommit:
    """Return the state at the horizon, as far as no event that is left tells it, as a commit."""
    horizon_ns = reader.horizon_ns
    batch = last_writes(reader, left)
    told = f"state at the horizon {reader.horizon} of {reader.info.log_id}"
    commit = replace(
        behind,
        first_event=reader.horizon,
        count=0,
        recorded_ns=min(horizon_ns, behind.recorded_ns - 1),
        command_id=hashlib.sha256(told.encode()).digest()[: len(behind.command_id)],
        content=NO_CONTENT,
        note=Note(reason=f"how doors were at event {reader.horizon}, where history begins"),
    )
    return FollowedCommit(commit, replace(batch, recorded_ns=np.full(len(batch), horizon_ns)))
