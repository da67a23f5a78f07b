"""One .rrd file, from the first batch to the last."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from semmap_log.views.door_rows import changes_of
from semmap_log.views.drawable import drawable
from semmap_log.views.event_lines import EventLines
from semmap_log.views.excerpt import Excerpt
from semmap_log.views.palette import Palette
from semmap_log.views.rerun_doors import DoorsWriter
from semmap_log.views.rerun_events import EventsWriter
from semmap_log.views.rerun_floor import write_floors
from semmap_log.views.rerun_robot import RobotWriter
from semmap_log.views.rerun_rows import RowWriter
from semmap_log.views.rerun_sdk import rr
from semmap_log.views.scene import Scene

APPLICATION_ID = "semmap_log"
"""Dots and other odd characters would be rewritten by rerun."""

END_MARK = b"RRF2FOOT"
"""In the last bytes of every whole file of rerun 0.41."""


def write_recording(
    excerpt: Excerpt,
    scene: Scene,
    path: Path,
    blueprint: Any,
    palette: Palette,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Convert the excerpt, batch by batch; each part writes as soon as it has a chunk.

    Raises:
        OSError: The file cannot be written, or not all of it.
    """
    path.touch()  # a bad path is the system's error, and a clear one
    with _recording(excerpt, path, blueprint) as recording:
        writer = RowWriter(recording)
        write_floors(writer, scene, palette)
        doors = DoorsWriter(writer, scene, palette)
        robot = RobotWriter(writer, scene, palette)
        events = EventsWriter(writer, EventLines(scene, excerpt.log.commits()), palette)
        for batch in excerpt.batches(progress):
            doors.take(changes_of(batch))
            robot.take(batch)
            events.take(batch)
        doors.finish()
        robot.finish()
        events.finish()
    _check_whole(path)


@contextmanager
def _recording(excerpt: Excerpt, path: Path, blueprint: Any) -> Iterator[Any]:
    """Open a recording that goes to a file, and close it so that all of it is there."""
    # The log's identity: opening the log again replaces it in a viewer, rather than adding to it.
    recording = rr.RecordingStream(APPLICATION_ID, recording_id=excerpt.log.info.log_id)
    was_strict = rr.strict_mode()
    rr.set_strict_mode(True)  # else a mistake of ours would be a warning, and missing data
    try:
        recording.save(path, default_blueprint=blueprint)
        recording.send_recording_name(drawable(excerpt.log.path.resolve().name))
        yield recording
        try:
            recording.flush()
        except RuntimeError as error:  # its writing thread has ended, and told stderr why
            raise OSError(f"is the disk full? (rerun: {error})") from None
    finally:
        recording.disconnect()
        rr.set_strict_mode(was_strict)


def _check_whole(path: Path) -> None:
    """Raise OSError unless the file has its end: rerun does not tell when that did not fit."""
    with path.open("rb") as file:
        file.seek(-min(64, path.stat().st_size), 2)
        if END_MARK not in file.read():
            raise OSError("is the disk full? (the end of the file is missing)")
