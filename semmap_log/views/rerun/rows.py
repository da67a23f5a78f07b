"""Rows into a rerun recording: by columns, at most 4096 rows a call, on our three timelines.

Along `happened` an event stands where it happened, along `recorded` where its commit was recorded:
a commit is known as a whole. Along `event` it stands at its number.

`rr.log` takes a millisecond a row and adds timelines of its own; columns are 50 times faster and 10
times smaller. Chunks beyond 4096 rows make rerun's own tools slow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import Rgb, packed
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.scene import EntityPath

HAPPENED, RECORDED, EVENT = "happened", "recorded", "event"
"""The timelines: when it happened, when the log learnt it, the event's number."""
EVERYWHERE = (HAPPENED, RECORDED, EVENT)

MOST_ROWS = 4096

Rows = NDArray[np.void]
"""A structured array with at least `number`, `folds_ns`, `recorded_ns`."""


class RowWriter:
    """Writes rows to the entities of one recording."""

    def __init__(self, recording: Any, excerpt: Excerpt, commits: NDArray[np.int64]) -> None:
        """Write to a recording.

        Args:
            recording: Rerun's.
            excerpt: Says which events stand on which timelines.
            commits: Number of the first event of each commit, ascending.
        """
        self._recording = recording
        self._excerpt = excerpt
        self._commits = commits
        self._last_commit = np.full(1, -1)

    def note_commits(self, numbers: NDArray[np.int64], recorded_ns: NDArray[np.int64]) -> None:
        """Take in where commits begin that have come since, from events in order."""
        bases = recorded_ns - numbers  # the same in all of a commit, and in no other
        starts = numbers[np.append(self._last_commit, bases)[:-1] != bases]
        known = int(self._commits[-1]) if len(self._commits) else -1
        if len(starts) and starts[-1] > known:
            self._commits = np.append(self._commits, starts[starts > known])
        self._last_commit = bases[-1:]

    def static(self, path: EntityPath, *archetypes: Any) -> None:
        """Write what holds at all times."""
        self._recording.log(entity(path), *archetypes, static=True, strict=True)

    def events(
        self, path: EntityPath, rows: Rows, columns: Callable[[Rows], Sequence[Any]]
    ) -> None:
        """Write one row of components for each event, on the timelines that it stands on.

        Args:
            path: The entity.
            rows: When: the stamps of the events, numbers ascending.
            columns: Gives the component columns for some of the rows.
        """
        happened = self._excerpt.has_happened(rows["number"], rows["folds_ns"])
        recorded = self._excerpt.was_recorded(rows["number"], rows["recorded_ns"])
        if (happened & recorded).all():
            self.rows(path, rows, columns, EVERYWHERE)
        else:
            self.rows(path, rows[happened], columns, [HAPPENED])
            self.rows(path, rows[recorded], columns, [RECORDED, EVENT])

    def rows(
        self,
        path: EntityPath,
        rows: Rows,
        columns: Callable[[Rows], Sequence[Any]],
        timelines: Sequence[str],
    ) -> None:
        """Write one row of components for each of `rows`, on these timelines.

        Of rows of an entity at one time the last written holds.
        """
        for first in range(0, len(rows), MOST_ROWS):
            part = rows[first : first + MOST_ROWS]
            indexes = [self._index(timeline, part) for timeline in timelines]
            self._recording.send_columns(
                entity(path), indexes=indexes, columns=columns(part), strict=True
            )

    def one(
        self, path: EntityPath, row: Rows, archetypes: Sequence[Any], timelines: Sequence[str]
    ) -> None:
        """Write what an entity is from one row on, as `static` takes it."""
        batches = [each for one in archetypes for each in one.as_component_batches()]
        columns = [each.partition([len(each.as_arrow_array())]) for each in batches]
        self.rows(path, row, lambda _: columns, timelines)

    def clear(
        self, path: EntityPath, rows: Rows, timelines: Sequence[str], *, returns: Rows
    ) -> None:
        """Let the entity vanish at these rows; what is static of it stays for its return.

        Args:
            path: The entity.
            rows: When it vanishes; they are written behind all that is shown until then.
            timelines: On which.
            returns: When it shows something again. At the same time as one of these, but before
                it, nothing vanishes.
        """
        if not len(rows):
            return
        for timeline in timelines:
            self.rows(path, rows[~self._is_back(timeline, rows, returns)], _clearing, [timeline])

    def _is_back(self, timeline: str, rows: Rows, returns: Rows) -> NDArray[np.bool_]:
        if not len(returns):
            return np.zeros(len(rows), np.bool_)
        times, numbers = self._times(timeline, returns), returns["number"]
        order = np.lexsort((numbers, times))
        wanted = self._times(timeline, rows)
        last = order[np.maximum(np.searchsorted(times[order], wanted, "right") - 1, 0)]
        is_back: NDArray[np.bool_] = (times[last] == wanted) & (numbers[last] > rows["number"])
        return is_back

    def _times(self, timeline: str, rows: Rows) -> NDArray[np.int64]:
        """Return where rows stand; what was committed together became known together."""
        if timeline == HAPPENED:
            return np.asarray(rows["folds_ns"])
        if timeline == EVENT:
            return np.asarray(rows["number"])
        behind = np.searchsorted(self._commits, rows["number"], "right")
        first = np.append(-1, self._commits)[behind]
        # Within a commit each event is recorded a nanosecond after the one before.
        return rows["recorded_ns"] - np.where(behind > 0, rows["number"] - first, 0)

    def _index(self, timeline: str, rows: Rows) -> Any:
        times = self._times(timeline, rows)
        if timeline == EVENT:
            return rr.TimeColumn(EVENT, sequence=times)
        return rr.TimeColumn(timeline, timestamp=times.astype("M8[ns]"))


def entity(path: EntityPath) -> str:
    """Return the path as rerun writes it."""
    return str(rr.new_entity_path(list(path)))


def rgba(colours: Sequence[Rgb], alpha: int = 255) -> NDArray[np.uint32]:
    """Return the colours as rerun takes them."""
    return np.array([packed(colour, alpha) for colour in colours], np.uint32)


def _clearing(rows: Rows) -> Sequence[Any]:
    return list(rr.Clear.columns(is_recursive=[False] * len(rows)))
