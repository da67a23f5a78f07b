"""A log as a rerun recording (.rrd): written by replay, whole or not at all, in flat memory.

One file holds the data and its layout, so that `rerun x.rrd` opens ready to look at. Two passes: a
quick one finds names, lifetimes and bounds (`survey`), the second converts batch by batch.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.doors import DoorId
from semmap_log.errors import SemmapError
from semmap_log.events import RobotPose
from semmap_log.log.disk import whole_file
from semmap_log.views.palette import DEFAULT, Palette
from semmap_log.views.rerun.excerpt import Excerpt, instant_ns
from semmap_log.views.rerun.survey import survey

if TYPE_CHECKING:
    from semmap_log.door_log import DoorLog, Time

LOOK_BACK_NS = 86_400 * 10**9
"""Where a robot is that has told nothing for longer, nobody knows."""


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
    costmap: bool = True,
    beliefs: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> RrdSummary:
    """Write the log as a recording that the rerun viewer opens, laid out.

    Args:
        log: The log.
        path: The .rrd file; what is there is replaced once the new file is whole.
        since: From then on (happened time); the state before it opens the recording.
        until: Before then.
        doors: Only these doors; the robot and its patrols stay. They get the curves, in this order.
        at: The level where the robot was then is in front; None: where it is at the end. A
            recording cannot say where its cursor stands (it opens at the end): tell `open_viewer`
            or `screenshot`.
        palette: Colours.
        costmap: With the costmap's door layer, cell for cell.
        beliefs: With what the robot could believe of doors of which enough is known: a typical
            week of each, and a curve of those chosen, or of the liveliest.
        progress: Told how far the reading is: (bytes done, bytes in all).

    Raises:
        MissingExtraError: rerun is not installed.
        MomentError: A time cannot be read.
        SemmapError: The file cannot be written; what was there stays.
    """
    # Here, not above: who only wants the error for a missing rerun gets it by calling.
    from semmap_log.views.rerun.beliefs import beliefs_to_show
    from semmap_log.views.rerun.blueprint import layout
    from semmap_log.views.rerun.file import write_recording

    started = time.monotonic()
    excerpt = Excerpt.of(log, since, until, doors)
    scene = survey(excerpt)
    shown = beliefs_to_show(excerpt, scene, doors) if beliefs else None
    front = scene.robot_level if at is None else _robot_level(log, at)
    blueprint = layout(
        scene,
        palette,
        chosen=None if doors is None else list(doors),
        level=front,
        costmap=costmap,
        beliefs=shown,
    )
    try:
        with whole_file(path) as temporary:
            write_recording(
                temporary, excerpt,
                scene=scene, blueprint=blueprint, palette=palette, costmap=costmap,
                beliefs=shown, progress=progress,
            )  # fmt: skip
    except OSError as error:
        raise SemmapError(f"{path}: cannot be written: {error.strerror or error}.") from None
    return RrdSummary(scene.events, time.monotonic() - started, path.stat().st_size)


def _robot_level(log: DoorLog, at: Time) -> int | None:
    """Return the level where the robot was at a moment; None: nobody knows."""
    at_ns = instant_ns(log, at)
    assert at_ns is not None
    last_ns, level = -1, None
    for batch in log.batches(max(at_ns - LOOK_BACK_NS, 0), at_ns + 1, kinds=[RobotPose]):
        latest = int(np.argmax(batch.folds_ns))
        if batch.folds_ns[latest] >= last_ns:
            last_ns, level = int(batch.folds_ns[latest]), int(batch[RobotPose]["level"][latest])
    return level
