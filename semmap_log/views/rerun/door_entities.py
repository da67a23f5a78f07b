"""Doors in a rerun recording: each is one entity with its line, its lane and its curves.

Along `happened` its events count in the order in which they happened, unless they are retracted
today; along `recorded` and `event` as the log learnt of them, until they were retracted.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from semmap_log.core.folds.door_changes import CHANGE, Changes
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.views.excerpt import door_rows
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import Palette, packed
from semmap_log.views.rerun.costmap_doors import DoorRows
from semmap_log.views.rerun.costmap_pictures import CostmapWriter
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.scene import (
    EVENT,
    EVERYWHERE,
    HAPPENED,
    MOST_ROWS,
    RECORDED,
    RowWriter,
    Scene,
    SceneDoor,
    as_recorded,
    rgba,
)

MOST_WAITING_ROWS = 2**18
"""Rows of all doors together, some 20 MB: then every door is written, however few it has."""


class DoorsWriter:
    """Passes each change to its door, and limits how many wait."""

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
            write_style(writer, door, palette, doors_shown=beside)
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
        """Write what is pending; more will come, none of it late."""
        for door in self._plain.values():
            if door.rows_waiting:
                door.write()
        for door_id, pens in self._finished.items():
            if changes := self._others[door_id]:
                for pen in pens:
                    pen.draw(np.concatenate(changes))
                self._others[door_id] = []

    def finish(self) -> None:
        """Write what is pending, and extend the curves to the end."""
        for door in self._plain.values():
            door.write(self._scene.end)
        for door_id, parts in self._others.items():
            changes = np.concatenate([np.empty(0, CHANGE), *parts])
            self._others[door_id] = []
            self._finished[door_id] = self._write_both(self._scene.doors[door_id], changes)

    def _take(self, changes: Changes) -> None:
        for rows in door_rows.by_door(changes):
            door_id = DoorId(int(rows["door_id"][0]))
            if door_id in self._plain:
                self._plain[door_id].take(rows)
            elif door_id in self._others:
                self._others[door_id].append(rows)

    def _opening(self, doors: Iterable[SceneDoor]) -> Changes:
        """Return the plain doors' states when the recording begins amid the log."""
        there = [door.before for door in doors if door.is_plain and door.before is not None]
        return door_rows.opening_changes(there, self._scene.begin)

    def _write_both(self, door: SceneDoor, changes: Changes) -> list[DoorWriter]:
        """Write a door with late or retracted events, whose order is known now."""
        numbers = changes["number"]
        happened = changes[self._excerpt.has_happened(numbers, changes["folds_ns"])]
        opening = door_rows.opening_changes([door.before] if door.before else [], self._scene.begin)
        recorded = changes[self._excerpt.was_recorded(numbers, changes["recorded_ns"])]
        along = [DoorWriter(*self._pens, door, lines) for lines in ([HAPPENED], [RECORDED, EVENT])]
        along[0].draw(
            np.concatenate([opening, door_rows.sorted_by_stamp(happened)]), self._scene.end
        )
        along[1].draw(as_recorded(recorded, door.known), self._scene.end)
        return along


class _PlainDoor:
    """Buffers a door's changes until they fill a chunk, then draws them."""

    def __init__(self, pen: DoorWriter) -> None:
        self._pen = pen
        self._waiting: list[Changes] = []
        self.rows_waiting = 0

    def take(self, changes: Changes) -> None:
        self._waiting.append(changes)
        self.rows_waiting += len(changes)
        if self.rows_waiting >= MOST_ROWS:
            self.write()

    def write(self, end: door_rows.RecordingEdge | None = None) -> None:
        """Draw what is pending; with `end`, it is the last."""
        changes = np.concatenate([np.empty(0, CHANGE), *self._waiting])
        self._waiting, self.rows_waiting = [], 0
        self._pen.draw(changes, end)


MOST_NAMES = 20
"""On a level with more doors their names would lie on each other: there, ids stand for them."""
MOST_IDS = 120
"""With still more, there are no labels; hovering over a door shows who it is."""

LINE_UI_POINTS = 2.5
STATE_NAMES = np.array([state.name for state in DoorState])


class DoorWriter:
    """Turns a door's events into rows and writes them."""

    def __init__(
        self,
        writer: RowWriter,
        palette: Palette,
        costmap: CostmapWriter | None,
        door: SceneDoor,
        timelines: Sequence[str],
    ) -> None:
        self._writer = writer
        self._costmap = costmap
        self._door = door
        self._timelines = timelines
        self._colours = _colours(palette)
        self._fold = door_rows.DoorFold()
        self._last_point: Changes = np.empty(0, CHANGE)

    def draw(self, changes: Changes, end: door_rows.RecordingEdge | None = None) -> None:
        """Draw what the next events do.

        Args:
            changes: In the order in which they count on these timelines; none sets what it does
                not win.
            end: They are the last, and curves go on to there.
        """
        picture = self._fold.take(changes)
        self._write_states(picture.states)
        self._write_lines(picture.placements)
        self._write_curves(picture, end)
        for path in self._door.lines.values():
            self._writer.clear(path, picture.removals, self._timelines, returns=picture.returns)
        if self._costmap is not None:
            rows = DoorRows.of(picture, self._door.shape)
            self._costmap.take(self._door.door_id, rows, self._timelines)

    def _write_states(self, changes: Changes) -> None:
        def colours(part: Changes) -> Sequence[Any]:
            return list(rr.LineStrips2D.columns(colors=self._colours[part["state"]]))

        def colours_and_lane(part: Changes) -> Sequence[Any]:
            lane = rr.StateChange.columns(state=STATE_NAMES[part["state"]].tolist())
            return [*colours(part), *lane]

        for path in self._door.lines.values():
            columns = colours_and_lane if path == self._door.path else colours
            self._writer.rows(path, changes, columns, self._timelines)

    def _write_lines(self, placements: Changes) -> None:
        """Write each place as a line on its level, and as no line on the others."""
        is_placed = np.isfinite(placements["x"]) & np.isfinite(placements["width"])
        for level, path in self._door.lines.items():
            here = placements.copy()
            here["width"][~is_placed | (placements["level"] != level)] = np.nan
            self._writer.rows(path, here, self._lines, self._timelines)

    def _lines(self, part: Changes) -> Sequence[Any]:
        """Return one line, and the place of its name, for each row; none where the width is NaN."""
        drawn = np.isfinite(part["width"])
        each = drawn.astype(np.uint32)
        strips = self._door.shape.strips(part[drawn])
        lines = rr.LineStrips2D.columns(strips=strips).partition(each)
        names = rr.Points2D.columns(positions=strips.mean(axis=1)).partition(each)
        return [*lines, *names]

    def _write_curves(
        self, picture: door_rows.DoorPicture, end: door_rows.RecordingEdge | None
    ) -> None:
        """Write the points of the curves, each chunk from the last point of the one before.

        Looking for the neighbours of what it shows, the viewer does not go beyond the chunks that
        reach into its window: a chunk must span the gap, or there would be no line across.
        """
        ends = self._ends_of_curve(picture.removals, end)
        points = np.concatenate([picture.probabilities, ends])
        if len(ends):
            by_time = "folds_ns" if HAPPENED in self._timelines else "number"
            points = points[np.argsort(points[by_time], kind="stable")]
        points = np.concatenate([self._last_point, points])
        if len(points) > len(self._last_point):
            self._writer.rows(self._door.path, points, _points, self._timelines)
            self._last_point = points[-1:]

    def _ends_of_curve(self, removals: Changes, end: door_rows.RecordingEdge | None) -> Changes:
        """Return the last probabilities again, where the door or the recording ends.

        They hold until they are set again; without this, one that was set once would be a dot.
        """
        ends = removals.copy()
        ends["folds_ns"] -= 1  # at the removal itself the door is gone
        if end is not None and self._fold.is_there:
            last: Changes = self._fold.last.copy()
            end.stamp(last)
            ends = np.concatenate([ends, last])
        has_curve = ~(np.isnan(ends["prob_open"]) & np.isnan(ends["prob_closed"]))
        drawn: Changes = ends[has_curve]
        return drawn


def write_style(writer: RowWriter, door: SceneDoor, palette: Palette, *, doors_shown: int) -> None:
    """Write what holds at all times: label, colours of the states, look of the curves."""
    label = door.short_label if doors_shown <= MOST_NAMES else str(door.door_id)
    line = rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(LINE_UI_POINTS), draw_order=10.0)
    # A label has the colour of what it belongs to. On its grey chip that of a state could not be
    # read in the light theme; so it belongs to a point that is too small to be seen.
    name = rr.Points2D.from_fields(
        radii=0.0,
        colors=packed(palette.label),
        labels=[label],
        show_labels=doors_shown <= MOST_IDS,
        # Below all: with WebGL each thing that is drawn is drawn a little larger than the one
        # below it, half a thousandth, so that lines should come soon after the floor.
        draw_order=-30.0,
    )
    for path in door.lines.values():
        writer.static(path, line, name)
    colours = _colours(palette)
    writer.static(
        door.path,
        rr.StateConfiguration(
            values=STATE_NAMES.tolist(),
            labels=[door.shape.object_class.word(state).capitalize() for state in DoorState],
            colors=colours,
        ),
    )
    if door.has_probabilities:
        writer.static(
            door.path,
            rr.SeriesLines(
                names=["P(open)", "P(closed)"],
                colors=colours[[DoorState.OPEN, DoorState.CLOSED]],
                widths=[2.0, 1.0],
                interpolation_mode="StepAfter",
            ),
        )


def _colours(palette: Palette) -> np.ndarray:
    return rgba([palette.of_state(state) for state in DoorState])


def _points(part: Changes) -> Sequence[Any]:
    both = np.stack([part["prob_open"], part["prob_closed"]], -1)
    return list(rr.Scalars.columns(scalars=both))
