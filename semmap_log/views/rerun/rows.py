"""Rows into a rerun recording: by columns, at most 4096 rows a call, on our three timelines.

`rr.log` takes a millisecond a row and adds timelines of its own; columns are 50 times faster and 10
times smaller. Chunks beyond 4096 rows make rerun's own tools slow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.views.palette import Rgb, packed
from semmap_log.views.rerun.scene import EntityPath
from semmap_log.views.rerun.sdk import rr

HAPPENED, RECORDED, EVENT = "happened", "recorded", "event"
"""The timelines: when it happened, when the log learnt it, the event's number."""
EVERYWHERE = (HAPPENED, RECORDED, EVENT)

MOST_ROWS = 4096

Rows = NDArray[np.void]
"""A structured array with at least `number`, `folds_ns`, `recorded_ns`."""


class RowWriter:
    """Writes rows to the entities of one recording."""

    def __init__(self, recording: Any) -> None:
        self._recording = recording

    def static(self, path: EntityPath, *archetypes: Any) -> None:
        """Write what holds at all times."""
        self._recording.log(entity(path), *archetypes, static=True, strict=True)

    def rows(
        self,
        path: EntityPath,
        rows: Rows,
        columns: Callable[[Rows], Sequence[Any]],
        *,
        late: NDArray[np.bool_] | None = None,
        timelines: Sequence[str] = EVERYWHERE,
    ) -> None:
        """Write one row of components for each of `rows`.

        Args:
            path: The entity.
            rows: When: the stamps of the events.
            columns: Gives the component columns for some of the rows.
            late: Rows that exist on the timeline `happened` only; None: none.
            timelines: Those on which the others exist.
        """
        if late is None:
            self._send(path, rows, columns, timelines)
        else:
            self._send(path, rows[~late], columns, timelines)
            # Behind the others: of rows at one time the last written wins, and late ones have the
            # greater numbers there.
            self._send(path, rows[late], columns, [HAPPENED])

    def clear(self, path: EntityPath, rows: Rows, *, timelines: Sequence[str] = EVERYWHERE) -> None:
        """Let the entity vanish at these rows; what is static of it stays for its return."""
        self.rows(path, rows, _clearing, timelines=timelines)

    def _send(
        self,
        path: EntityPath,
        rows: Rows,
        columns: Callable[[Rows], Sequence[Any]],
        timelines: Sequence[str],
    ) -> None:
        for first in range(0, len(rows), MOST_ROWS):
            part = rows[first : first + MOST_ROWS]
            indexes = [_index(timeline, part) for timeline in timelines]
            self._recording.send_columns(
                entity(path), indexes=indexes, columns=columns(part), strict=True
            )


def entity(path: EntityPath) -> str:
    """Return the path as rerun writes it."""
    return str(rr.new_entity_path(list(path)))


def rgba(colours: Sequence[Rgb], alpha: int = 255) -> NDArray[np.uint32]:
    """Return the colours as rerun takes them."""
    return np.array([packed(colour, alpha) for colour in colours], np.uint32)


def _clearing(rows: Rows) -> Sequence[Any]:
    return list(rr.Clear.columns(is_recursive=[False] * len(rows)))


def _index(timeline: str, rows: Rows) -> Any:
    if timeline == HAPPENED:
        return rr.TimeColumn(HAPPENED, timestamp=rows["folds_ns"].astype("M8[ns]"))
    if timeline == RECORDED:
        return rr.TimeColumn(RECORDED, timestamp=rows["recorded_ns"].astype("M8[ns]"))
    return rr.TimeColumn(EVENT, sequence=rows["number"])
