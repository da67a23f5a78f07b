"""Whether what comes can be shown behind what is shown already."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import (
    SETTING_KINDS,
    DoorAnnotated,
    Event,
    FloorMap,
    LevelAdded,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
)
from semmap_log.core.model.meaning import Changed, Presence
from semmap_log.views.bounds import Bounds
from semmap_log.views.excerpt.floor_plans import NO_PLANS
from semmap_log.views.rerun.contents import RecordingContents
from semmap_log.views.rerun.scene import Scene, SceneDoor, SceneLevel

NEVER_FIT = (Retracted, LevelAdded, FloorMap, PatrolStarted, PatrolFinished)
MAY_CHANGE_THE_SCENE: tuple[type[Event], ...] = (
    DoorAnnotated,
    *(
        kind
        for kind in SETTING_KINDS
        if kind.effect.presence is not Presence.STAYS or kind.effect.can_set & ~Changed.STATE
    ),
)

ROOM = 0.25
"""Added on each side of a plan that was outgrown, as a share of its longer side: a robot that
explores should not outgrow it again at once."""


def fits(batch: EventBatch, contents: RecordingContents, scene: Scene) -> bool:
    """Tell whether the next events can be shown as more rows of a scene; the contents take them in.

    Args:
        batch: The next events.
        contents: Of all that came before.
        scene: What is shown of that.
    """
    if any(kind in batch for kind in NEVER_FIT) or contents.is_late(batch):
        return False
    contents.take(batch)
    if any(kind in batch for kind in MAY_CHANGE_THE_SCENE):
        return _look(scene) == _look(contents.scene()) and _is_inside(contents.scene(), scene)
    return RobotPose not in batch or _is_robot_inside(batch, scene)


def with_room(scene: Scene) -> Scene:
    """Return the scene with room around plans that have no walls to say where they end."""
    levels = {
        n: level if level.floor is not None else replace(level, bounds=_grown(level.bounds))
        for n, level in scene.levels.items()
    }
    return replace(scene, levels=levels)


def _look(scene: Scene) -> tuple[list[SceneDoor], list[SceneLevel], int | None]:
    """Return all of a scene that is drawn once; not how much happened, nor how far it reaches."""
    doors = [replace(door, state_changes=0) for door in scene.doors.values()]
    levels = [
        replace(level, floor=None, plans=NO_PLANS, bounds=Bounds())
        for level in scene.levels.values()
    ]
    return doors, levels, scene.home_of_0


def _is_inside(inner: Scene, outer: Scene) -> bool:
    return all(
        outer.levels[n].bounds.holds(level.bounds.without_margin())
        for n, level in inner.levels.items()
    )


def _is_robot_inside(batch: EventBatch, scene: Scene) -> bool:
    poses = batch[RobotPose]
    for n in np.unique(poses["level"]).tolist():
        shown = scene.home_of_0 if n == 0 else n
        if shown is None:
            continue
        level = scene.levels.get(shown)
        here = poses[poses["level"] == n]
        if level is None or not level.has_robot:
            return False
        if not level.bounds.holds(Bounds().around(here["x"], here["y"])):
            return False
    return True


def _grown(bounds: Bounds) -> Bounds:
    more = ROOM * bounds.longest_side_m
    return Bounds(
        bounds.low_x - more, bounds.low_y - more, bounds.high_x + more, bounds.high_y + more
    )
