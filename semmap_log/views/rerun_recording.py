"""A log as a rerun recording (.rrd): written by replay, whole or not at all, in flat memory.

One file holds the data and its layout, so that `rerun x.rrd` opens ready to look at. Two passes: a
quick one finds names, lifetimes and bounds (`survey`), the second converts batch by batch.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semmap_log.doors import DoorId
from semmap_log.errors import SemmapError
from semmap_log.events import RobotPose
from semmap_log.log.disk import whole_file
from semmap_log.views.door_rows import changes_of
from semmap_log.views.drawable import drawable
from semmap_log.views.event_lines import EventLines
from semmap_log.views.excerpt import Excerpt, instant_ns
from semmap_log.views.palette import DEFAULT, Palette
from semmap_log.views.rerun_blueprint import layout
from semmap_log.views.rerun_doors import DoorsWriter
from semmap_log.views.rerun_events import EventsWriter
from semmap_log.views.rerun_floor import write_floors
from semmap_log.views.rerun_robot import RobotWriter
from semmap_log.views.rerun_rows import RowWriter
from semmap_log.views.rerun_sdk import rr
from semmap_log.views.scene import Scene
from semmap_log.views.survey import survey

if TYPE_CHECKING:
    from semmap_log.door_log import DoorLog, Time

APPLICATION_ID = "semmap_log"
"""Dots and other odd characters would be rewritten by rerun."""

LOOK_BACK_NS = 86_400 * 10**9
"""A robot that has not moved for longer is where nobody knows."""


@dataclass(frozen=True, slots=True)
class RrdSummary:
    """What was written, and what it took."""

    events: int
    seconds: float
    bytes: int


def save_rrd(
    log: DoorLog,
    path: Path,
    *,
    since: Time = None,
    until: Time = None,
    doors: Collection[DoorId] | None = None,
    at: Time = None,
    palette: Palette = DEFAULT,
    progress: Callable[[int, int], None] | None = None,
) -> RrdSummary:
    """Write the log as a recording that the rerun viewer opens, laid out.

    Args:
        log: The log.
        path: The .rrd file; what is there is replaced once the new file is whole.
        since: From then on (happened time); the state before it opens the recording.
        until: Before then.
        doors: Only these doors; the robot and its patrols stay. They get the curves, in this order.
        at: The level where the robot was then is in front. A recording cannot say where its cursor
            stands (it opens at the end): tell `open_viewer` or `screenshot`.
        palette: Colours.
        progress: Told how far the reading is: (bytes done, bytes in all).

    Raises:
        MissingExtraError: rerun is not installed.
        MomentError: A time cannot be read.
        SemmapError: The file cannot be written; what was there stays.
    """
    started = time.monotonic()
    excerpt = Excerpt.of(log, since, until, doors)
    scene = survey(excerpt)
    blueprint = layout(
        scene, palette, chosen=None if doors is None else list(doors), level=_robot_level(log, at)
    )
    try:
        with whole_file(path) as temporary:
            temporary.touch()  # so that a bad path is the system's error, and a clear one
            with _recording(log, temporary, blueprint) as recording:
                _write(excerpt, scene, recording, palette, progress)
            _check_whole(temporary)
    except OSError as error:
        raise SemmapError(f"{path}: cannot be written: {error.strerror or error}.") from None
    return RrdSummary(scene.events, time.monotonic() - started, path.stat().st_size)


def _write(
    excerpt: Excerpt,
    scene: Scene,
    recording: Any,  # noqa: ANN401 - rerun is untyped to us
    palette: Palette,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Convert everything: flat memory, since each part writes as soon as it has a chunk."""
    writer = RowWriter(recording)
    write_floors(writer, scene, palette)
    doors = DoorsWriter(writer, scene, palette)
    robot = RobotWriter(writer, scene, palette)
    events = EventsWriter(writer, EventLines(scene, excerpt.log.commits()), palette)
    for batch in excerpt.batches(progress):
        doors.take(changes_of(batch))
        robot.take(batch)
        events.take(batch)
    for part in (doors, robot, events):
        part.finish()


@contextmanager
def _recording(log: DoorLog, path: Path, blueprint: Any) -> Iterator[Any]:  # noqa: ANN401
    """Open a recording that goes to a file, and close it so that all of it is there."""
    # The log's identity: opening the log again replaces it in a viewer, rather than adding to it.
    recording = rr.RecordingStream(APPLICATION_ID, recording_id=log.info.log_id)
    was_strict = rr.strict_mode()
    rr.set_strict_mode(True)  # else a mistake of ours would be a warning in the middle of the data
    try:
        recording.save(path, default_blueprint=blueprint)
        recording.send_recording_name(drawable(log.path.name))
        yield recording
        recording.flush()
    finally:
        recording.disconnect()
        rr.set_strict_mode(was_strict)


def _check_whole(path: Path) -> None:
    """Raise OSError unless the file ends as it should: rerun only warns when a disk is full."""
    try:
        rr.chunk.RrdReader(path).recordings()
    except Exception as error:
        raise OSError(f"rerun did not write all of it; is the disk full? ({error})") from None


def _robot_level(log: DoorLog, at: Time) -> int | None:
    """Return the level where the robot was at a moment; None: no moment, or no robot."""
    at_ns = instant_ns(log, at)
    if at_ns is None:
        return None
    level = None
    for batch in log.batches(at_ns - LOOK_BACK_NS, at_ns + 1, kinds=[RobotPose]):
        level = int(batch[RobotPose]["level"][np.argmax(batch.folds_ns)])
    return level
