"""What the robot could believe, into a rerun recording: a curve a door, and its typical week.

At each time of the curve counts what had happened by then, with all that is known today; so it
stands on the timeline `happened` alone. What the estimator would have said as of each moment of
recording, late events not there yet and those taken back still there, would have to be learnt anew
behind each of them. The week is as known at the recording's end.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from semmap_log.analysis.beliefs.belief_query import BeliefQuery, ask
from semmap_log.analysis.beliefs.door_beliefs import LATER, default_estimator
from semmap_log.analysis.beliefs.typical_week import TypicalWeek, typical_week
from semmap_log.analysis.probabilities.belief_fold import Beliefs
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import DAY_NS
from semmap_log.views.excerpt.door_rows import NEVER
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.belief_rows import Points, curve, times_of_curve
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.rows import HAPPENED, MOST_ROWS, RowWriter, rgba
from semmap_log.views.rerun.scene import EntityPath, Scene, SceneDoor
from semmap_log.views.rerun.week_pictures import write_weeks

BELIEF = "belief"
NO_MEANS = rr.components.AggregationPolicy.Off
"""Else the viewer draws points that are less than a pixel apart as their mean: half a jump."""
MOST_CURVES = 8
"""Doors with a curve, a tab each; those that were asked for all have one."""
MOST_CURVE_DAYS = 1_000
"""For each day of each curve the estimator learns anew, as it would have then: some seconds. In a
recording of more than four months fewer doors have one."""
MOST_WEEKS = 36
"""On a level with more doors the liveliest have a week: of more, ids would lie on each other."""


@dataclass(frozen=True, slots=True)
class BeliefsShown:
    """What a recording shows of beliefs."""

    curves: Mapping[DoorId, Points]
    """Of doors of which enough was known at some time."""
    weeks: Sequence[TypicalWeek]
    """Of the doors that are in the map at the end and known well enough, ids ascending."""


def beliefs_to_show(
    excerpt: Excerpt, scene: Scene, chosen: Collection[DoorId] | None
) -> BeliefsShown | None:
    """Return what can be shown of beliefs; None: of no door was enough known.

    Args:
        excerpt: The part of the log.
        scene: What it shows.
        chosen: Doors that were asked for: all of them have curves; None: the liveliest have.
    """
    now = ask(excerpt.log, at=None, estimator=default_estimator(), tz=None, doors=None)
    doors = [door for door in scene.liveliest() if chosen is None or door.door_id in chosen]
    most = min(MOST_CURVES, max(1, MOST_CURVE_DAYS // (scene.span_ns // DAY_NS + 1)))
    drawn = doors if chosen is not None else doors[:most]
    curves = dict(_curves(now, drawn, scene))
    habits = now.by(LATER).as_of(scene.end.folds_ns)  # what happens later is not known there
    read = _read_of(doors)
    here = [door for door in habits.doors if door.door_id in read]
    weeks = [week for week in (typical_week(habits, door) for door in here) if week.is_known]
    return BeliefsShown(curves, weeks) if curves or weeks else None


def _read_of(doors: Sequence[SceneDoor]) -> set[DoorId]:
    """Return which doors have a week: the first `MOST_WEEKS` of each level."""
    levels = Counter[EntityPath]()
    chosen = set()
    for door in doors:
        level = door.path[:-2]
        levels[level] += 1
        if levels[level] <= MOST_WEEKS:
            chosen.add(door.door_id)
    return chosen


def _curves(
    now: BeliefQuery, doors: Sequence[SceneDoor], scene: Scene
) -> Iterator[tuple[DoorId, Points]]:
    """Yield the curves of doors of which enough was known at some time."""
    now.beliefs.learnt(max(scene.end.folds_ns, now.known_ns))  # once for all days
    for door in doors:
        points = points_of(now.beliefs, door, scene)
        if len(points):
            yield door.door_id, points


def belief_path(door: SceneDoor) -> EntityPath:
    """Return the entity of a door's curve."""
    return (*door.path, BELIEF)


def write_beliefs(writer: RowWriter, shown: BeliefsShown, scene: Scene, palette: Palette) -> None:
    """Write all curves and weeks."""
    for door_id in sorted(shown.curves):
        door = scene.doors[door_id]
        _write_curve(writer, belief_path(door), shown.curves[door_id], palette)
    write_weeks(writer, shown.weeks, scene)


def points_of(beliefs: Beliefs, door: SceneDoor, scene: Scene) -> Points:
    """Return a door's curve, from when it came into the map until it left."""
    times_ns = times_of_curve(beliefs.evidence.door(door.door_id), *_life(door, scene))
    said = beliefs.predict(door.door_id, times_ns, times_ns)
    return curve(times_ns, said.p_open, said.is_known)


def _life(door: SceneDoor, scene: Scene) -> tuple[int, int]:
    """Return the first and the last moment at which the recording has the door in its map."""
    begin_ns, end_ns = scene.begin.folds_ns, scene.end.folds_ns
    removed_ns = end_ns if door.life.removed == NEVER else door.life.removed[0] - 1
    first_ns = max(begin_ns, door.life.added[0])
    return first_ns, max(first_ns, min(end_ns, removed_ns))


def _write_curve(writer: RowWriter, path: EntityPath, points: Points, palette: Palette) -> None:
    look = rr.SeriesLines(
        names=["believed P(open)"],
        colors=rgba([palette.robot]),
        widths=[1.5],
        aggregation_policy=[NO_MEANS],
    )
    writer.static(path, look)
    # Each chunk begins with the last point of the one before: see `DoorsWriter`.
    for first in range(0, max(len(points) - 1, 1), MOST_ROWS - 1):
        writer.rows(path, points[first : first + MOST_ROWS], _scalars, [HAPPENED])


def _scalars(part: Points) -> Sequence[Any]:
    return list(rr.Scalars.columns(scalars=np.asarray(part["p_open"])))
