"""A run on the floor plan: where the robot went, and where it found its way blocked."""

from __future__ import annotations

from typing import Any

import numpy as np

from navigation.page.drawing import BAR, INK, RED, axes, styled
from navigation.page.run_lanes import door_lanes, floor_of, places_at, track_of
from navigation.records import Outcome
from navigation.runs import Run
from navigation.tables.grouped import title_of
from semmap_log.core.model.events import FloorMap

WALL = (128, 128, 128, 200)
UNKNOWN = (128, 128, 128, 40)


def plan_picture(run: Run) -> Any | None:
    """Return a run as a picture; None: its logs hold no floor plan."""
    floor = floor_of(run)
    if floor is None:
        return None
    times_ns, poses = track_of(run)
    track = poses[:, :2]
    given_up = [g.ended_ns for g in run.goals if g.outcome is Outcome.AFTER_DRIVING]
    stood = places_at(times_ns, poses, np.array(given_up, np.int64))
    with styled():
        high, wide = floor.cells.shape
        figure, ax = axes(4.4, min(6.0, 4.4 * high / wide) + 0.4)
        ends = (0, wide * floor.resolution, 0, high * floor.resolution)
        corner = (floor.origin_x, floor.origin_y)
        extent = [end + corner[place // 2] for place, end in enumerate(ends)]
        ax.imshow(_colours(floor), extent=extent, origin="lower", interpolation="nearest")
        if len(track):
            ax.plot(*_broken(track).T, color=BAR, linewidth=0.5, alpha=0.7, rasterized=True)
        for door in door_lanes(run).values():
            ax.plot(*door.line.T, color=INK, linewidth=1.6, solid_capstyle="butt")
        ax.plot(*stood.T, "x", color=RED, markersize=6, markeredgewidth=1.6)
        ax.set_axis_off()
        count = len(given_up)
        ax.set_title(f"{title_of(run.key.setup)}, {run.key.series} seed {run.key.seed}: "
                     f"in vain {count} of {len(run.goals)}")  # fmt: skip
    return figure


def _colours(floor: FloorMap) -> np.ndarray:
    """Return RGBA: walls grey, free floor clear, so that the page shows through."""
    picture = np.zeros((*floor.cells.shape, 4), np.uint8)
    picture[floor.cells > 50] = WALL
    picture[floor.cells < 0] = UNKNOWN
    return picture


def _broken(track: np.ndarray) -> np.ndarray:
    """Return the track with gaps where two poses lie too far apart for a drive."""
    far = np.flatnonzero(np.hypot(*np.diff(track, axis=0).T) > 5.0) + 1
    return np.insert(track, far, np.nan, axis=0)
