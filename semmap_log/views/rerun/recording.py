"""A log as a rerun recording (.rrd): written by replay, whole or not at all, in flat memory.

One file holds the data and its layout, so that `rerun x.rrd` opens ready to look at. Two passes: a
quick one finds names, lifetimes and bounds (`find_scene`), the second converts batch by batch.

At a moment of the timeline `happened` it shows what `replay(at=...)` gives, with all that is known
today; of `recorded` what `replay(known_at=...)` gives, what was known then: late events from when
they were recorded on, and those that were taken back until that was; of `event` what
`replay(event=...)` gives. A door bears the name that it has today, along all of them. What could be
believed of doors, beyond given probabilities, is on `happened` alone: see `beliefs`. A long
recording leaves out what no eye would see: see `thinning`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.core.io.disk import output_errors, refuse_own_folder, whole_file
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import RobotPose
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import DEFAULT, Palette
from semmap_log.views.rerun.contents import find_scene
from semmap_log.views.rerun.scene import LeftOut

if TYPE_CHECKING:
    from semmap_log.analysis.scans.visit import VisitReader
    from semmap_log.log.door_log.door_log import DoorLog, Time
    from semmap_log.views.rerun.scene import Scene

LOOK_BACK_NS = 86_400 * 10**9
"""Where a robot is that has told nothing for longer, nobody knows."""


@dataclass(frozen=True, slots=True)
class RrdSummary:
    """What was written, and what it took."""

    events: int
    seconds: float
    bytes: int
    left_out: LeftOut
    """What no eye would see: see `thinning`."""
    sightings_left_out: int = 0
    """Visits whose scans are kept, and not shown."""
    problems: tuple[str, ...] = ()
    """What could not be read of the scans that are kept beside the log."""


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
    scans: VisitReader | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> RrdSummary:
    """Write the log as a recording that the rerun viewer opens, laid out.

    Args:
        log: The log.
        path: The .rrd file; what is there is replaced once the new file is whole.
        since: From then on along each timeline; the state before it opens the recording.
        until: Before then, along each timeline.
        doors: Only these doors; the robot and its patrols stay. They get the curves, in this order.
        at: The level where the robot was then is in front; None: where it is at the end; with
            `doors` that of the first of them. A recording cannot say where its cursor stands (it
            opens at the end): tell `open_viewer` or `screenshot`.
        palette: Colours.
        costmap: With the costmap's door layer, cell for cell.
        beliefs: With what the robot could believe of doors of which enough is known: a typical
            week of each, and a curve of those chosen, or of the liveliest.
        scans: Reads the scans that are kept beside the log (`interop`'s `kept_visits`), which get
            a view a door; None: without.
        progress: Told how far the reading is: (bytes done, bytes in all).

    Raises:
        MissingExtraError: rerun is not installed.
        MomentError: A time cannot be read, or `since` comes after `until`.
        OutputError: The file would lie in the log's own folder, or cannot be written; what was
            there stays.
    """
    # Here, not above: who only wants the error for a missing rerun gets it by calling.
    from semmap_log.views.rerun.belief_curves import beliefs_to_show, round_lanes
    from semmap_log.views.rerun.blueprint import layout
    from semmap_log.views.rerun.file import write_recording
    from semmap_log.views.rerun.sighting_views import sightings_to_show

    refuse_own_folder(log.path, path)
    started = time.monotonic()
    excerpt = Excerpt.of(log, since, until, doors)
    scene = find_scene(excerpt)
    shown = beliefs_to_show(excerpt, scene, doors) if beliefs else None
    rounds = round_lanes(excerpt, scene)
    sightings = sightings_to_show(scans, excerpt, scene, doors) if scans else None
    blueprint = layout(
        scene,
        palette,
        chosen=None if doors is None else list(doors),
        level=_front_level(log, scene, chosen=doors, at=at),
        costmap=costmap,
        beliefs=shown,
        rounds=rounds,
        tz=log.info.timezone,
        sightings=sightings,
    )
    with output_errors(path), whole_file(path) as temporary:
        left_out = write_recording(
            temporary, excerpt,
            scene=scene, blueprint=blueprint, palette=palette, costmap=costmap,
            beliefs=shown, rounds=rounds, sightings=sightings, progress=progress,
        )  # fmt: skip
    return RrdSummary(
        scene.events, time.monotonic() - started, path.stat().st_size, left_out,
        sightings_left_out=0 if sightings is None else sightings.left_out,
        problems=() if sightings is None else sightings.problems,
    )  # fmt: skip


def _front_level(
    log: DoorLog, scene: Scene, *, chosen: Collection[DoorId] | None, at: Time
) -> int | None:
    """Return the level to look at first: that of the first door asked for, else the robot's."""
    for door_id in chosen or ():
        if door_id in scene.doors:
            levels = [n for n, path in scene.doors[door_id].lines.items()
                      if path == scene.doors[door_id].path]  # fmt: skip
            return levels[0]
    if at is None:
        return scene.robot_level
    level = _robot_level(log, at)
    return scene.home_of_0 if level == 0 else level


def _robot_level(log: DoorLog, at: Time) -> int | None:
    """Return the level where the robot was at a moment; None: nobody knows."""
    at_ns = log.instant(at)
    assert at_ns is not None
    last_ns, level = -1, None
    since_ns = min(at_ns, max(at_ns - LOOK_BACK_NS, log.horizon_ns() + 1))
    for batch in log.batches(since_ns, at_ns + 1, kinds=[RobotPose]):
        latest = int(np.argmax(batch.folds_ns))
        if batch.folds_ns[latest] >= last_ns:
            last_ns, level = int(batch.folds_ns[latest]), int(batch[RobotPose]["level"][latest])
    return level
