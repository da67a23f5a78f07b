"""One .rrd file, from the first batch to the last."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_changes import door_changes
from semmap_log.core.io.disk import log_name
from semmap_log.core.model.commits import Commit
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.belief_curves import BeliefsShown, write_beliefs
from semmap_log.views.rerun.costmap_pictures import CostmapWriter
from semmap_log.views.rerun.door_entities import DoorsWriter
from semmap_log.views.rerun.drawable import drawable
from semmap_log.views.rerun.event_markers import EventsWriter
from semmap_log.views.rerun.floor import write_floors
from semmap_log.views.rerun.log_lines import EventLines
from semmap_log.views.rerun.nothing import write_nothing
from semmap_log.views.rerun.pipe_to_file import piped_to
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.robot_track import RobotWriter
from semmap_log.views.rerun.room_pictures import write_rooms
from semmap_log.views.rerun.round_lanes import Lane, write_rounds
from semmap_log.views.rerun.rows import RowWriter
from semmap_log.views.rerun.scene import Scene
from semmap_log.views.rerun.sighting_views import SightingsShown, write_sightings
from semmap_log.views.rerun.thinning import LeftOut

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
        """Write what still waits, and let curves go on to the end of the scene."""
        self._doors.finish()
        if self._beliefs is not None:
            write_beliefs(self.writer, self._beliefs, self._scene, self._palette)
        self._write_rest()

    def flush(self) -> None:
        """Write what waits, though more will come: behind what was finished, in order of time."""
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
    # No properties but its name: they would tell when it was made, and never be the same twice.
    recording = rr.RecordingStream(APPLICATION_ID, recording_id=recording_id, send_properties=False)
    was_strict = rr.strict_mode()
    rr.set_strict_mode(True)  # else a mistake of ours would be a warning, and missing data
    try:
        yield recording
    finally:
        recording.disconnect()
        rr.set_strict_mode(was_strict)
