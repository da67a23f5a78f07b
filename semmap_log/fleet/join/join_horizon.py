"""Where the history of a join begins: where that of all of its logs has begun."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.domain.commits import NO_CONTENT, Note
from semmap_log.fleet.join.joined_logs import JoinedLog, JoinedLogs
from semmap_log.replay.horizon import last_writes
from semmap_log.replay.position import retractions_behind
from semmap_log.store.reading.following import FollowedCommit

if TYPE_CHECKING:
    from semmap_log.store.reading.reader import LogReader


def horizon_of(joined: JoinedLogs) -> int:
    """Return the moment (ns) from which on all of a join is known; -1: always.

    That of the log that keeps least; later, if afterwards another takes back what was before it:
    a state at the horizon cannot know both.
    """
    readers = [log.opened for log in joined.logs]
    horizon_ns = max(reader.horizon_ns for reader in readers)
    if horizon_ns < 0:
        return -1
    spans = sorted(span for reader in readers for span in _taken_back(reader))
    for taken_back_ns, first_ns in spans:
        if first_ns <= horizon_ns < taken_back_ns:
            horizon_ns = taken_back_ns
    return horizon_ns


def _taken_back(reader: LogReader) -> list[tuple[int, int]]:
    """Return of each retraction when it was recorded, and when the first that it reaches was."""
    spans = []
    for one in retractions_behind(reader, -1):
        first = reader.find_commit(one.first_event)
        spans.append((reader.commit_at(one.number).recorded_ns, first.recorded_ns if first else 0))
    return spans


def state_before(log: JoinedLog, followed: FollowedCommit, left: Sequence[int]) -> FollowedCommit:
    """Return what stands for the events of a log that are no longer kept, as a commit.

    Args:
        log: One that has a horizon.
        followed: Its first commit behind that.
        left: Numbers of the events before the horizon that are left.

    Raises:
        HorizonError: The state at the horizon cannot be read.
    """
    horizon, horizon_ns = log.opened.horizon, log.opened.horizon_ns
    batch = last_writes(log.opened, left)
    commit = replace(
        followed.commit,
        first_event=horizon,
        count=0,
        recorded_ns=min(horizon_ns, followed.commit.recorded_ns - 1),
        command_id=_id_of_state(log, horizon),
        content=NO_CONTENT,
        note=Note(reason=f"how doors were at event {horizon}, where history begins"),
    )
    return FollowedCommit(commit, replace(batch, recorded_ns=np.full(len(batch), horizon_ns)))


def _id_of_state(log: JoinedLog, horizon: int) -> bytes:
    told = f"state at the horizon {horizon} of {log.log_id}"
    return hashlib.sha256(told.encode()).digest()[:16]
