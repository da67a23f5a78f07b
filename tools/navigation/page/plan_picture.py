"""A run on the floor plan: where the robot went, and where it found its way blocked."""

from __future__ import annotations

from typing import Any

import numpy as np

from navigation.page.drawing import BAR, INK, RED, axes, styled
from navigation.records import Outcome
from navigation.runs import Run
from navigation.tables.grouped import title_of
from semmap_log.domain.events import DoorAdded, FloorMap, RobotPose

WALL = (128, 128, 128, 200)
UNKNOWN = (128, 128, 128, 40)


def plan_picture(run: Run) -> Any | None:
    """Return a run as a picture; None: its logs hold no floor plan."""
    floor = _floor(run)
    if floor is None:
        return None
    times_ns, track = _track(run)
    given_up = [g.ended_ns for g in run.goals if g.outcome is Outcome.AFTER_DRIVING]
    stood = _places_at(times_ns, track, np.array(given_up, np.int64))
    with styled():
        high, wide = floor.cells.shape
        figure, ax = axes(5.2, min(7.0, 5.2 * high / wide) + 0.45)
        ends = (0, wide * floor.resolution, 0, high * floor.resolution)
        corner = (floor.origin_x, floor.origin_y)
        extent = [end + corner[place // 2] for place, end in enumerate(ends)]
        ax.imshow(_colours(floor), extent=extent, origin="lower", interpolation="nearest")
        if len(track):
            ax.plot(*_broken(track).T, color=BAR, linewidth=0.5, alpha=0.7, rasterized=True)
        for line in _doors(run):
            ax.plot(*line, color=INK, linewidth=1.6, solid_capstyle="butt")
        ax.plot(*stood.T, "x", color=RED, markersize=6, markeredgewidth=1.6)
        ax.set_axis_off()
        count = len(given_up)
        ax.set_title(f"{title_of(run.key.setup)}, {run.key.series} seed {run.key.seed}: "
                     f"in vain {count} of {len(run.goals)}")  # fmt: skip
    return figure


def _floor(run: Run) -> FloorMap | None:
    for entry in run.belief.history(kinds=[FloorMap]):
        assert isinstance(entry.event, FloorMap)
        return entry.event
    return None


def _colours(floor: FloorMap) -> np.ndarray:
    """Return RGBA: walls grey, free floor clear, so that the page shows through."""
    picture = np.zeros((*floor.cells.shape, 4), np.uint8)
    picture[floor.cells > 50] = WALL
    picture[floor.cells < 0] = UNKNOWN
    return picture


def _doors(run: Run) -> list[np.ndarray]:
    lines = []
    for entry in run.belief.history(kinds=[DoorAdded]):
        door = entry.event
        assert isinstance(door, DoorAdded)
        along = door.width * np.array([np.cos(door.theta), np.sin(door.theta)])
        start = np.array([door.x, door.y])
        lines.append(np.array([start, start + along]).T)
    return lines


def _track(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return when and where the robot was: int64 ns (n,), m (n, 2)."""
    times, places = [np.empty(0, np.int64)], [np.empty((0, 2))]
    for batch in run.belief.batches(kinds=[RobotPose]):
        poses = batch[RobotPose]
        times.append(batch.happened_ns)
        places.append(np.column_stack([poses["x"], poses["y"]]))
    return np.concatenate(times), np.concatenate(places)


def _places_at(times_ns: np.ndarray, track: np.ndarray, at_ns: np.ndarray) -> np.ndarray:
    """Return where the robot was at some times: at its last pose."""
    if not len(track) or not len(at_ns):
        return np.empty((0, 2))
    return track[np.maximum(np.searchsorted(times_ns, at_ns, "right") - 1, 0)]


def _broken(track: np.ndarray) -> np.ndarray:
    """Return the track with gaps where two poses lie too far apart for a drive."""
    far = np.flatnonzero(np.hypot(*np.diff(track, axis=0).T) > 5.0) + 1
    return np.insert(track, far, np.nan, axis=0)
