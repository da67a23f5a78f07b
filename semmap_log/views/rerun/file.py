"""One .rrd file, from the first batch to the last."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from semmap_log.views.palette import Palette
from semmap_log.views.rerun.beliefs import BeliefsShown, write_beliefs
from semmap_log.views.rerun.costmap import CostmapWriter
from semmap_log.views.rerun.door_rows import changes_of
from semmap_log.views.rerun.doors import DoorsWriter
from semmap_log.views.rerun.drawable import drawable
from semmap_log.views.rerun.event_lines import EventLines
from semmap_log.views.rerun.events import EventsWriter
from semmap_log.views.rerun.excerpt import Excerpt
from semmap_log.views.rerun.floor import write_floors
from semmap_log.views.rerun.pump import pumped
from semmap_log.views.rerun.robot import RobotWriter
from semmap_log.views.rerun.rounds import Lane, write_rounds
from semmap_log.views.rerun.rows import RowWriter
from semmap_log.views.rerun.scene import Scene
from semmap_log.views.rerun.sdk import rr
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
    progress: Callable[[int, int], None] | None = None,
) -> LeftOut:
    """Convert the excerpt, batch by batch; each part writes as soon as it has a chunk.

    Raises:
        OSError: The file cannot be written, or not all of it.
    """
    with pumped(path) as pump, _recording(excerpt, pump.inlet, blueprint) as recording:
        writer = RowWriter(recording, excerpt, scene.commits)
        write_floors(writer, scene, palette)
        write_rounds(writer, rounds, palette)
        layers = CostmapWriter(writer, scene, palette) if costmap else None
        doors = DoorsWriter(writer, excerpt, scene, palette, layers)
        robot = RobotWriter(writer, scene, palette)
        lines = EventLines(scene, excerpt)
        events = EventsWriter(writer, lines, palette)
        for batch in excerpt.batches(progress):
            pump.check()
            changes = changes_of(batch)
            doors.take(changes)
            robot.take(batch)
            events.take(batch, changes)
        doors.finish()
        if layers is not None:
            layers.finish()
        if beliefs is not None:
            write_beliefs(writer, beliefs, scene, palette)
        robot.finish()
        events.finish()
    return LeftOut(lines.left_out, robot.left_out)


@contextmanager
def _recording(excerpt: Excerpt, inlet: str, blueprint: Any) -> Iterator[Any]:
    """Open a recording that goes to a file, and close it so that all of it is there."""
    # The log's identity: opening the log again replaces it in a viewer, rather than adding to it.
    # No properties but its name: they would tell when it was made, and never be the same twice.
    recording = rr.RecordingStream(
        APPLICATION_ID, recording_id=excerpt.log.info.log_id, send_properties=False
    )
    was_strict = rr.strict_mode()
    rr.set_strict_mode(True)  # else a mistake of ours would be a warning, and missing data
    try:
        recording.save(inlet, default_blueprint=blueprint)
        recording.send_recording_name(drawable(excerpt.log.path.resolve().name))
        yield recording
        recording.flush()
    finally:
        recording.disconnect()
        rr.set_strict_mode(was_strict)
