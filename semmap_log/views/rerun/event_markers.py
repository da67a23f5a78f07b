"""The event log into a rerun recording: one line of text an event, one entity a kind."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_changes import Changes
from semmap_log.core.model.events import KINDS
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.log_lines import EventLine, EventLines
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.rows import MOST_ROWS, RowWriter, rgba
from semmap_log.views.rerun.scene import EVENTS, EntityPath

LINE = np.dtype([
    ("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"), ("line", "i8")
])  # fmt: skip


class EventsWriter:
    """Lets each kind's lines wait until they make a good chunk, then writes them."""

    def __init__(self, writer: RowWriter, lines: EventLines, palette: Palette) -> None:
        self._writer = writer
        self._lines = lines
        self._palette = palette
        self._waiting: dict[int, list[EventLine]] = {}

    def take(self, batch: EventBatch, changes: Changes) -> None:
        """Take the next batch, in order of the numbers, and what it does to doors."""
        for line in self._lines.of(batch, changes):
            waiting = self._waiting.setdefault(line.kind, [])
            waiting.append(line)
            if len(waiting) == MOST_ROWS:
                self._write(line.kind)

    def finish(self) -> None:
        """Write what still waits."""
        for kind in list(self._waiting):
            self._write(kind)

    def _write(self, kind: int) -> None:
        lines = self._waiting.pop(kind)
        rows = np.array(
            [(line.number, line.folds_ns, line.recorded_ns, i) for i, line in enumerate(lines)],
            LINE,
        )
        colours = rgba([self._palette.text_of_state(line.state) for line in lines])

        def columns(part: np.ndarray) -> Sequence[Any]:
            chosen = [lines[i] for i in part["line"].tolist()]
            return list(rr.TextLog.columns(
                text=[line.text for line in chosen],
                level=[line.importance for line in chosen],
                color=colours[part["line"]],
            ))  # fmt: skip

        self._writer.events(path_of_kind(kind), rows, columns)


def path_of_kind(kind: int) -> EntityPath:
    """Return the entity of a kind's lines, such as `/events/door_observed`."""
    words = re.findall("[A-Z][a-z]*", KINDS[kind - 1].__name__)
    return (EVENTS, "_".join(words).lower())
