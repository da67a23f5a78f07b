"""Write one .rrd file, from the first batch to the last.

Rerun writes from a thread of its own. When a write fails, it reports to stderr, and the program may
then wait for it for ever, or go on and leave a file without an end. So rerun gets a pipe, which is
never full, and the bytes go to the disk here, where an error is an error.

The event log is one line of text an event, one entity a kind. Rooms are tints over the floor, under
the walls' grey, with their names.
"""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from semmap_log.analysis.rooms.level_rooms import RoomPlan
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_changes import Changes, door_changes
from semmap_log.core.io.disk import log_name
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.events import KINDS
from semmap_log.views.bounds import rooms_shown
from semmap_log.views.excerpt.span import Excerpt, doors_at_ends
from semmap_log.views.palette import Palette, rooms_image
from semmap_log.views.rerun.belief_curves import BeliefsShown, Lane, write_beliefs, write_rounds
from semmap_log.views.rerun.costmap_pictures import CostmapWriter
from semmap_log.views.rerun.door_entities import DoorsWriter
from semmap_log.views.rerun.drawable import (
    EventLine,
    EventLines,
    drawable,
    drawable_name,
    write_nothing,
)
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.robot_track import RobotWriter, eras_along, since_of, write_floors
from semmap_log.views.rerun.scene import (
    EVENTS,
    MOST_ROWS,
    EntityPath,
    LeftOut,
    RowWriter,
    Scene,
    SceneLevel,
    rgba,
)
from semmap_log.views.rerun.sighting_views import SightingsShown, write_sightings

APPLICATION_ID = "semmap_log"
"""Dots and other odd characters would be rewritten by rerun."""


def write_recording(
    path: Path,
    excerpt: Excerpt,
    *,
    scene: Scene,
    blueprint: Any,
    palette: Palette,
    costmap: bool,
    beliefs: BeliefsShown | None,
    rounds: Sequence[Lane],
    sightings: SightingsShown | None,
    progress: Callable[[int, int], None] | None = None,
) -> LeftOut:
    """Convert the excerpt, batch by batch; each part writes as soon as it has a chunk.

    Raises:
        OSError: The file cannot be written, or not all of it.
    """
    # The log's identity: opening the log again replaces it in a viewer, rather than adding to it.
    recording_id = excerpt.log.info.log_id
    with piped_to(path) as pipe, open_recording(recording_id) as recording:
        recording.save(pipe.inlet, default_blueprint=blueprint)
        converter = Converter(
            recording, excerpt, scene, excerpt.log.commits(),
            palette=palette, costmap=costmap, beliefs=beliefs, rounds=rounds,
        )  # fmt: skip
        for batch in excerpt.batches(progress):
            pipe.check()
            converter.take(batch)
        converter.finish()
        if sightings is not None:
            write_sightings(converter.writer, sightings, excerpt, scene, palette)
            pipe.check()
        recording.flush()
    return converter.left_out


class Converter:
    """Everything that a log has to show, batch by batch, into one recording."""

    def __init__(
        self,
        recording: Any,
        excerpt: Excerpt,
        scene: Scene,
        commits: Iterable[Commit],
        *,
        palette: Palette,
        costmap: bool,
        beliefs: BeliefsShown | None,
        rounds: Sequence[Lane],
    ) -> None:
        """Write what holds at all times.

        Args:
            recording: Rerun's.
            excerpt: The part of the log.
            scene: What its batches will show.
            commits: With the notes of all their events; taken one by one, as events come.
            palette: Colours.
            costmap: With the costmap's door layer.
            beliefs: To be written at the end; None: there are none.
            rounds: What each robot drove for.
        """
        recording.send_recording_name(drawable(log_name(excerpt.log.path)))
        writer = RowWriter(recording, excerpt, scene.commits)
        write_nothing(writer, excerpt, scene)
        write_floors(writer, scene, palette)
        write_rooms(writer, scene, excerpt, palette)
        write_rounds(writer, rounds, palette)
        self._layers = CostmapWriter(writer, scene, palette) if costmap else None
        self._doors = DoorsWriter(writer, excerpt, scene, palette, self._layers)
        self._robot = RobotWriter(writer, scene, palette)
        self._lines = EventLines(scene, excerpt, commits)
        self._events = EventsWriter(writer, self._lines, palette)
        self.writer, self._scene, self._palette, self._beliefs = writer, scene, palette, beliefs

    def take(self, batch: EventBatch) -> None:
        """Take the next events, in order of their numbers."""
        changes = door_changes(batch)
        self.writer.note_commits(batch.number, batch.recorded_ns)
        self._doors.take(changes)
        self._robot.take(batch)
        self._events.take(batch, changes)

    @property
    def left_out(self) -> LeftOut:
        """What no eye would see."""
        return LeftOut(self._lines.left_out, self._robot.left_out)

    def finish(self) -> None:
        """Write what is pending, and extend the curves to the end of the scene."""
        self._doors.finish()
        if self._beliefs is not None:
            write_beliefs(self.writer, self._beliefs, self._scene, self._palette)
        self._write_rest()

    def flush(self) -> None:
        """Write what is pending, after what was finished and in order of time; more may come."""
        self._doors.flush()
        self._write_rest()

    def _write_rest(self) -> None:
        if self._layers is not None:
            self._layers.finish()
        self._robot.finish()
        self._events.finish()


@contextmanager
def open_recording(recording_id: str) -> Iterator[Any]:
    """Open a recording, and close it; whoever wants all of it to arrive flushes it first.

    Args:
        recording_id: A viewer has one recording of an id.
    """
    # No properties but its name: they would include its time, and never be the same twice.
    recording = rr.RecordingStream(APPLICATION_ID, recording_id=recording_id, send_properties=False)
    was_strict = rr.strict_mode()
    rr.set_strict_mode(True)  # else a mistake of ours would be a warning, and missing data
    try:
        yield recording
    finally:
        recording.disconnect()
        rr.set_strict_mode(was_strict)


PIECE_BYTES = 2**20


@contextmanager
def piped_to(path: Path) -> Iterator[PipeToFile]:
    """Provide a pipe whose bytes go to the file; all are written when the block ends.

    Raises:
        OSError: The file cannot be written.
    """
    with path.open("wb") as file:
        pipe = PipeToFile(file)
        try:
            yield pipe
        finally:
            pipe.close()
        pipe.check()


class PipeToFile:
    """Copies a pipe to a file."""

    def __init__(self, file: BinaryIO) -> None:
        self._source, self._sink = os.pipe()
        self._file = file
        self._error: OSError | None = None
        self._thread = threading.Thread(target=self._copy, daemon=True)
        self._thread.start()

    @property
    def inlet(self) -> str:
        """The path to write to."""
        return f"/dev/fd/{self._sink}"

    def check(self) -> None:
        """Raise the OSError with which writing failed, if it did."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Wait for the last byte; the writing end is closed by now."""
        os.close(self._sink)
        self._thread.join()
        os.close(self._source)

    def _copy(self) -> None:
        while piece := os.read(self._source, PIECE_BYTES):
            if self._error is None:  # after an error the rest is drained, so that nobody waits
                try:
                    self._file.write(piece)
                    self._file.flush()
                except OSError as error:
                    self._error = error


LINE = np.dtype([
    ("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"), ("line", "i8")
])  # fmt: skip


class EventsWriter:
    """Buffers each kind's lines until they fill a chunk, then writes them."""

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


ROOMS, ROOM_NAMES = "rooms", "room_names"
"""Last parts of the entities' paths: either can be hidden in the viewer."""
ALPHA = 45
"""Of 255: how much of the dark floor a tint covers."""
MOST_CELLS = 1_000_000


def write_rooms(writer: RowWriter, scene: Scene, excerpt: Excerpt, palette: Palette) -> None:
    """Write the rooms of each level that has some: of each plan as they are at its end."""
    last = rooms_shown(excerpt.log, excerpt.log.replay(at=excerpt.last_ns()))
    for level in scene.levels.values():
        if level.plans.is_one:
            image, names = _pictures(last, level.level, palette)
            for part, shown in ((ROOMS, image), (ROOM_NAMES, names)):
                if shown is not None:
                    writer.static((*level.path, part), *shown)
        else:
            _write_eras(writer, scene, level, excerpt, palette)


def _write_eras(
    writer: RowWriter, scene: Scene, level: SceneLevel, excerpt: Excerpt, palette: Palette
) -> None:
    rooms = {
        era.plan_event: _pictures(rooms_shown(excerpt.log, doors), level.level, palette)
        for era, doors in doors_at_ends(level.plans.happened, excerpt)
    }
    for timelines, eras in eras_along(level):
        for row, era in zip(since_of(eras, scene), eras, strict=True):
            shown = rooms.get(era.plan_event, (None, None))
            for part, pictures in zip((ROOMS, ROOM_NAMES), shown, strict=True):
                if pictures is None:
                    writer.clear((*level.path, part), row, timelines, returns=row[:0])
                else:
                    writer.one((*level.path, part), row, pictures, timelines)


Pictures = Sequence[Any]
"""Archetypes of one entity."""


def _pictures(
    plan: RoomPlan, level: int, palette: Palette
) -> tuple[Pictures | None, Pictures | None]:
    """Return the tints of a level's rooms, and their names; None: there are none."""
    rooms = plan.levels.get(level)
    if rooms is None or not rooms.rooms:
        return None, None
    grid = rooms.geometry
    image = rooms_image(rooms, alpha=ALPHA, most_cells=MOST_CELLS)
    height, width, _ = image.shape
    scale = np.diag([
        grid.width * grid.resolution / width, grid.height * grid.resolution / height, 1.0
    ])  # fmt: skip
    tints = (
        rr.Image(image, draw_order=-19.0),
        rr.Transform3D(translation=[grid.origin_x, grid.origin_y, 0.0], mat3x3=scale),
    )
    named = [
        (room.x, room.y, drawable_name(room.name, f"room {room.room_id}"))
        for room in plan.graph.rooms.values()
        if room.level == level and room.name
    ]
    if not named:
        return tints, None
    points = rr.Points2D(
        [(x, y) for x, y, _ in named],
        labels=[name for _, _, name in named],
        colors=[palette.plain_text] * len(named),
        radii=0.05,
        draw_order=-18.0,
    )
    return tints, (points,)
