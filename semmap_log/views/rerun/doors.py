"""Doors into a rerun recording: each is one entity with its line, its lane and its curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import DoorState
from semmap_log.events import DoorRemoved
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.costmap import CostmapWriter
from semmap_log.views.rerun.costmap_doors import DoorRows, slim
from semmap_log.views.rerun.door_rows import (
    CHANGE,
    NEVER,
    Changes,
    DoorFold,
    Edge,
    by_door,
    late_rows,
    opening_changes,
    sorted_by_stamp,
    strips_of,
)
from semmap_log.views.rerun.rows import MOST_ROWS, RowWriter, rgba
from semmap_log.views.rerun.scene import Scene, SceneDoor
from semmap_log.views.rerun.sdk import rr

MOST_WAITING_ROWS = 2**18
"""In all doors together, some 20 MB: then every door is written, however few its rows are."""

MOST_NAMES = 20
"""On a level with more doors their names would lie on each other: there, ids stand for them."""
MOST_IDS = 120
"""With still more, there are no labels; hovering over a door shows who it is."""

LINE_UI_POINTS = 2.5
STATE_NAMES = np.array([state.name for state in DoorState])


class DoorsWriter:
    """Hands each change to its door, and sees to it that not too many wait."""

    def __init__(
        self, writer: RowWriter, scene: Scene, palette: Palette, costmap: CostmapWriter | None
    ) -> None:
        self._tracks = {
            int(door_id): _DoorTrack(writer, door, palette, costmap)
            for door_id, door in scene.doors.items()
        }
        for track in self._tracks.values():
            track.write_style(
                doors_beside=max(scene.levels[level].doors for level in track.door.lines)
            )
        self._end = scene.end
        self.take(
            opening_changes(
                [door.before for door in scene.doors.values() if door.before is not None],
                scene.begin,
            )
        )

    def take(self, changes: Changes) -> None:
        """Take the next changes, in order of their numbers."""
        for rows in by_door(changes):
            if (track := self._tracks.get(int(rows["door_id"][0]))) is not None:
                track.take(rows)
        in_order = [t for t in self._tracks.values() if not t.door.has_late_events]
        if sum(track.rows_waiting for track in in_order) > MOST_WAITING_ROWS:
            for track in in_order:
                track.write()

    def flush(self) -> None:
        """Write what waits; more will come, and none of it late."""
        for track in self._tracks.values():
            if track.rows_waiting:
                track.write()

    def finish(self) -> None:
        """Write what still waits, and let the curves go on to the end."""
        for track in self._tracks.values():
            track.write(self._end)


class _DoorTrack:
    """Lets a door's changes wait until they make a good chunk, then writes them.

    A door with late events waits for the end: only then is the order known in which they count.
    """

    def __init__(
        self, writer: RowWriter, door: SceneDoor, palette: Palette, costmap: CostmapWriter | None
    ) -> None:
        self.door = door
        self._costmap = costmap
        self.rows_waiting = 0
        self._waiting: list[Changes] = []
        self._writer = writer
        self._colours = rgba([palette.of_state(state) for state in DoorState])
        self._fold = DoorFold(door.life, repeats=door.has_late_events)
        self._last_point: Changes = np.empty(0, CHANGE)

    def take(self, changes: Changes) -> None:
        self._waiting.append(changes)
        self.rows_waiting += len(changes)
        if self.rows_waiting >= MOST_ROWS and not self.door.has_late_events:
            self.write()

    def write(self, end: Edge | None = None) -> None:
        """Write what waits; with `end`, it is the last, and the curves go on to there."""
        changes = np.concatenate([np.empty(0, CHANGE), *self._waiting])
        self._waiting, self.rows_waiting = [], 0
        if self.door.has_late_events:
            changes = sorted_by_stamp(changes)
        picture = self._fold.take(changes)
        removal = changes[changes["kind"] == DoorRemoved.kind]
        self._write_states(picture.state_changes)
        self._write_lines(picture.placements)
        self._write_curves(picture.probabilities, self._end_of_curve(removal, end))
        for path in self.door.lines.values():
            self._writer.clear(path, removal)
        if self._costmap is not None:
            self._costmap.take(
                self.door.door_id,
                DoorRows(
                    slim(picture.state_changes), self._late(picture.state_changes),
                    picture.placements, self._late(picture.placements), removal,
                ),
            )  # fmt: skip

    def write_style(self, *, doors_beside: int) -> None:
        """Write what holds at all times: label, colours of the states, look of the curves."""
        label = self.door.short_label if doors_beside <= MOST_NAMES else str(self.door.door_id)
        line = rr.LineStrips2D.from_fields(
            radii=rr.Radius.ui_points(LINE_UI_POINTS),
            labels=[label],
            show_labels=doors_beside <= MOST_IDS,
            draw_order=10.0,
        )
        for path in self.door.lines.values():
            self._writer.static(path, line)
        self._writer.static(
            self.door.path,
            rr.StateConfiguration(
                values=STATE_NAMES.tolist(),
                labels=[name.capitalize() for name in STATE_NAMES.tolist()],
                colors=self._colours,
            ),
        )
        if self.door.has_probabilities:
            self._writer.static(
                self.door.path,
                rr.SeriesLines(
                    names=["P(open)", "P(closed)"],
                    colors=self._colours[[DoorState.OPEN, DoorState.CLOSED]],
                    widths=[2.0, 1.0],
                    interpolation_mode="StepAfter",
                ),
            )

    def _write_states(self, changes: Changes) -> None:
        def colours(part: Changes) -> Sequence[Any]:
            return list(rr.LineStrips2D.columns(colors=self._colours[part["state"]]))

        def colours_and_lane(part: Changes) -> Sequence[Any]:
            lane = rr.StateChange.columns(state=STATE_NAMES[part["state"]].tolist())
            return [*colours(part), *lane]

        late = self._late(changes)
        for path in self.door.lines.values():
            columns = colours_and_lane if path == self.door.path else colours
            self._writer.rows(path, changes, columns, late=late)

    def _write_lines(self, placements: Changes) -> None:
        """Write each place as a line on its level, and as no line on the others."""
        placed = placements[np.isfinite(placements["x"]) & np.isfinite(placements["width"])]
        late = self._late(placed)
        for level, path in self.door.lines.items():
            here = placed["level"] == level
            self._writer.rows(path, placed[here], _line, late=late[here])
            self._writer.rows(path, placed[~here], _no_line, late=late[~here])

    def _write_curves(self, given: Changes, end: Changes) -> None:
        """Write the points of the curves, each chunk from the last point of the one before.

        Looking for the neighbours of what it shows, the viewer does not go beyond the chunks that
        reach into its window: a chunk must span the gap, or there would be no line across.
        """
        points = np.concatenate([self._last_point, given])
        if len(points):
            points = np.concatenate([points, end])
        if len(points) > len(self._last_point):
            self._writer.rows(self.door.path, points, _points, late=self._late(points))
            self._last_point = points[-1:]

    def _end_of_curve(self, removal: Changes, end: Edge | None) -> Changes:
        """Return the last probabilities once more, where the door or the recording ends.

        They hold until they are set again; without this, one that was set once would be a dot.
        """
        last: Changes = self._fold.last.copy()
        if len(removal):
            for name in ("number", "folds_ns", "recorded_ns"):
                last[name] = removal[name]
            last["folds_ns"] -= 1  # at the removal itself the door is gone
            return last
        if end is not None and self.door.life.removed == NEVER:
            end.stamp(last)
            return last
        return np.empty(0, CHANGE)

    def _late(self, changes: Changes) -> NDArray[np.bool_]:
        if self.door.has_late_events and len(changes):
            return late_rows(changes)
        return np.zeros(len(changes), np.bool_)


def _line(part: Changes) -> Sequence[Any]:
    return list(rr.LineStrips2D.columns(strips=strips_of(part)))


def _points(part: Changes) -> Sequence[Any]:
    both = np.stack([part["prob_open"], part["prob_closed"]], -1)
    return list(rr.Scalars.columns(scalars=both))


def _no_line(part: Changes) -> Sequence[Any]:
    nothing = rr.LineStrips2D.from_fields(strips=[]).as_component_batches()
    return [batch.partition([0] * len(part)) for batch in nothing]
