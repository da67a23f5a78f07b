"""Where the history of a join begins: where that of all of its logs has begun."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from semmap_log.fleet.join.door_plan import DoorPlan
from semmap_log.fleet.join.joined_logs import JoinedLogs
from semmap_log.fleet.join.thinned_conflicts import known_again_ns
from semmap_log.log.replay.position import retractions_behind
from semmap_log.store.reading.window import Window

if TYPE_CHECKING:
    from semmap_log.store.reading.reader import LogReader


def horizon_of(joined: JoinedLogs, plan: DoorPlan) -> int:
    """Return the moment (ns) from which on all of a join is known; -1: always.

    That of the log that keeps least; later, if one disagrees with what was thinned of another, or
    if afterwards one takes back what was before it: a state at the horizon cannot know both.
    """
    readers = [log.opened for log in joined.logs]
    horizon_ns = max(known_again_ns(joined, plan), *(reader.horizon_ns for reader in readers))
    if horizon_ns < 0:
        return -1
    spans = sorted(span for reader in readers for span in _taken_back(reader))
    for taken_back_ns, first_ns in spans:
        if first_ns <= horizon_ns < taken_back_ns:
            horizon_ns = taken_back_ns
    return horizon_ns


def _taken_back(reader: LogReader) -> Iterator[tuple[int, int]]:
    """Yield of each retraction when its commit was recorded, and that of the first it reaches.

    None from before a log's own horizon reaches what is asked about; what is gone matters no more.
    """
    for one in retractions_behind(reader, reader.horizon - 1):
        reached = Window(first_event=one.first_event, before_event=one.last_event + 1)
        for batch in reader.batches(reached):
            first, last = (reader.commit_at(n) for n in (int(batch.number[0]), one.number))
            yield last.recorded_ns, first.recorded_ns
            break
