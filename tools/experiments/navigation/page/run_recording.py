"""A run for rerun's viewer: the plan, doors as they were and as the map had them, robot and goals.

A door is two strokes: the wide one is the world, the narrow one on it what the map said. A disc
stands under a door that the map has wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from navigation.page.run_lanes import DoorLanes, door_lanes, floor_of, track_of
from navigation.page.run_layout import layout, name_of, wrong_path
from navigation.records import Outcome
from navigation.runs import Goal, Run, second_of
from navigation.tables.grouped import has_map
from semmap_log.core.folds.timeline import Timeline
from semmap_log.core.io.disk import atomic_file, output_errors
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import FloorMap
from semmap_log.views.palette import DEFAULT, Rgb, packed
from semmap_log.views.rerun.file import open_recording
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.robot_track import picture_of
from semmap_log.views.rerun.scene import HAPPENED, entity, rgba

WRONG: Rgb = (0xFF, 0x4F, 0xD8)
OF_OUTCOME: Mapping[Outcome, Rgb] = {
    Outcome.REACHED: DEFAULT.open,
    Outcome.REJECTED: DEFAULT.unknown,
    Outcome.AFTER_DRIVING: DEFAULT.closed,
    Outcome.UNFINISHED: DEFAULT.plain_text,
}
STROKES = {"world": 5.0, "belief": 2.0}
"""Their width, in points of the screen."""
SHORTEST_ARROW_M, ARROW_SHARE = 1.0, 0.04
"""Of the robot, as a share of how far it went."""
DISC_M = 0.8
MOST_ROWS = 4096


def write_recording(run: Run, path: Path) -> None:
    """Write a run as a recording that opens laid out.

    Args:
        run: The run.
        path: The .rrd file; what is there is replaced once the new file is whole.

    Raises:
        MissingExtraError: rerun is not installed.
        OutputError: It cannot be written.
    """
    doors = door_lanes(run) if has_map(run.key.setup) else _without_map(run)
    with (
        output_errors(path),
        atomic_file(path) as temporary,
        open_recording(run.belief.info.log_id) as recording,
    ):
        recording.save(temporary, default_blueprint=layout(run, doors))
        recording.send_recording_name(name_of(run))
        writer = _Writer(recording)
        _write_floor(writer, floor_of(run))
        for lanes in doors.values():
            _write_door(writer, lanes, told=has_map(run.key.setup))
        _write_robot(writer, run)
        _write_goals(writer, run.goals)
        _write_counts(writer, run, doors)
        recording.flush()


class _Writer:
    """Sends rows along the one timeline that there is."""

    def __init__(self, recording: Any) -> None:
        self._recording = recording

    def static(self, path: str, *archetypes: Any) -> None:
        """Write what holds at all times."""
        self._recording.log(path, *archetypes, static=True, strict=True)

    def rows(self, path: str, times_ns: Sequence[int] | np.ndarray, columns: Any) -> None:
        """Write a row of components for each time, in chunks that the viewer likes."""
        times = np.asarray(times_ns, np.int64).astype("M8[ns]")
        if len(times):
            index = rr.TimeColumn(HAPPENED, timestamp=times)
            self._recording.send_columns(path, indexes=[index], columns=columns, strict=True)


def _without_map(run: Run) -> Mapping[DoorId, DoorLanes]:
    """Return the doors of a robot that has no map of them: nothing is believed, nothing wrong."""
    return {
        door_id: DoorLanes(lanes.door, lanes.world, lanes.world)
        for door_id, lanes in door_lanes(run).items()
    }


def _write_floor(writer: _Writer, floor: FloorMap | None) -> None:
    writer.static("map", rr.Transform3D(scale=[1.0, -1.0, 1.0]))
    if floor is not None:
        size = floor.resolution * np.eye(3)
        size[2, 2] = 1.0
        writer.static(
            "map/floor",
            rr.Image(picture_of(floor.cells, DEFAULT), draw_order=-20.0),
            rr.Transform3D(translation=[floor.origin_x, floor.origin_y, 0.0], mat3x3=size),
        )


def _write_door(writer: _Writer, lanes: DoorLanes, *, told: bool) -> None:
    door_id = lanes.door.door_id
    world, belief = f"map/world/{door_id}", f"map/belief/{door_id}"
    _write_strokes(writer, world, lanes.line, lanes.world, order=8.0)
    if not told:
        return
    _write_strokes(writer, belief, lanes.line, lanes.belief, order=10.0)
    wrong = lanes.wrong()
    times = [at_ns for at_ns, _ in wrong]
    shown = np.array([bool(words) for _, words in wrong])
    disc = f"map/wrong/{door_id}"
    writer.static(disc, rr.Points2D.from_fields(radii=DISC_M, colors=packed(WRONG), draw_order=2.0))
    places = np.repeat(lanes.line.mean(axis=0)[None], int(shown.sum()), axis=0)
    columns = rr.Points2D.columns(positions=places.astype(np.float32))
    writer.rows(disc, times, list(columns.partition(shown.astype(np.uint32))))
    said = sorted({words for _, words in wrong} - {""})
    colours = rgba([WRONG] * len(said))
    lane = wrong_path(lanes)
    writer.static(lane, rr.StateConfiguration(values=said, labels=said, colors=colours))
    writer.rows(lane, times, list(rr.StateChange.columns(state=[words for _, words in wrong])))


def _write_strokes(
    writer: _Writer, path: str, line: np.ndarray, lane: Timeline, *, order: float
) -> None:
    points = STROKES[path.split("/")[1]]
    writer.static(
        path,
        rr.LineStrips2D.from_fields(
            strips=[line], radii=rr.Radius.ui_points(points), draw_order=order
        ),
    )
    colours = np.array([packed(DEFAULT.of_state(DoorState(s))) for s in lane.state], np.uint32)
    writer.rows(path, lane.start_ns, list(rr.LineStrips2D.columns(colors=colours)))


def _write_robot(writer: _Writer, run: Run) -> None:
    times_ns, poses = track_of(run)
    wide, narrow = rr.Radius.ui_points(3.0), rr.Radius.ui_points(1.0)
    arrow = rr.Arrows2D.from_fields(colors=packed(DEFAULT.robot), radii=wide, draw_order=20.0)
    faint = packed(DEFAULT.robot, 0x70)
    writer.static("map/robot", arrow)
    writer.static(
        "map/track", rr.LineStrips2D.from_fields(colors=faint, radii=narrow, draw_order=5.0)
    )
    reach_m = float(np.ptp(poses[:, :2], axis=0).max()) if len(poses) else 0.0
    arrow_m = max(SHORTEST_ARROW_M, ARROW_SHARE * reach_m)
    heading = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], -1) * arrow_m
    steps = np.stack([poses[:-1, :2], poses[1:, :2]], 1).astype(np.float32)
    for first in range(0, len(times_ns), MOST_ROWS):
        part = slice(first, first + MOST_ROWS)
        arrows = rr.Arrows2D.columns(
            origins=(poses[part, :2] - heading[part] / 2).astype(np.float32),
            vectors=heading[part].astype(np.float32),
        )
        writer.rows("map/robot", times_ns[part], list(arrows))
        later = times_ns[1:][part]
        writer.rows("map/track", later, list(rr.LineStrips2D.columns(strips=steps[part])))


def _write_goals(writer: _Writer, goals: Sequence[Goal]) -> None:
    """Write where the robot is sent, in the colour of what comes of it, and a lane of it."""
    times = [goal.sent_ns for goal in goals]
    colours = np.array([packed(OF_OUTCOME[goal.outcome]) for goal in goals], np.uint32)
    places = np.array([(goal.x, goal.y) for goal in goals], np.float32).reshape(-1, 2)
    style = rr.Points2D.from_fields(radii=rr.Radius.ui_points(7.0), draw_order=15.0)
    writer.static("map/goal", style)
    labels = [f"{goal.number} {goal.outcome.value}" for goal in goals]
    columns = rr.Points2D.columns(positions=places, colors=colours, labels=labels)
    writer.rows("map/goal", times, list(columns))
    values = [outcome.value for outcome in Outcome]
    words = [value.replace("_", " ") for value in values]
    shades = rgba([OF_OUTCOME[outcome] for outcome in Outcome])
    writer.static("goals", rr.StateConfiguration(values=values, labels=words, colors=shades))
    states = rr.StateChange.columns(state=[goal.outcome.value for goal in goals])
    writer.rows("goals", times, list(states))
    ends = [goal.ended_ns for goal in goals]
    said = rr.TextLog.columns(
        text=[_said(goal) for goal in goals], color=colours, level=[_level(goal) for goal in goals]
    )
    writer.rows("events", ends, list(said))


def _said(goal: Goal) -> str:
    path_m = goal.figures.get("path_m")
    way = f", {path_m:.1f} m" if isinstance(path_m, int | float) else ""
    outcome, at_s = goal.outcome.value.replace("_", " "), second_of(goal.ended_ns)
    return f"{at_s:,.0f} s: goal {goal.number} {outcome} in {goal.took_s:.0f} s{way}"


def _level(goal: Goal) -> str:
    return "WARN" if goal.outcome is Outcome.AFTER_DRIVING else "INFO"


def _write_counts(writer: _Writer, run: Run, doors: Mapping[DoorId, DoorLanes]) -> None:
    """Write how many doors the map has wrong, and how many goals were driven to in vain so far."""
    steps: dict[int, int] = {run.begin_ns: 0, run.end_ns: 0}
    for lanes in doors.values():
        before = False
        for at_ns, words in lanes.wrong():
            steps[at_ns] = steps.get(at_ns, 0) + bool(words) - before
            before = bool(words)
    times = sorted(steps)
    counts = np.cumsum([steps[at_ns] for at_ns in times])
    _write_curve(writer, ("doors wrong in the map", "now"), times, counts, WRONG)
    ends = [g.ended_ns for g in run.goals if g.outcome is Outcome.AFTER_DRIVING]
    counts = np.array([*range(len(ends) + 1), len(ends)])
    in_vain = [run.begin_ns, *ends, run.end_ns]
    _write_curve(writer, ("goals driven to in vain", "so far"), in_vain, counts, DEFAULT.closed)


def _write_curve(
    writer: _Writer, names: tuple[str, str], times: Sequence[int], counts: np.ndarray, colour: Rgb
) -> None:
    what, when = names
    path = entity(("count", what))
    look = rr.SeriesLines(
        names=[f"{what} {when}"], colors=rgba([colour]), interpolation_mode="StepAfter",
        aggregation_policy="Off",  # else 0, 1, 0 within a second is drawn as 0.5 from then on
    )  # fmt: skip
    writer.static(path, look)
    writer.rows(path, times, list(rr.Scalars.columns(scalars=counts.astype(float))))
