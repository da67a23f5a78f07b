"""Doors into a rerun recording: each is one entity with its line, its lane and its curves.

Along `happened` its events count in the order in which they happened, as far as they are not taken
back today; along `recorded` and `event` as the log learnt of them, until they were taken back.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from semmap_log.core.folds.door_changes import CHANGE, Changes
from semmap_log.core.model.doors import DoorId
from semmap_log.views.excerpt.door_rows import (
    RecordingEdge,
    by_door,
    opening_changes,
    sorted_by_stamp,
)
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.costmap_pictures import CostmapWriter
from semmap_log.views.rerun.door_writer import DoorWriter, write_style
from semmap_log.views.rerun.knowledge import as_recorded
from semmap_log.views.rerun.rows import EVENT, EVERYWHERE, HAPPENED, MOST_ROWS, RECORDED, RowWriter
from semmap_log.views.rerun.scene import Scene, SceneDoor

MOST_WAITING_ROWS = 2**18
"""In all doors together, some 20 MB: then every door is written, however few its rows are."""


class DoorsWriter:
    """Hands each change to its door, and sees to it that not too many wait."""

    def __init__(
        self,
        writer: RowWriter,
        excerpt: Excerpt,
        scene: Scene,
        palette: Palette,
        costmap: CostmapWriter | None,
    ) -> None:
        self._excerpt = excerpt
        self._scene = scene
        self._pens = (writer, palette, costmap)
        self._plain: dict[DoorId, _PlainDoor] = {}
        self._others: dict[DoorId, list[Changes]] = {}
        self._finished: dict[DoorId, list[DoorWriter]] = {}
        """Of the others, once all that is late has come."""
        for door_id, door in scene.doors.items():
            beside = max(scene.levels[level].doors for level in door.lines)
            write_style(writer, door, palette, doors_beside=beside)
            if door.is_plain:
                self._plain[door_id] = _PlainDoor(DoorWriter(*self._pens, door, EVERYWHERE))
            else:
                self._others[door_id] = []
        self._take(self._opening(scene.doors.values()))

    def take(self, changes: Changes) -> None:
        """Take the next changes, in order of their numbers."""
        self._take(changes)
        if sum(door.rows_waiting for door in self._plain.values()) > MOST_WAITING_ROWS:
            for door in self._plain.values():
                door.write()

    def flush(self) -> None:
        """Write what waits; more will come, and none of it late."""
        for door in self._plain.values():
            if door.rows_waiting:
                door.write()
        for door_id, pens in self._finished.items():
            if changes := self._others[door_id]:
                for pen in pens:
                    pen.draw(np.concatenate(changes))
                self._others[door_id] = []

    def finish(self) -> None:
        """Write what still waits, and let the curves go on to the end."""
        for door in self._plain.values():
            door.write(self._scene.end)
        for door_id, parts in self._others.items():
            changes = np.concatenate([np.empty(0, CHANGE), *parts])
            self._others[door_id] = []
            self._finished[door_id] = self._write_both(self._scene.doors[door_id], changes)

    def _take(self, changes: Changes) -> None:
        for rows in by_door(changes):
            door_id = DoorId(int(rows["door_id"][0]))
            if door_id in self._plain:
                self._plain[door_id].take(rows)
            elif door_id in self._others:
                self._others[door_id].append(rows)

    def _opening(self, doors: Iterable[SceneDoor]) -> Changes:
        """Return how plain doors are when the recording begins in midst."""
        there = [door.before for door in doors if door.is_plain and door.before is not None]
        return opening_changes(there, self._scene.begin)

    def _write_both(self, door: SceneDoor, changes: Changes) -> list[DoorWriter]:
        """Write a door with late events, or ones that were taken back: their order is known now."""
        numbers = changes["number"]
        happened = changes[self._excerpt.has_happened(numbers, changes["folds_ns"])]
        opening = opening_changes([door.before] if door.before else [], self._scene.begin)
        recorded = changes[self._excerpt.was_recorded(numbers, changes["recorded_ns"])]
        along = [DoorWriter(*self._pens, door, lines) for lines in ([HAPPENED], [RECORDED, EVENT])]
        along[0].draw(np.concatenate([opening, sorted_by_stamp(happened)]), self._scene.end)
        along[1].draw(as_recorded(recorded, door.known), self._scene.end)
        return along


class _PlainDoor:
    """Lets a door's changes wait until they make a good chunk, then draws them."""

    def __init__(self, pen: DoorWriter) -> None:
        self._pen = pen
        self._waiting: list[Changes] = []
        self.rows_waiting = 0

    def take(self, changes: Changes) -> None:
        self._waiting.append(changes)
        self.rows_waiting += len(changes)
        if self.rows_waiting >= MOST_ROWS:
            self.write()

    def write(self, end: RecordingEdge | None = None) -> None:
        """Draw what waits; with `end`, it is the last."""
        changes = np.concatenate([np.empty(0, CHANGE), *self._waiting])
        self._waiting, self.rows_waiting = [], 0
        self._pen.draw(changes, end)
