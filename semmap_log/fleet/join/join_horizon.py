"""Where the history of a join begins: where that of all of its logs has begun."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semmap_log.fleet.join.joined_logs import JoinedLogs
from semmap_log.replay.position import retractions_behind

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
