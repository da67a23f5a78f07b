"""How the viewer lays out a run."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from navigation.page.run_lanes import DoorLanes, floor_of
from navigation.runs import Run
from navigation.tables.grouped import title_of
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import FloorMap
from semmap_log.views.palette import DEFAULT
from semmap_log.views.rerun.rerun_sdk import rr, rrb
from semmap_log.views.rerun.scene import HAPPENED, entity

MOST_LANES = 20
"""Doors that were wrong for the longest come first; more lanes could not be read."""
LEAST_SEEN = 1000
"""A part of the run as short as this one of so many is narrower than a pixel."""
LANE_SHARE = 0.2
"""Of the height that the lane of goals has."""
TRACK_S = 900.0


def name_of(run: Run) -> str:
    """Return what a run is called in the viewer."""
    key = run.key
    return f"{key.building} {title_of(key.setup)} {key.series} {key.seed}"


def wrong_path(lanes: DoorLanes) -> str:
    """Return the entity of the lane that says when the map had a door wrong."""
    return entity(("wrong", lanes.name))


def layout(run: Run, doors: Mapping[DoorId, DoorLanes]) -> Any:
    """Return the blueprint: the plan on the left, what goes with time on the right."""
    edge = rrb.TimeRangeBoundary
    room_ns = max((run.end_ns - run.begin_ns) // 50, 10**9)
    axis = rrb.TimeAxis(view_range=rr.TimeRange(
        start=edge.absolute(time=run.begin_ns - room_ns),
        end=edge.absolute(time=run.end_ns + room_ns)))  # fmt: skip
    since = edge.cursor_relative(seconds=-TRACK_S)
    recent = rr.VisibleTimeRange(HAPPENED, start=since, end=edge.cursor_relative())
    track = rrb.VisibleTimeRanges([recent])
    plan = rrb.Spatial2DView(
        origin="/", contents=["+ /map/**"], name=name_of(run),
        background=[*DEFAULT.background, 255], overrides={"map/track": [track]},
        visual_bounds=_bounds(doors, floor_of(run)),
    )  # fmt: skip
    right: list[Any] = [rrb.StateTimelineView(origin="/goals", name="Goals", time_view=axis)]
    shares = [1.0]
    if lanes := _longest_wrong(run, doors):
        paths = [f"+ {wrong_path(each)}" for each in lanes]
        name = "Doors that the map had wrong"
        view = rrb.StateTimelineView(origin="/wrong", contents=paths, name=name, time_view=axis)
        right.append(view)
        shares.append(1.0 + LANE_SHARE * len(lanes))
    right.append(rrb.TimeSeriesView(origin="/count", name="Counts", axis_x=axis))
    right.append(rrb.TextLogView(
        origin="/events", name="Goals' ends",
        columns=rrb.TextLogColumns(
            timeline_columns=[rrb.encodings.TimelineColumn(HAPPENED, visible=False)],
            text_log_columns=[rrb.encodings.TextLogColumn("Body")]),
        rows=rrb.TextLogRows(filter_by_log_level=["WARN", "INFO"])))  # fmt: skip
    return rrb.Blueprint(
        rrb.Horizontal(
            plan, rrb.Vertical(*right, row_shares=[*shares, 2, 2]), column_shares=[4, 3]
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed", timeline=HAPPENED, playback_speed=60.0, play_state="following"
        ),
    )


def _longest_wrong(run: Run, doors: Mapping[DoorId, DoorLanes]) -> list[DoorLanes]:
    """Return the doors that the map had wrong for the longest, if it had any.

    One that was wrong for so short that nothing of its lane could be seen has none.
    """
    least_ns = (run.end_ns - run.begin_ns) // LEAST_SEEN
    wrong_ns = {door_id: _wrong_ns(lanes, run.end_ns) for door_id, lanes in doors.items()}
    found = sorted(
        (d for d, ns in wrong_ns.items() if ns > least_ns), key=lambda d: (-wrong_ns[d], d)
    )
    return [doors[door_id] for door_id in found[:MOST_LANES]]


def _wrong_ns(lanes: DoorLanes, end_ns: int) -> int:
    said = [*lanes.wrong(), (end_ns, "")]
    return sum(after_ns - at_ns for (at_ns, words), (after_ns, _) in pairwise(said) if words)


def _bounds(doors: Mapping[DoorId, DoorLanes], floor: FloorMap | None) -> Any:
    """Return what of the plan is looked at: the floor, or where the doors are."""
    if floor is not None:
        known = np.argwhere(floor.cells >= 0)[:, ::-1]
        corner = np.array([floor.origin_x, floor.origin_y])
        points = corner + floor.resolution * known
    else:
        points = np.concatenate([lanes.line for lanes in doors.values()])
    (low_x, low_y), (high_x, high_y) = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    return rrb.VisualBounds2D(x_range=[low_x, high_x], y_range=[-high_y, -low_y])
