"""What a recording of a log shows: its doors and levels, with their names, paths and bounds.

Rows are written by columns, at most 4096 rows a call, on our three timelines. Along `happened` an
event stands where it happened, along `recorded` where its commit was recorded (a commit is known as
a whole), along `event` at its number. `rr.log` takes a millisecond a row and adds timelines of its
own; columns are 50 times faster and 10 times smaller. Chunks beyond 4096 rows make rerun's own
tools slow.

Up to `FULL_UP_TO` events a recording holds everything. Beyond, what no eye would see is left out:
sightings that only repeat what a door is have no line in the event log, and poses that hardly
differ from the one before are missing from the robot's track. A change of a state is never left
out, nor anything of lanes, plans and curves.

Recorded late, an event sets only what nothing newer has set by then. The effect of a retraction
comes from the project's own fold: from there on a door continues from what `state_at` returns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.door_changes import CHANGE, EVERYTHING, THERE, Changes, Stamp
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorPassed, DoorRemoved, FloorMap
from semmap_log.core.model.meaning import PARTS, REGISTER_OF, REGISTERS, Changed
from semmap_log.core.texts import counted
from semmap_log.views.bounds import Bounds
from semmap_log.views.excerpt import door_rows
from semmap_log.views.excerpt.span import NO_PLANS, Excerpt, LevelPlans
from semmap_log.views.palette import Rgb, packed
from semmap_log.views.rerun.rerun_sdk import rr

HAPPENED, RECORDED, EVENT = "happened", "recorded", "event"
"""The timelines: when it happened, when the log learnt it, the event's number."""
EVERYWHERE = (HAPPENED, RECORDED, EVENT)

MOST_ROWS = 4096

Rows = NDArray[np.void]
"""A structured array with at least `number`, `folds_ns`, `recorded_ns`."""


class RowWriter:
    """Writes rows to the entities of one recording."""

    def __init__(self, recording: Any, excerpt: Excerpt, commits: NDArray[np.int64]) -> None:
        """Write to a recording.

        Args:
            recording: Rerun's.
            excerpt: Determines which events stand on which timelines.
            commits: Number of the first event of each commit, ascending.
        """
        self._recording = recording
        self._excerpt = excerpt
        self._commits = commits
        self._last_commit = np.full(1, -1)

    def note_commits(self, numbers: NDArray[np.int64], recorded_ns: NDArray[np.int64]) -> None:
        """Take in where new commits begin, from events in order."""
        bases = recorded_ns - numbers  # the same in all of a commit, and in no other
        starts = numbers[np.append(self._last_commit, bases)[:-1] != bases]
        known = int(self._commits[-1]) if len(self._commits) else -1
        if len(starts) and starts[-1] > known:
            self._commits = np.append(self._commits, starts[starts > known])
        self._last_commit = bases[-1:]

    def static(self, path: EntityPath, *archetypes: Any) -> None:
        """Write what holds at all times."""
        self._recording.log(entity(path), *archetypes, static=True, strict=True)

    def events(
        self, path: EntityPath, rows: Rows, columns: Callable[[Rows], Sequence[Any]]
    ) -> None:
        """Write one row of components for each event, on the timelines that it stands on.

        Args:
            path: The entity.
            rows: When: the stamps of the events, numbers ascending.
            columns: Gives the component columns for some of the rows.
        """
        happened = self._excerpt.has_happened(rows["number"], rows["folds_ns"])
        recorded = self._excerpt.was_recorded(rows["number"], rows["recorded_ns"])
        if (happened & recorded).all():
            self.rows(path, rows, columns, EVERYWHERE)
        else:
            self.rows(path, rows[happened], columns, [HAPPENED])
            self.rows(path, rows[recorded], columns, [RECORDED, EVENT])

    def rows(
        self,
        path: EntityPath,
        rows: Rows,
        columns: Callable[[Rows], Sequence[Any]],
        timelines: Sequence[str],
    ) -> None:
        """Write one row of components for each of `rows`, on these timelines.

        Of rows of an entity at one time the last written holds.
        """
        for first in range(0, len(rows), MOST_ROWS):
            part = rows[first : first + MOST_ROWS]
            indexes = [self._index(timeline, part) for timeline in timelines]
            self._recording.send_columns(
                entity(path), indexes=indexes, columns=columns(part), strict=True
            )

    def one(
        self, path: EntityPath, row: Rows, archetypes: Sequence[Any], timelines: Sequence[str]
    ) -> None:
        """Write an entity's properties from one row on, as `static` takes them."""
        batches = [each for one in archetypes for each in one.as_component_batches()]
        columns = [each.partition([len(each.as_arrow_array())]) for each in batches]
        self.rows(path, row, lambda _: columns, timelines)

    def clear(
        self, path: EntityPath, rows: Rows, timelines: Sequence[str], *, returns: Rows
    ) -> None:
        """Hide the entity at these rows; its static part stays for its return.

        Args:
            path: The entity.
            rows: When it vanishes; written after all rows that are shown until then.
            timelines: On which.
            returns: When it shows something again. A row at the same time as one of these, but
                before it, hides nothing.
        """
        if not len(rows):
            return
        for timeline in timelines:
            self.rows(path, rows[~self._is_back(timeline, rows, returns)], _clearing, [timeline])

    def _is_back(self, timeline: str, rows: Rows, returns: Rows) -> NDArray[np.bool_]:
        if not len(returns):
            return np.zeros(len(rows), np.bool_)
        times, numbers = self._times(timeline, returns), returns["number"]
        order = np.lexsort((numbers, times))
        wanted = self._times(timeline, rows)
        last = order[np.maximum(np.searchsorted(times[order], wanted, "right") - 1, 0)]
        is_back: NDArray[np.bool_] = (times[last] == wanted) & (numbers[last] > rows["number"])
        return is_back

    def _times(self, timeline: str, rows: Rows) -> NDArray[np.int64]:
        """Return the times of rows; events of one commit became known together."""
        if timeline == HAPPENED:
            return np.asarray(rows["folds_ns"])
        if timeline == EVENT:
            return np.asarray(rows["number"])
        behind = np.searchsorted(self._commits, rows["number"], "right")
        first = np.append(-1, self._commits)[behind]
        # Within a commit each event is recorded a nanosecond after the one before.
        return rows["recorded_ns"] - np.where(behind > 0, rows["number"] - first, 0)

    def _index(self, timeline: str, rows: Rows) -> Any:
        times = self._times(timeline, rows)
        if timeline == EVENT:
            return rr.TimeColumn(EVENT, sequence=times)
        return rr.TimeColumn(timeline, timestamp=times.astype("M8[ns]"))


def entity(path: EntityPath) -> str:
    """Return the path as rerun writes it."""
    return str(rr.new_entity_path(list(path)))


def rgba(colours: Sequence[Rgb], alpha: int = 255) -> NDArray[np.uint32]:
    """Return the colours as rerun takes them."""
    return np.array([packed(colour, alpha) for colour in colours], np.uint32)


def _clearing(rows: Rows) -> Sequence[Any]:
    return list(rr.Clear.columns(is_recursive=[False] * len(rows)))


FULL_UP_TO = 50_000
"""Events."""

NEAR_M, NEAR_RAD, NEAR_NS = 0.05, np.radians(5.0), 30 * 10**9
"""A pose is drawn when the robot has come so far, turned so much, or so much time has passed."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """How much a recording left out."""

    repeats: int = 0
    """Sightings without a line in the event log: they repeat what the door was."""
    poses: int = 0
    """Poses that hardly differ from the one before."""

    def __str__(self) -> str:
        """Return the omissions in words; empty: nothing was left out."""
        parts = []
        if self.repeats:
            parts.append(f"{counted(self.repeats, 'line')} of sightings that repeat a state")
        if self.poses:
            parts.append(f"{counted(self.poses, 'pose')} close to others")
        return f"without {' and '.join(parts)}" if parts else ""


def is_long(scene: Scene) -> bool:
    """Return whether a recording leaves out what no eye would see."""
    return scene.events > FULL_UP_TO


class RepeatFinder:
    """Finds the sightings that repeat what was known already."""

    def __init__(self, doors: Mapping[DoorId, SceneDoor]) -> None:
        self._disturbed = {int(i): door.disturbed_ns for i, door in doors.items()
                           if len(door.disturbed_ns)}  # fmt: skip
        self._ids = np.array(sorted(doors), np.int64)
        self._states = np.full(len(self._ids) + 1, door_rows.NO_STATE, np.uint8)
        self._last: dict[int, tuple[int, int]] = {}
        """Of disturbed doors: time and state of the last sighting in order."""

    def numbers(self, changes: Changes) -> NDArray[np.int64]:
        """Return the numbers of the next sightings that repeat a state.

        Args:
            changes: Events about doors, numbers ascending.
        """
        setting = changes[(changes["sets"] & int(Changed.STATE)) != 0]
        disturbed = np.isin(setting["door_id"], list(self._disturbed))
        found = [self._quiet(setting[~disturbed])]
        found += [self._restless(rows) for rows in door_rows.by_door(setting[disturbed])]
        repeats: Changes = np.concatenate(found)
        is_sighting = np.isin(repeats["kind"], [DoorObserved.kind, DoorPassed.kind])
        return np.asarray(repeats["number"][is_sighting])

    def _quiet(self, changes: Changes) -> Changes:
        """Return the repeats of doors whose events all came in order."""
        ordered = changes[np.argsort(changes["door_id"], kind="stable")]
        place = np.searchsorted(self._ids, ordered["door_id"])
        goes_on = np.append(False, place[1:] == place[:-1])[: len(place)]
        before = np.where(goes_on, np.roll(ordered["state"], 1), self._states[place])
        self._states[place] = ordered["state"]  # of assignments to one place the last stays
        repeats: Changes = ordered[before == ordered["state"]]
        return repeats

    def _restless(self, changes: Changes) -> Changes:
        """Return the repeats of a door with late or retracted events.

        Between two equal sightings there must be no report of anything else.
        """
        door_id = int(changes["door_id"][0])
        disturbed_ns = self._disturbed[door_id]
        in_order = changes[~np.isin(changes["folds_ns"], disturbed_ns)]
        if not len(in_order):
            return in_order
        last_ns, state = self._last.get(door_id, (-1, door_rows.NO_STATE))
        times = np.append(last_ns, in_order["folds_ns"])
        states = np.append(np.uint8(state), in_order["state"])
        reported_between = np.diff(np.searchsorted(disturbed_ns, times)) != 0
        self._last[door_id] = int(times[-1]), int(states[-1])
        repeats: Changes = in_order[(states[1:] == states[:-1]) & ~reported_between]
        return repeats


def drawn_poses(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    theta: NDArray[np.float64],
    level: NDArray[np.uint16],
    times_ns: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Return which poses are drawn: each (n,), in the order in which they were recorded.

    The way is counted along the poses, so that a slow robot is not lost sight of.
    """
    way_m = np.cumsum(np.hypot(np.diff(x, prepend=x[:1]), np.diff(y, prepend=y[:1])))
    turns = np.abs((np.diff(theta, prepend=theta[:1]) + np.pi) % (2 * np.pi) - np.pi)
    steps = np.stack([way_m // NEAR_M, np.cumsum(turns) // NEAR_RAD, times_ns // NEAR_NS, level])
    telling = np.ones(len(x), np.bool_)
    telling[1:] = (steps[:, 1:] != steps[:, :-1]).any(axis=0)
    return telling


EntityPath = tuple[str, ...]
"""The parts of a rerun entity path."""

ROOT = "map"
EVENTS = "events"


@dataclass(frozen=True, slots=True)
class SceneDoor:
    """A door in the recording."""

    door_id: DoorId
    label: str
    """Its label, as the viewer can draw it."""
    short_label: str
    """The same without the name of its level."""
    path: EntityPath
    """Of its lane and curves; and of its line, on the level where it was put last."""
    lines: Mapping[int, EntityPath]
    """Level -> path of its line there, for every level it is on at some time."""
    life: door_rows.DoorLifetime
    before: Door | None
    """As it was when the recording begins; None: not in the map by then."""
    known: Sequence[KnownDoor] = field(compare=False)
    """States from which it continues along `recorded`: at the beginning, if that is amid the log,
    and after each retraction of one of its events."""
    state_changes: int
    has_probabilities: bool
    shape: door_rows.ObjectShape
    is_plain: bool
    """All its events came in the order in which they count, and none was retracted: it is the same
    along every timeline."""
    disturbed_ns: NDArray[np.int64] = field(compare=False)
    """When late and retracted events set its state, ascending."""


@dataclass(frozen=True, slots=True)
class SceneLevel:
    """A storey with something to draw."""

    level: int
    name: str
    path: EntityPath
    """Of all that is drawn on it."""
    floor: FloorMap | None
    """At the end."""
    bounds: Bounds
    is_empty: bool
    """Nothing on it has a place: its doors are sensors without geometry."""
    doors: int
    has_robot: bool
    plans: LevelPlans = NO_PLANS
    """All plans that it is drawn on, each with its begin; `floor` is the last of them."""


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything that is known before the first row is written."""

    doors: Mapping[DoorId, SceneDoor]
    levels: Mapping[int, SceneLevel]
    home_of_0: int | None
    """Where poses of level 0 are drawn: see `excerpt.shown_levels`."""
    robot_level: int | None
    """Where the robot is at the end; None: it never reported a pose, or its level is unknown."""
    robots: tuple[str, ...]
    """The robots in the log."""
    events: int
    """That stand on any of its timelines."""
    commits: NDArray[np.int64]
    """Number of the first event of each commit."""
    begin: door_rows.RecordingEdge
    """Before every event; its happened time is that of the first row."""
    end: door_rows.RecordingEdge
    """Of the last happened time, the greatest number, and the last recorded time."""

    @property
    def span_ns(self) -> int:
        """From the first row to the last."""
        return self.end.folds_ns - self.begin.folds_ns

    def liveliest(self) -> list[SceneDoor]:
        """Return the doors, those whose state changed most often first."""
        return sorted(self.doors.values(), key=lambda door: (-door.state_changes, door.door_id))


@dataclass(frozen=True, slots=True)
class KnownDoor:
    """All that was known of a door from some moment of recording on."""

    row: Changes
    """One row, which sets everything."""
    stamps: Mapping[int, Stamp]
    """Bit of `sets` -> the event that had set it."""

    @property
    def is_there(self) -> bool:
        """Whether it was in the map."""
        return bool(self.row["kind"][0] != DoorRemoved.kind)

    @property
    def is_placed(self) -> bool:
        """Whether it had a place, or would have one if it were in the map."""
        return bool(np.isfinite(self.row["x"][0]))

    @property
    def level(self) -> int:
        """Where that is."""
        return int(self.row["level"][0])

    @classmethod
    def of(cls, state: DoorMapState, door_id: DoorId, since: door_rows.RecordingEdge) -> KnownDoor:
        """Return a door's state in a fold of what was known."""
        row = np.zeros(1, CHANGE)
        since.stamp(row)
        row["door_id"], row["sets"] = door_id, EVERYTHING
        row["kind"] = (DoorAdded if state.is_present(door_id) else DoorRemoved).kind
        stamps: dict[int, Stamp] = {}
        for part, register in REGISTER_OF.items():
            _, _, values = state.register_of(np.array([door_id]), register)
            stamps[int(part)] = state.stamp(door_id, register) or door_rows.ALWAYS
            for name in REGISTERS[register]:
                row[name] = values[name]
        came_and_went = [state.stamp(door_id, register) for register in ("added", "removed")]
        stamps[THERE] = max(stamp or door_rows.ALWAYS for stamp in came_and_went)
        return cls(row, stamps)


def as_recorded(changes: Changes, known: Sequence[KnownDoor]) -> Changes:
    """Return a door's rows in the order of recording, each setting only what it won then.

    Args:
        changes: Its events, numbers ascending, including later retracted ones.
        known: The states from which the door continues: at the beginning, and after each
            retraction of one of its events; numbers ascending.
    """
    cuts = np.searchsorted(changes["number"], [one.row["number"][0] for one in known], "right")
    parts: list[Changes] = [_winning(changes[: cuts[0]] if len(known) else changes, {})]
    for one, (start, stop) in zip(known, pairwise([*cuts.tolist(), len(changes)]), strict=True):
        parts.append(_winning(np.concatenate([one.row, changes[start:stop]]), one.stamps))
    rows: Changes = np.concatenate(parts)
    return rows


def _winning(changes: Changes, first: Mapping[int, Stamp]) -> Changes:
    """Return rows without values that an earlier row has set with a greater stamp.

    Args:
        changes: Numbers ascending.
        first: Bit -> stamp of what the first row sets; empty: its own.
    """
    rows: Changes = changes.copy()
    for bit in (*map(int, PARTS), THERE):
        setting = np.flatnonzero((rows["sets"] & bit) != 0)
        folds_ns, number = rows["folds_ns"][setting], rows["number"][setting]
        if first:
            folds_ns[0], number[0] = first[bit]
        rank = np.empty(len(setting), np.int64)
        rank[np.lexsort((number, folds_ns))] = np.arange(len(setting))
        outdone = setting[rank < np.maximum.accumulate(rank)]
        rows["sets"][outdone] &= ~np.uint8(bit)
    return rows
