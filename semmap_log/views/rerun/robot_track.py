"""The robot in a rerun recording: an arrow where it is, and the track that it leaves.

Each robot has a track of its own, if the log has several. In a long recording poses that hardly
differ from the ones before are left out: see `scene`. Along `recorded` poses that were retracted
stay where they are. Floor plans are dark pictures under the doors, in metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.renumbering import robots_of_poses
from semmap_log.core.model.events import FloorMap, RobotPose
from semmap_log.views.excerpt.span import PLAN, PlanEra, Stamps
from semmap_log.views.palette import Palette, packed
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.scene import (
    EVENT,
    EVERYWHERE,
    HAPPENED,
    MOST_ROWS,
    RECORDED,
    EntityPath,
    RowWriter,
    Scene,
    SceneLevel,
    drawn_poses,
    is_long,
)

GAP_NS = 600 * 10**9
"""A robot unseen for longer did not drive the straight line between the two poses."""

ARROW_SHARE = 0.03
"""Length of the arrow, as a share of the level's longer side."""
SHORTEST_ARROW_M = 0.6

FAR_M = 1e7
"""Out of every view."""

POSE = np.dtype([
    ("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"),
    ("level", "u2"), ("x", "f8"), ("y", "f8"), ("theta", "f8"),
    ("from_level", "i4"), ("from_ns", "i8"), ("from_x", "f8"), ("from_y", "f8"),
])  # fmt: skip
"""A pose, and the one before it; `from_level` is -1 for the first."""

Poses = NDArray[np.void]


class RobotWriter:
    """Writes the poses of each robot on its own: between two robots nobody drove."""

    def __init__(self, writer: RowWriter, scene: Scene, palette: Palette) -> None:
        self._robots = scene.robots
        self._tracks = [_RobotTrack(writer, scene, palette, name) for name in _named(scene)]

    @property
    def left_out(self) -> int:
        """Poses so far that are not drawn, since others represent them."""
        return sum(track.left_out for track in self._tracks)

    def take(self, batch: EventBatch) -> None:
        """Take the poses of the next batch, in order of their numbers."""
        if RobotPose not in batch:
            return
        poses, of = _poses_of(batch), robots_of_poses(batch, self._robots)
        for place, track in enumerate(self._tracks):
            track.take(poses[of == place])

    def finish(self) -> None:
        """Write what still waits."""
        for track in self._tracks:
            track.finish()


def _named(scene: Scene) -> Sequence[str]:
    """Return the robots' names if there are several; a single one needs none."""
    return scene.robots if len(scene.robots) > 1 else ("",)


class _RobotTrack:
    """Buffers the poses of one robot until they fill a chunk, then writes them."""

    def __init__(self, writer: RowWriter, scene: Scene, palette: Palette, name: str) -> None:
        self._writer = writer
        self._name = name
        self._home_of_0 = scene.home_of_0 or 0
        self._levels = [level for level in scene.levels.values() if level.has_robot]
        self._waiting: list[Poses] = []
        self._rows_waiting = 0
        self._last = np.zeros(1, POSE)
        self._last["level"] = 0
        self._has_last = False
        self._thins = is_long(scene)
        self.left_out = 0
        """Poses so far that are not drawn, since others represent them."""
        for level in self._levels:
            self._write_style(level, palette)
            self._leave_old_plans(level, scene)

    def take(self, poses: Poses) -> None:
        """Take its next poses, in order of their numbers."""
        if len(poses):
            poses["level"][poses["level"] == 0] = self._home_of_0
            self._waiting.append(poses)
            self._rows_waiting += len(poses)
        if self._rows_waiting >= MOST_ROWS:
            self.finish()

    def finish(self) -> None:
        """Write what still waits."""
        if not self._waiting:
            return
        poses = np.concatenate(self._waiting)
        self._waiting, self._rows_waiting = [], 0
        if self._thins:
            telling = drawn_poses(*(poses[n] for n in ("x", "y", "theta", "level", "folds_ns")))
            self.left_out += int(np.count_nonzero(~telling))
            poses = poses[telling]
        self._link(poses)
        for level in self._levels:
            self._write_level(level, poses)

    def _link(self, poses: Poses) -> None:
        """Fill in where each pose came from."""
        before = np.concatenate([self._last, poses[:-1]])
        poses["from_level"], poses["from_ns"] = before["level"], before["folds_ns"]
        poses["from_x"], poses["from_y"] = before["x"], before["y"]
        if not self._has_last:
            poses["from_level"][0] = -1
        self._last, self._has_last = poses[-1:].copy(), True

    def _leave_old_plans(self, level: SceneLevel, scene: Scene) -> None:
        """Hide the robot when another plan comes: its place was reported on the one before."""
        for timelines, eras in eras_along(level):
            for row in since_of(eras, scene)[1:]:
                path = _pose_path(level, self._name)
                self._writer.clear(path, row, timelines, returns=row[:0])
        # The track reaches back in time, so that a cleared one would still show: it goes away.
        tracks = _track_paths(level, self._name)
        for path, era in zip(tracks, level.plans.happened[1:], strict=False):
            self._writer.one(
                path, era.since, [rr.Transform3D(translation=[FAR_M, 0.0, 0.0])], EVERYWHERE
            )

    def _write_style(self, level: SceneLevel, palette: Palette) -> None:
        self._writer.static(
            _pose_path(level, self._name),
            rr.Arrows2D.from_fields(
                colors=packed(palette.robot), radii=rr.Radius.ui_points(3.0), draw_order=8.0
            ),
        )
        for path in _track_paths(level, self._name):
            self._writer.static(
                path,
                rr.LineStrips2D.from_fields(
                    colors=packed(palette.robot, 0x70),
                    radii=rr.Radius.ui_points(1.0),
                    draw_order=5.0,
                ),
            )

    def _write_level(self, level: SceneLevel, poses: Poses) -> None:
        arrow_m = max(SHORTEST_ARROW_M, ARROW_SHARE * level.bounds.longest_side_m)
        here, came_from_here = (poses[name] == level.level for name in ("level", "from_level"))

        def arrows(part: Poses) -> Sequence[Any]:
            return _arrows(part, part["level"] == level.level, arrow_m)

        self._writer.events(_pose_path(level, self._name), poses[here | came_from_here], arrows)
        apart_ns = poses["folds_ns"] - poses["from_ns"]
        drove = here & came_from_here & (apart_ns >= 0) & (apart_ns <= GAP_NS)
        plan, from_plan = (_plan_of(level, poses[name]) for name in ("folds_ns", "from_ns"))
        for place, path in enumerate(_track_paths(level, self._name)):
            on_it = drove & (plan == place) & (from_plan == place)
            self._writer.events(path, poses[on_it], _segments)


def _plan_of(level: SceneLevel, folds_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return on which of a level's plans each time is: between two of them nobody drove."""
    begins = [int(era.since["folds_ns"][0]) for era in level.plans.happened[1:]]
    which: NDArray[np.int64] = np.searchsorted(begins, folds_ns, "right")
    return which


def track_paths(level: SceneLevel, scene: Scene) -> list[EntityPath]:
    """Return the entities of the robots' tracks on a level."""
    return [path for name in _named(scene) for path in _track_paths(level, name)]


def _track_paths(level: SceneLevel, name: str) -> list[EntityPath]:
    """Return the entity of the track on each of a level's plans, or the one for all times."""
    path = (*_robot_path(level, name), "track")
    if len(level.plans.happened) < 2:
        return [path]
    return [(*path, f"plan {era.plan_event}") for era in level.plans.happened]


def _pose_path(level: SceneLevel, name: str) -> EntityPath:
    return (*_robot_path(level, name), "pose")


def _robot_path(level: SceneLevel, name: str) -> EntityPath:
    return (*level.path, "robot", name) if name else (*level.path, "robot")


def _poses_of(batch: EventBatch) -> Poses:
    where, rows = batch.where(RobotPose), batch[RobotPose]
    poses = np.zeros(len(where), POSE)
    poses["number"] = batch.number[where]
    poses["folds_ns"] = batch.folds_ns[where]
    poses["recorded_ns"] = batch.recorded_ns[where]
    for name in ("level", "x", "y", "theta"):
        poses[name] = rows[name]
    return poses


def _arrows(poses: Poses, shows: NDArray[np.bool_], length_m: float) -> Sequence[Any]:
    """Return an arrow for each row that shows one; other rows remove it."""
    shown = poses[shows]
    heading = np.stack([np.cos(shown["theta"]), np.sin(shown["theta"])], -1) * length_m
    # The arrow stands on the robot, not before it.
    origins = np.stack([shown["x"], shown["y"]], -1) - heading / 2
    with np.errstate(over="ignore"):  # as in `strips_of`
        columns = rr.Arrows2D.columns(
            origins=origins.astype(np.float32), vectors=heading.astype(np.float32)
        )
    return list(columns.partition(shows.astype(np.uint32)))


def _segments(poses: Poses) -> Sequence[Any]:
    ends = [np.stack([poses[f"{side}x"], poses[f"{side}y"]], -1) for side in ("from_", "")]
    with np.errstate(over="ignore"):
        return list(rr.LineStrips2D.columns(strips=np.stack(ends, 1).astype(np.float32)))


FLOOR = "floor"
"""Last part of the entity's path."""


def write_floors(writer: RowWriter, scene: Scene, palette: Palette) -> None:
    """Write each level's plans and the mirror that turns our y up into the view's y down."""
    for level in scene.levels.values():
        writer.static(level.path, rr.Transform3D(scale=[1.0, -1.0, 1.0]))
        if not level.plans.is_one:
            _write_plans(writer, scene, level, palette)
        elif level.floor is not None:
            writer.static((*level.path, FLOOR), *_drawn(level.floor, palette))


def eras_along(level: SceneLevel) -> list[tuple[Sequence[str], Sequence[PlanEra]]]:
    """Return a level's plans along each timeline."""
    return [([HAPPENED], level.plans.happened), ([RECORDED, EVENT], level.plans.recorded)]


def since_of(eras: Sequence[PlanEra], scene: Scene) -> list[Stamps]:
    """Return when each plan begins to show, a row of `PLAN` each: the first from the start."""
    begin = np.array([(scene.begin.number, scene.begin.folds_ns, scene.begin.recorded_ns)], PLAN)
    return [begin, *(era.since for era in eras[1:])][: len(eras)]


def _write_plans(writer: RowWriter, scene: Scene, level: SceneLevel, palette: Palette) -> None:
    """Write plans one after the other: each shows until the next."""
    path = (*level.path, FLOOR)
    for timelines, eras in eras_along(level):
        for row, era in zip(since_of(eras, scene), eras, strict=True):
            if era.floor is None:
                writer.clear(path, row, timelines, returns=row[:0])
            else:
                writer.one(path, row, _drawn(era.floor, palette), timelines)


def _drawn(floor: FloorMap, palette: Palette) -> Sequence[Any]:
    return (
        rr.Image(picture_of(floor.cells, palette), draw_order=-20.0),
        rr.Transform3D(
            translation=[floor.origin_x, floor.origin_y, 0.0], mat3x3=_turned_cell(floor)
        ),
    )


def _turned_cell(floor: FloorMap) -> NDArray[np.float64]:
    cos, sin = math.cos(floor.origin_theta), math.sin(floor.origin_theta)
    return floor.resolution * np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def picture_of(cells: NDArray[np.int8], palette: Palette) -> NDArray[np.uint8]:
    """Return the cells as colours, uint8 (rows, columns, RGB), row 0 = lowest y."""
    return _shades(palette)[cells.view(np.uint8)]


def _shades(palette: Palette) -> NDArray[np.uint8]:
    """Return a colour for each of the 256 bytes: -1 unknown, 0 free .. 100 occupied."""
    share = np.linspace(0.0, 1.0, 101)[:, None]
    shades = np.tile(np.array(palette.background, np.float64), (256, 1))
    floor, wall = (np.array(colour, np.float64) for colour in (palette.floor, palette.wall))
    shades[:101] = floor + share * (wall - floor)
    return np.round(shades).astype(np.uint8)
