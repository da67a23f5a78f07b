"""Write a log as a rerun recording (.rrd), by replay, whole or not at all, in constant memory.

One file holds the data and its layout, so that `rerun x.rrd` opens ready to look at. Two passes: a
quick one finds names, lifetimes and bounds (`find_scene`), the second converts batch by batch.

At a moment of the timeline `happened` it shows what `replay(at=...)` returns, with all that is
known today; of `recorded` what `replay(known_at=...)` returns, as known then: late events from
their recording on, and retracted ones until their retraction; of `event` what `replay(event=...)`
returns. A door bears its name of today along all of them. Beliefs, beyond given probabilities, are
on `happened` alone: see `belief_curves`. A long recording leaves out what no eye would see: see
`scene`.

In the layout, plans and weeks are on the left. On the right are state lanes over the curves of
probabilities, on the same time axis, over text. Rerun calls its blueprint types unstable; so all of
them are used here and nowhere else.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semmap_log.analysis.beliefs.door_beliefs import TypicalWeek
from semmap_log.core.io.disk import atomic_file, check_outside_log, output_errors
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import RobotPose
from semmap_log.views.bounds import Bounds
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import DEFAULT, Palette
from semmap_log.views.rerun import belief_curves, sighting_views
from semmap_log.views.rerun.contents import find_scene
from semmap_log.views.rerun.costmap_pictures import COSTMAP, has_costmap
from semmap_log.views.rerun.drawable import NOTHING, offsets_in
from semmap_log.views.rerun.file import write_recording
from semmap_log.views.rerun.rerun_sdk import rr, rrb
from semmap_log.views.rerun.robot_track import track_paths
from semmap_log.views.rerun.scene import (
    EVENT,
    EVENTS,
    HAPPENED,
    RECORDED,
    ROOT,
    LeftOut,
    Scene,
    SceneDoor,
    SceneLevel,
    entity,
)
from semmap_log.views.rerun.week_pictures import sheet_of, weeks_on, weeks_path

if TYPE_CHECKING:
    from semmap_log.analysis.scans.visit import VisitReader
    from semmap_log.core.model.moments import Time
    from semmap_log.log import DoorLog


LOOK_BACK_NS = 86_400 * 10**9
"""The place of a robot that has reported nothing for longer is unknown."""


@dataclass(frozen=True, slots=True)
class RrdSummary:
    """What was written, and at what cost."""

    events: int
    seconds: float
    bytes: int
    left_out: LeftOut
    """What no eye would see: see `scene`."""
    sightings_left_out: int = 0
    """Visits whose scans are kept but not shown."""
    problems: tuple[str, ...] = ()
    """Errors in reading the scans that are kept next to the log."""


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
            opens at the end): pass it to `open_viewer` or `screenshot`.
        palette: Colours.
        costmap: With the costmap's door layer, cell for cell.
        beliefs: With beliefs about doors of which enough is known: a typical week of each, and a
            curve of those chosen, or of the liveliest.
        scans: Reads the scans that are kept next to the log (`interop`'s `kept_visits`), which get
            a view a door; None: without.
        progress: Called with the progress of reading: (bytes done, bytes in all).

    Raises:
        MissingExtraError: rerun is not installed.
        MomentError: A time cannot be read, or `since` comes after `until`.
        OutputError: The file would lie in the log's own folder, or cannot be written; what was
            there stays.
    """
    check_outside_log(log.path, path)
    started = time.monotonic()
    excerpt = Excerpt.of(log, since, until, doors)
    scene = find_scene(excerpt)
    shown = belief_curves.beliefs_to_show(excerpt, scene, doors) if beliefs else None
    rounds = belief_curves.round_lanes(excerpt, scene)
    sightings = sighting_views.sightings_to_show(scans, excerpt, scene, doors) if scans else None
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
    with output_errors(path), atomic_file(path) as temporary:
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
    """Return the level to show first: that of the first requested door, else the robot's."""
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
    """Return the level where the robot was at a moment; None: unknown."""
    at_ns = log.instant(at)
    assert at_ns is not None
    last_ns, level = -1, None
    since_ns = min(at_ns, max(at_ns - LOOK_BACK_NS, log.horizon_ns()))
    for batch in log.batches(since_ns, at_ns + 1, kinds=[RobotPose]):
        latest = int(np.argmax(batch.folds_ns))
        if batch.folds_ns[latest] >= last_ns:
            last_ns, level = int(batch.folds_ns[latest]), int(batch[RobotPose]["level"][latest])
    return level


MOST_LANES = 16
"""With more doors than this, a tab of the liveliest stands before that of all doors."""

MOST_SIGHTINGS = 6
"""Doors as a laser saw them, on one page."""
MOST_ON_A_PAGE = 100
"""Lanes of all doors come in pages of so many."""
ROUNDS_SHARE, MORE_ROUNDS_SHARE, MOST_ROUNDS_SHARE = 1.1, 0.35, 2.0
"""Height of the first robot's lane of rounds, of each further one, and of all, where all doors
have 3."""

DAY_NS = 86_400 * 10**9
WHOLE_SPAN_NS = 2 * DAY_NS
"""Up to this length lanes and curves show all of it; beyond, a window around the cursor."""
WINDOW_BEFORE_NS = 7 * DAY_NS // 4
WINDOW_AFTER_NS = DAY_NS // 4

SHORTEST_LIVE_NS, LONGEST_LIVE_NS = 10 * 60 * 10**9, DAY_NS // 2
"""What lanes and curves show before the cursor while a log is followed."""
ROOM_AHEAD = 0.04

TRACK_NS = 30 * 60 * 10**9
TRACK_EVENTS = 400
PLAYBACK_SPEED = 600.0
"""Ten minutes a second."""

View = Any
"""Rerun is untyped to us."""


def layout(
    scene: Scene,
    palette: Palette,
    *,
    chosen: Sequence[DoorId] | None,
    level: int | None,
    costmap: bool,
    beliefs: belief_curves.BeliefsShown | None,
    rounds: Sequence[belief_curves.Lane],
    tz: str,
    sightings: sighting_views.SightingsShown | None = None,
    goes_on: bool = False,
) -> Any:
    """Return the blueprint of a recording.

    Args:
        scene: What the recording shows.
        palette: Its colours.
        chosen: Requested doors; None: those that change most get the curves.
        level: The level whose plan is in front, if it has doors; else the one with most.
        costmap: Each level's costmap has a tab after the plans.
        beliefs: Their curves, and a view of typical weeks below the plans; None: there are none.
        rounds: Lanes over those of the doors.
        tz: IANA zone of the times in the event log.
        sightings: Views of doors as a laser saw them, in tabs after the plans; None: there are
            none.
        goes_on: More will come: lanes and curves move along with the cursor.
    """
    axis = _time_axis(scene, goes_on=goes_on)
    plans = _plans(scene, palette, level, costmap=costmap, sightings=sightings)
    left = _column([(plans, 7), (_weeks(scene, palette, level, beliefs), 3)])
    curves = _curves(scene, chosen, beliefs, axis)
    share = min(ROUNDS_SHARE + MORE_ROUNDS_SHARE * (len(rounds) - 1), MOST_ROUNDS_SHARE)
    lanes = [(_rounds(rounds, axis), share), (_lanes(scene, chosen, axis), 3.0)]
    right = _column([*lanes, (curves, 2), (_event_log(scene, tz), 2)])
    return rrb.Blueprint(
        right if left is None else rrb.Horizontal(left, right, column_shares=[4, 3]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline=HAPPENED,
            playback_speed=PLAYBACK_SPEED,
            play_state="following",
        ),
    )


def _column(parts: Sequence[tuple[View | None, float]]) -> View | None:
    """Return the existing views one above the other, each with its share of the height."""
    there = [(view, share) for view, share in parts if view is not None]
    if len(there) < 2:
        return there[0][0] if there else None
    views, shares = zip(*there, strict=True)
    return rrb.Vertical(*views, row_shares=list(shares))


def _plans(
    scene: Scene,
    palette: Palette,
    level: int | None,
    *,
    costmap: bool,
    sightings: sighting_views.SightingsShown | None,
) -> View | None:
    """Return a tab a level; None where nothing has a place."""
    levels = [each for each in scene.levels.values() if not each.is_empty]
    if not levels:
        return None
    busiest = max(levels, key=lambda each: each.doors)
    wanted = next((each for each in levels if each.level == level), busiest)
    front = levels.index(wanted if wanted.doors or not busiest.doors else busiest)
    plans = [_plan(each, scene, palette) for each in levels]
    if costmap:
        plans += [_costmap(each, palette) for each in levels if has_costmap(scene, each)]
    if sightings is not None:
        plans += _sightings(sightings, scene, palette)
    return rrb.Tabs(*plans, active_tab=front)


def _plan(level: SceneLevel, scene: Scene, palette: Palette) -> View:
    paths = track_paths(level, scene) if level.has_robot else []
    overrides = {entity(path): [_recent_track()] for path in paths}
    name = "Floor plan" if level.path == (ROOT,) else level.name
    contents = [f"+ {entity(level.path)}/**"]
    contents += [
        f"- {entity((*level.path, part))}/**" for part in (COSTMAP, sighting_views.SIGHTINGS)
    ]
    return _map_view(level, palette, name, contents, overrides)


def _costmap(level: SceneLevel, palette: Palette) -> View:
    """Return the layer's cells on the floor, without the doors' lines, which would hide them."""
    name = "Costmap" if level.path == (ROOT,) else f"{level.name} costmap"
    parts = [(*level.path, "floor"), (*level.path, COSTMAP)]
    return _map_view(level, palette, name, [f"+ {entity(part)}/**" for part in parts], {})


def _sightings(shown: sighting_views.SightingsShown, scene: Scene, palette: Palette) -> list[View]:
    """Return pages of doors as a laser saw them."""
    views = [_sighting(scene.doors[door_id], shown, palette) for door_id in shown.doors]
    pages = [views[n : n + MOST_SIGHTINGS] for n in range(0, len(views), MOST_SIGHTINGS)]
    if len(pages) == 1:
        return [rrb.Grid(*pages[0], name="Sightings")]
    return [rrb.Grid(*page, name=f"Sightings {n}/{len(pages)}") for n, page in enumerate(pages, 1)]


def _sighting(door: SceneDoor, shown: sighting_views.SightingsShown, palette: Palette) -> View:
    x, y, theta, width = shown.lines[door.door_id]
    middle_x, middle_y = x + width / 2 * math.cos(theta), y + width / 2 * math.sin(theta)
    reach = width / 2 + sighting_views.AROUND_M
    bounds = Bounds(middle_x - reach, middle_y - reach, middle_x + reach, middle_y + reach)
    parts = [(*door.path[:-2], "floor"), sighting_views.sighting_path(door)]
    contents = [f"+ {entity(part)}/**" for part in parts]
    return _bounded_view(bounds, palette, f"{door.label} by laser", contents, {})


def _map_view(
    level: SceneLevel, palette: Palette, name: str, contents: list[str], overrides: dict[str, Any]
) -> View:
    return _bounded_view(level.bounds, palette, name, contents, overrides)


def _bounded_view(
    bounds: Bounds, palette: Palette, name: str, contents: list[str], overrides: dict[str, Any]
) -> View:
    return rrb.Spatial2DView(
        origin="/",
        contents=contents,
        name=name,
        background=[*palette.background, 255],
        # The view's y runs down, and the level is mirrored into it.
        visual_bounds=rrb.VisualBounds2D(
            x_range=[bounds.low_x, bounds.high_x], y_range=[-bounds.high_y, -bounds.low_y]
        ),
        overrides=overrides,
    )


def _recent_track() -> Any:
    """Return the range of segments that make up the track behind the robot."""
    here = rrb.TimeRangeBoundary.cursor_relative()
    back = {
        HAPPENED: rrb.TimeRangeBoundary.cursor_relative(seconds=-TRACK_NS / 1e9),
        RECORDED: rrb.TimeRangeBoundary.cursor_relative(seconds=-TRACK_NS / 1e9),
        EVENT: rrb.TimeRangeBoundary.cursor_relative(seq=-TRACK_EVENTS),
    }
    return rrb.VisibleTimeRanges(
        [rr.VisibleTimeRange(timeline, start=start, end=here) for timeline, start in back.items()]
    )


def _weeks(
    scene: Scene, palette: Palette, front: int | None, beliefs: belief_curves.BeliefsShown | None
) -> View | None:
    """Return a tab of typical weeks a level; None where nothing is known."""
    weeks = [] if beliefs is None else beliefs.weeks
    views = {
        level.level: _week(level, here, scene, palette)
        for level in scene.levels.values()
        if (here := weeks_on(weeks, scene, level))
    }
    if len(views) < 2:
        return next(iter(views.values()), None)
    return rrb.Tabs(*views.values(), active_tab=list(views).index(front) if front in views else 0)


def _week(level: SceneLevel, weeks: Sequence[TypicalWeek], scene: Scene, palette: Palette) -> View:
    sheet = sheet_of(weeks, scene)
    name = "Typical week" if level.path == (ROOT,) else f"{level.name} typical week"
    if level.doors > belief_curves.MOST_WEEKS:
        name += f", {belief_curves.MOST_WEEKS} liveliest"
    return rrb.Spatial2DView(
        origin=entity(weeks_path(level)),
        # The axis of time is in UTC, habits are not.
        name=f"{name} (Monday on top, {weeks[0].tz})",
        background=[*palette.background, 255],
        visual_bounds=rrb.VisualBounds2D(x_range=[0, sheet.width], y_range=[0, sheet.height]),
    )


def _curves(
    scene: Scene,
    chosen: Sequence[DoorId] | None,
    beliefs: belief_curves.BeliefsShown | None,
    axis: Any,
) -> View | None:
    """Return a tab of curves a door; None where no door has probabilities, given or believed."""
    if chosen is None:
        doors = scene.liveliest()
    else:
        doors = [scene.doors[door_id] for door_id in chosen if door_id in scene.doors]
    believed = frozenset() if beliefs is None else beliefs.curves
    drawn = [door for door in doors if door.has_probabilities or door.door_id in believed]
    if not drawn:
        return None
    curves = [_curve(door, axis) for door in drawn[: belief_curves.MOST_CURVES]]
    return rrb.Tabs(*curves, name="Probabilities", active_tab=0)


def _curve(door: SceneDoor, axis: Any) -> View:
    return rrb.TimeSeriesView(
        origin=entity(door.path),
        contents=["$origin/**"],
        name=f"{door.label} (UTC)",
        axis_x=axis,
        axis_y=rrb.ScalarAxis(range=(-0.03, 1.03), zoom_lock=True),
        plot_legend=rrb.PlotLegend(corner="LeftTop"),
    )


def _rounds(rounds: Sequence[belief_curves.Lane], axis: Any) -> View | None:
    if not rounds:
        return None
    return rrb.StateTimelineView(
        origin=f"/{belief_curves.ROUNDS}", name="Rounds (UTC)", time_view=axis
    )


def _lanes(scene: Scene, chosen: Sequence[DoorId] | None, axis: Any) -> View:
    """Return the lanes of all doors; if there are many, the liveliest in a tab before."""
    if not scene.doors:
        return rrb.TextDocumentView(origin=f"/{NOTHING}", name="No doors")
    everything = _lane_view(axis, "Door states (UTC)", [f"+ /{ROOT}/**"])
    if chosen is not None or len(scene.doors) <= MOST_LANES:
        return everything
    few = scene.liveliest()[:MOST_LANES]
    paths = [f"+ {entity(door.path)}" for door in few]
    tabs = [_lane_view(axis, f"{MOST_LANES} liveliest doors (UTC)", paths)]
    tabs += _pages(scene, axis)
    return rrb.Tabs(*tabs, active_tab=0)


def _pages(scene: Scene, axis: Any) -> list[View]:
    """Return views of all doors, level by level, at most so many at once."""
    views = []
    for level in scene.levels.values():
        here = [door for door in scene.doors.values() if door.path[:-2] == level.path]
        pages = [here[i : i + MOST_ON_A_PAGE] for i in range(0, len(here), MOST_ON_A_PAGE)]
        name = "All doors" if level.path == (ROOT,) else f"{level.name} doors"
        for number, page in enumerate(pages, start=1):
            title = name if len(pages) == 1 else f"{name} {number}/{len(pages)}"
            paths = [f"+ {entity(door.path)}" for door in page]
            views.append(_lane_view(axis, f"{title} (UTC)", paths))
    return views


def _lane_view(axis: Any, name: str, contents: list[str]) -> View:
    return rrb.StateTimelineView(origin=f"/{ROOT}", name=name, contents=contents, time_view=axis)


def _time_axis(scene: Scene, *, goes_on: bool) -> Any:
    """Return the axis that lanes and curves share."""
    edge = rrb.TimeRangeBoundary
    if goes_on:
        before_ns = min(max(scene.span_ns, SHORTEST_LIVE_NS), LONGEST_LIVE_NS)
        start = edge.cursor_relative(seconds=-before_ns / 1e9)
        end = edge.cursor_relative(seconds=before_ns / 1e9 * ROOM_AHEAD)
    elif scene.span_ns <= WHOLE_SPAN_NS:
        room_ns = max(scene.span_ns // 50, 10**9)
        start = edge.absolute(time=scene.begin.folds_ns - room_ns)
        end = edge.absolute(time=scene.end.folds_ns + room_ns)
    else:
        start = edge.cursor_relative(seconds=-WINDOW_BEFORE_NS / 1e9)
        end = edge.cursor_relative(seconds=WINDOW_AFTER_NS / 1e9)
    return rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=end))


def _event_log(scene: Scene, tz: str) -> View:
    """Return the event log; its name shows the offset of its times from the axes, which are UTC."""
    offsets = offsets_in(scene, tz)
    here = tz if offsets == [tz] else f"{tz}, {' and '.join(offsets)}"
    return rrb.TextLogView(
        origin=f"/{EVENTS}",
        name=f"Event log ({here})",
        # The time is in the text: a column for it cannot be made wide enough to be read.
        columns=rrb.TextLogColumns(
            timeline_columns=[rrb.encodings.TimelineColumn(HAPPENED, visible=False)],
            # Nor is there room for the level next to who and why; filtering by it needs no column.
            text_log_columns=[rrb.encodings.TextLogColumn("Body")],
        ),
        rows=rrb.TextLogRows(filter_by_log_level=["WARN", "INFO"]),
    )
