"""Beliefs and patrol rounds in a rerun recording: a curve a door, a typical week, a lane a robot.

A point of a curve rests on what had happened by then, with all that is known today; so it stands on
the timeline `happened` alone. Beliefs as of each moment of recording, with late events still
missing and retracted ones still there, would need a new model after each of those events. The week
is as known at the recording's end.

A belief jumps at each sighting and drifts in between. It is computed just before and at each piece
of evidence about the door, and every ten minutes; only those points are kept that a line through
the others would miss.

A round shows what the robot was driving for. Along `happened` it lasts from its start to its end as
they are known today; along `recorded` and `event` as far as the log had learnt of them, including
what was retracted later.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs import door_beliefs
from semmap_log.analysis.probabilities.belief_fold import Beliefs
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.core.batches.event_batch import in_ranges
from semmap_log.core.folds.history import ROUND_KINDS, HistoryEntry, Round, rounds
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import PatrolFinished, PatrolStarted
from semmap_log.core.model.moments import DAY_NS
from semmap_log.views.excerpt.door_rows import NEVER, RecordingEdge
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.drawable import drawable_name, unique_parts
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.scene import (
    EVENT,
    HAPPENED,
    MOST_ROWS,
    RECORDED,
    EntityPath,
    RowWriter,
    Scene,
    SceneDoor,
    rgba,
)
from semmap_log.views.rerun.week_pictures import write_weeks

BELIEF = "belief"
NO_MEANS = rr.components.AggregationPolicy.Off
"""Otherwise the viewer draws points less than a pixel apart as their mean: half a jump."""
MOST_CURVES = 8
"""Doors with a curve, a tab each; doors that were requested all have one."""
MOST_CURVE_DAYS = 1_000
"""The estimator learns again for each day of each curve, as of that day, which takes some seconds.
In a recording of more than four months fewer doors have a curve."""
MOST_WEEKS = 36
"""On a level with more doors the liveliest have a week: of more, ids would lie on each other."""


@dataclass(frozen=True, slots=True)
class BeliefsShown:
    """What a recording shows of beliefs."""

    curves: Mapping[DoorId, Points]
    """Of doors of which enough was known at some time."""
    weeks: Sequence[door_beliefs.TypicalWeek]
    """Of the doors that are in the map at the end and known well enough, ids ascending."""


def beliefs_to_show(
    excerpt: Excerpt, scene: Scene, chosen: Collection[DoorId] | None
) -> BeliefsShown | None:
    """Return the beliefs to show; None: too little was known of every door.

    Args:
        excerpt: The part of the log.
        scene: What the recording shows.
        chosen: Requested doors, all of which have curves; None: the liveliest have.
    """
    now = door_beliefs.ask(
        excerpt.log, at=None, estimator=door_beliefs.default_estimator(), tz=None, doors=None
    )
    doors = [door for door in scene.liveliest() if chosen is None or door.door_id in chosen]
    most = min(MOST_CURVES, max(1, MOST_CURVE_DAYS // (scene.span_ns // DAY_NS + 1)))
    drawn = doors if chosen is not None else doors[:most]
    curves = dict(_curves(now, drawn, scene))
    habits = now.by(door_beliefs.LATER).as_of(
        scene.end.folds_ns
    )  # what happens later is not known there
    read = _read_of(doors)
    here = [door for door in habits.doors if door.door_id in read]
    weeks = [
        week for week in (door_beliefs.typical_week(habits, door) for door in here) if week.is_known
    ]
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
    now: door_beliefs.BeliefQuery, doors: Sequence[SceneDoor], scene: Scene
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


ROUNDS = "rounds"

ROW = np.dtype([("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"), ("label", "i8")])
NO_ROUND = ""
"""A gap in the lane."""

Value = tuple[RecordingEdge, str]
"""When a lane's text changes, and to what."""


@dataclass(frozen=True, slots=True)
class Lane:
    """What a robot was driving for, over time."""

    robot: str
    happened: Sequence[Value]
    recorded: Sequence[Value]


def round_lanes(excerpt: Excerpt, scene: Scene) -> list[Lane]:
    """Return a lane for each robot that drove a round within a recording, by name."""
    by_patrol: dict[int, list[HistoryEntry]] = defaultdict(list)
    for entry in excerpt.log.history(kinds=ROUND_KINDS):
        by_patrol[_number_of(entry)].append(entry)
    happened = _on_happened(by_patrol.values(), scene)
    recorded = _on_recorded(by_patrol, excerpt, scene)
    unnamed = excerpt.log.info.robot or "robot"
    lanes = [Lane(robot or unnamed, happened.get(robot, []), recorded.get(robot, []))
             for robot in sorted(happened.keys() | recorded.keys())]  # fmt: skip
    return [lane for lane in lanes if any(said for _, said in (*lane.happened, *lane.recorded))]


def write_rounds(writer: RowWriter, lanes: Sequence[Lane], palette: Palette) -> None:
    """Write all lanes."""
    parts = unique_parts(((n, lane.robot) for n, lane in enumerate(lanes, start=1)), "robot")
    for place, lane in enumerate(lanes, start=1):
        path = (ROUNDS, parts[place])
        labels = sorted({said for _, said in (*lane.happened, *lane.recorded)} - {NO_ROUND})
        colours = rgba([palette.robot] * len(labels))
        writer.static(path, rr.StateConfiguration(values=labels, labels=labels, colors=colours))
        for values, timelines in ((lane.happened, [HAPPENED]), (lane.recorded, [RECORDED, EVENT])):
            _write(writer, path, values, timelines)


def _write(
    writer: RowWriter, path: tuple[str, ...], values: Sequence[Value], timelines: Sequence[str]
) -> None:
    rows = np.zeros(len(values), ROW)
    for place, (edge, _) in enumerate(values):
        rows[place] = (edge.number, edge.folds_ns, edge.recorded_ns, place)

    def states(part: NDArray[np.void]) -> Sequence[Any]:
        return list(rr.StateChange.columns(state=[values[i][1] for i in part["label"].tolist()]))

    writer.rows(path, rows, states, timelines)


@dataclass(slots=True)
class _Driving:
    """Who drives which rounds, as time goes on; keeps what the lanes say."""

    scene: Scene
    said: dict[str, list[Value]] = field(default_factory=lambda: defaultdict(list))
    _rounds: dict[str, dict[int, Round]] = field(default_factory=lambda: defaultdict(dict))

    def set(
        self, edge: RecordingEdge, patrol: int, driven: Round | None, robots: Iterable[str]
    ) -> None:
        """Set what is driven of a round from then on; None: no longer, or not at all.

        Args:
            edge: When.
            patrol: Its number.
            driven: The round.
            robots: Those of whom it may have been.
        """
        for robot in {*robots, *([driven.actor] if driven else [])}:
            self._rounds[robot].pop(patrol, None)
            if driven is not None and driven.actor == robot:
                self._rounds[robot][patrol] = driven
            latest = max(self._rounds[robot].values(), key=_start, default=None)
            self._say(edge, robot, NO_ROUND if latest is None else _label(latest))

    def _say(self, edge: RecordingEdge, robot: str, label: str) -> None:
        begin, values = self.scene.begin, self.said[robot]
        edge = RecordingEdge(max(edge.folds_ns, begin.folds_ns), max(edge.number, begin.number),
                    max(edge.recorded_ns, begin.recorded_ns))  # fmt: skip
        if values and values[-1][0] == edge:
            values.pop()
        if label != (values[-1][1] if values else NO_ROUND):
            values.append((edge, label))


def _on_happened(
    entries: Iterable[Sequence[HistoryEntry]], scene: Scene
) -> Mapping[str, list[Value]]:
    found = [one for of_patrol in entries for one in rounds(of_patrol)]
    driving = _Driving(scene)
    turns = [(one.start_ns, 1, one) for one in found if one.start_ns is not None]
    turns += [(one.end_ns, 0, one) for one in found if one.end_ns is not None]
    for ns, starts, one in sorted(turns, key=lambda turn: turn[:2]):
        over = one.end_ns is not None and one.end_ns <= ns
        if ns <= scene.end.folds_ns:
            driven = one if starts and not over else None
            driving.set(RecordingEdge(ns, 0, ns), one.patrol, driven, [one.actor])
    return driving.said


def _on_recorded(
    by_patrol: Mapping[int, Sequence[HistoryEntry]], excerpt: Excerpt, scene: Scene
) -> Mapping[str, list[Value]]:
    driving = _Driving(scene)
    for edge, patrol in _learnings(by_patrol, excerpt):
        if edge.number <= scene.end.number:
            entries = by_patrol[patrol]
            known = next(iter(rounds(_known(entries, excerpt, edge.number))), None)
            is_driven = known is not None and known.start_ns is not None and known.end_ns is None
            robots = {entry.actor for entry in entries}
            driving.set(edge, patrol, known if is_driven else None, robots)
    return driving.said


def _learnings(
    by_patrol: Mapping[int, Sequence[HistoryEntry]], excerpt: Excerpt
) -> list[tuple[RecordingEdge, int]]:
    """Return when the log learnt something of each patrol, in order."""
    known = excerpt.retractions
    learnt = [(RecordingEdge(e.folds_ns, e.number, e.recorded_ns), patrol)
              for patrol, entries in by_patrol.items() for e in entries]  # fmt: skip
    numbers = {e.number: patrol for patrol, entries in by_patrol.items() for e in entries}
    placed = np.array(sorted(numbers), np.int64)
    for number, (first, last) in zip(known.numbers, known.ranges, strict=True):
        hit = placed[slice(*np.searchsorted(placed, [first, last + 1]))]
        if len(hit):
            ns = excerpt.log.event(number).recorded_ns
            learnt += [(RecordingEdge(ns, number, ns), numbers[n]) for n in hit.tolist()]
    return sorted(learnt, key=lambda one: one[0].number)


def _known(
    entries: Sequence[HistoryEntry], excerpt: Excerpt, number: int
) -> Iterator[HistoryEntry]:
    """Yield what was known of a patrol up to an event, ignoring later retractions."""
    numbers = np.array([entry.number for entry in entries], np.int64)
    hidden = in_ranges(numbers, excerpt.retractions.up_to(number).ranges)
    for entry, is_hidden in zip(entries, hidden.tolist(), strict=True):
        if entry.number <= number and not is_hidden:
            yield replace(entry, retracted=False)


def _number_of(entry: HistoryEntry) -> int:
    assert isinstance(entry.event, (PatrolStarted, PatrolFinished))
    return entry.event.patrol


def _label(driven: Round) -> str:
    return drawable_name(driven.label, f"round {driven.patrol}")


def _start(driven: Round) -> tuple[int, int]:
    return driven.start_ns or 0, driven.patrol


EVERY_NS = 600 * 10**9
MOST_STEPS = 4096
"""In a long recording the steps are longer, so that there are not more of them."""
TOLERANCE = 0.01
"""No point that is left out lies further than this off the line."""

POINT = np.dtype([("folds_ns", "i8"), ("p_open", "f8")])
"""A point of a curve; NaN: the line has a gap."""

Points = NDArray[np.void]
"""Rows of `POINT`."""
Times = NDArray[np.int64]


def times_of_curve(evidence: DoorEvidence, first_ns: int, last_ns: int) -> Times:
    """Return the times to compute a belief at, ascending, from `first_ns` to `last_ns`."""
    step_ns = max(EVERY_NS, (last_ns - first_ns) // MOST_STEPS)
    jumps = np.concatenate([evidence.start_ns, evidence.end_ns, evidence.seen_ns])
    asked = np.concatenate([
        np.arange(first_ns, last_ns, step_ns, dtype=np.int64), [last_ns], jumps, jumps - 1,
    ])  # fmt: skip
    times: Times = np.unique(asked[(asked >= first_ns) & (asked <= last_ns)])
    return times


def curve(times_ns: Times, p_open: NDArray[np.float64], is_known: NDArray[np.bool_]) -> Points:
    """Return the points to draw; where nothing is known is a gap.

    Args:
        times_ns: (n,), ascending.
        p_open: (n,).
        is_known: (n,).
    """
    points = np.empty(len(times_ns), POINT)
    points["folds_ns"], points["p_open"] = times_ns, np.where(is_known, p_open, np.nan)
    edges = np.flatnonzero(np.diff(is_known, prepend=False, append=False))
    kept: list[int] = []
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        run = telling(times_ns[start:stop], p_open[start:stop])
        kept += (run + start).tolist()
        if stop < len(points):
            kept.append(stop)
    return points[kept]


def telling(times_ns: Times, values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the indices of the points that a line through the others would miss.

    From a kept point on, each further one allows some slopes; once the next point lies outside of
    them all, the one before it is kept. (A swing filter: Elmeleegy et al., VLDB 2009.)
    """
    # Whole nanoseconds: as seconds of some years, adjacent moments would be equal.
    times, heights = times_ns.tolist(), values.tolist()
    kept = [0]
    steepest, flattest = np.inf, -np.inf
    for i in range(1, len(times)):
        ahead = times[i] - times[kept[-1]]
        rise = heights[i] - heights[kept[-1]]
        if not flattest * ahead <= rise <= steepest * ahead:
            kept.append(i - 1)
            ahead, rise = times[i] - times[i - 1], heights[i] - heights[i - 1]
            steepest, flattest = np.inf, -np.inf
        steepest = min(steepest, (rise + TOLERANCE) / ahead)
        flattest = max(flattest, (rise - TOLERANCE) / ahead)
    if kept[-1] != len(times) - 1:
        kept.append(len(times) - 1)
    return np.array(kept, np.int64)
