"""One pass over a log's events: what the page needs of them, in a few columns.

Of each report of a state 22 bytes are kept, of each pose 20; the rest is rare. States are never
thinned: at each whole millisecond the page shows what a replay returns. Sightings that only repeat
a state move nothing but `last seen`; of very many, some are left out. A robot's track has as few
points as it takes, since a point every 25 cm is more than eyes see: between two points the robot
went straight, at one speed; after the last point of a run it stands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds import door_changes
from semmap_log.core.folds.renumbering import robots_of, robots_of_poses
from semmap_log.core.folds.timeline import Timeline
from semmap_log.core.model.doors import Door, DoorId, DoorState
from semmap_log.core.model.events import (
    KINDS,
    DoorAdded,
    DoorPassed,
    PatrolFinished,
    PatrolStarted,
    RobotPose,
)
from semmap_log.core.model.meaning import Changed, Presence
from semmap_log.views.excerpt import door_rows
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.zone_times import MS_NS, Span

TOLERANCE_M = 0.3
"""The largest distance of a pose from the line that replaces it."""
ROUNDING_M = 0.2
"""What decimetres and tenths of seconds add to that, for a robot of 2 m/s."""
MOST_POINTS = 50_000
"""With more, the tolerance doubles."""
GAP_MS = 600_000
"""A robot unseen for longer did not drive the straight line between the two poses."""
TENTH_NS = 10**8
DM = 10


@dataclass(frozen=True, slots=True)
class DrawnTrack:
    """The robots' tracks as the page draws them."""

    runs: list[list[int]]
    """[level, then for each point tenths of seconds, x and y in decimetres]; each point but the
    first as the difference from the one before."""
    robots: list[int]
    """For each run, the index of its robot among the log's robots."""
    within_m: float
    """The largest distance of a pose from it."""


def track_of(
    poses: Rows, span: Span, plans: Mapping[int, Sequence[int]] = MappingProxyType({})
) -> DrawnTrack:
    """Return the track of poses, which are sorted by time.

    Args:
        poses: The robots' poses.
        span: The span of the page.
        plans: Level -> when it got another floor plan, ns; no track crosses that.
    """
    if not len(poses):
        return DrawnTrack([], [], TOLERANCE_M + ROUNDING_M)
    runs = _runs(poses, plans)
    tolerance_m = TOLERANCE_M
    while True:
        kept = [run[telling(run, tolerance_m)] for run in runs]
        if sum(map(len, kept)) <= max(MOST_POINTS, 2 * len(runs)):
            coded = [_coded(run, span) for run in kept]
            of = [int(run["robot"][0]) for run in kept]
            return DrawnTrack(coded, of, tolerance_m + ROUNDING_M)
        tolerance_m *= 2


def _runs(poses: Rows, plans: Mapping[int, Sequence[int]]) -> list[Rows]:
    """Cut where the level or its plan changes, or no pose came for long; robot by robot."""
    poses = poses[np.argsort(poses["robot"], kind="stable")]
    jumps = np.diff(poses["robot"].astype(np.int32)) != 0
    jumps |= np.diff(poses["level"].astype(np.int32)) != 0
    jumps |= np.diff(poses["folds_ns"]) > GAP_MS * 10**6
    for begins in plans.values():
        jumps |= np.diff(np.searchsorted(begins, poses["folds_ns"], "right")) != 0
    return np.split(poses, np.flatnonzero(jumps) + 1)


def telling(run: Rows, tolerance_m: float) -> list[int]:
    """Return the indices of the poses that straight lines between the others would miss.

    From a kept pose on, each further one allows some speeds, along x and along y; once the next
    lies outside of them, the one before it is kept. (A swing filter: Elmeleegy et al., VLDB 2009.)
    """
    times, ways = run["folds_ns"].tolist(), (run["x"].tolist(), run["y"].tolist())
    slack = tolerance_m / math.sqrt(2)  # of both directions together not more than the tolerance
    kept = [0]
    allowed = [[-math.inf, math.inf], [-math.inf, math.inf]]
    for i in range(1, len(times)):
        if not _fits(allowed, ways, times, kept[-1], i):
            kept.append(i - 1)
            allowed = [[-math.inf, math.inf], [-math.inf, math.inf]]
        ahead = times[i] - times[kept[-1]]
        for speeds, way in zip(allowed, ways, strict=True):
            rise = way[i] - way[kept[-1]]
            if ahead:
                speeds[0] = max(speeds[0], (rise - slack) / ahead)
                speeds[1] = min(speeds[1], (rise + slack) / ahead)
    if kept[-1] != len(times) - 1:
        kept.append(len(times) - 1)
    return kept


def _fits(
    allowed: list[list[float]], ways: tuple[list[float], list[float]], times: list[int],
    since: int, i: int,
) -> bool:  # fmt: skip
    ahead = times[i] - times[since]
    return (
        all(
            ahead > 0 and low * ahead <= way[i] - way[since] <= high * ahead
            for (low, high), way in zip(allowed, ways, strict=True)
        )
        or i == since + 1
    )


def _coded(run: Rows, span: Span) -> list[int]:
    columns = np.stack([
        (run["folds_ns"] - span.begin_ms * MS_NS) // TENTH_NS,
        np.rint(run["x"].astype(np.float64) * DM).astype(np.int64),
        np.rint(run["y"].astype(np.float64) * DM).astype(np.int64),
    ], -1)  # fmt: skip
    deltas = np.diff(columns, axis=0, prepend=np.zeros((1, 3), np.int64))
    return [int(run["level"][0]), *deltas.ravel().tolist()]


MOST_STATES = 100_000
"""With more sightings in all, repeats are left out."""
SHORTEST_STEP_MS = 60_000


@dataclass(frozen=True, slots=True)
class PageDoor:
    """A door that is in the map at some time of the page."""

    door_id: DoorId
    life: door_rows.DoorLifetime
    states: Rows
    """Rows of `STATE_CHANGE` while it was in the map, in the order in which they count."""
    picture: door_rows.DoorPicture
    """Its places, and the probabilities that were set."""
    shape: door_rows.ObjectShape = door_rows.AS_A_DOOR

    @property
    def changes(self) -> Rows:
        """Rows of `STAMP`: the events that reported another state than the one before."""
        rows = self.states[1:][np.diff(self.states["state"].astype(np.int16)) != 0]
        stamps = np.empty(len(rows), STAMP)
        stamps["folds_ns"], stamps["number"] = rows["folds_ns"], rows["number"]
        return stamps

    @property
    def last_level(self) -> int:
        """The level it was put on last."""
        places = self.picture.placements
        return int(places["level"][-1]) if len(places) else 0


def brought_by(
    found: PageEvents, before: Mapping[DoorId, Door], since_ns: int
) -> door_changes.Changes:
    """Return rows that add, place or remove doors, including doors that exist at the begin.

    Args:
        found: The events.
        before: The doors just before the first of them.
        since_ns: The time of the first.
    """
    opening = door_rows.opening_changes(before.values(), door_rows.RecordingEdge(since_ns, -1, -1))
    return np.concatenate([opening, found.rest])


def placed_on(rest: door_changes.Changes) -> set[int]:
    """Return the levels on which doors get a place."""
    sets_pose = (rest["sets"] & int(Changed.POSE)) != 0
    return set(np.unique(rest["level"][sets_pose & np.isfinite(rest["x"])]).tolist())


def bring_home(rest: door_changes.Changes, poses: Rows, home: int | None) -> None:
    """Move what is on level 0 to the level on which it is shown: see `excerpt.shown_levels`."""
    for rows in (rest, poses):
        rows["level"][rows["level"] == 0] = home or 0


def page_doors(
    found: PageEvents,
    rest: door_changes.Changes,
    before: Mapping[DoorId, Door],
    shapes: Mapping[DoorId, door_rows.ObjectShape] = MappingProxyType({}),
) -> list[PageDoor]:
    """Return the doors that are in the map at some time, ids ascending.

    Args:
        found: The events.
        rest: Rows that add, place or remove doors, from `brought_by`.
        before: The doors just before the first of them.
        shapes: Of objects that are not doors.
    """
    told = [
        _story(before.get(DoorId(int(mine["door_id"][0]))), mine, found.states)
        for mine in door_rows.by_door(rest)
    ]
    return [
        replace(page_door, shape=shapes.get(page_door.door_id, door_rows.AS_A_DOOR))
        for page_door in told
        if page_door is not None
    ]


def _story(before: Door | None, rest: door_changes.Changes, states: Rows) -> PageDoor | None:
    """Return one door's history; None: it never was in the map.

    Args:
        before: As it was when the page begins; None: not there by then.
        rest: Its rows.
        states: Those of all doors.
    """
    life = _life(rest)
    if life.added == door_rows.NEVER:
        return None
    door_id = int(rest["door_id"][0])
    first, behind = np.searchsorted(states["door_id"], [door_id, door_id + 1]).tolist()
    said = np.concatenate([_opening_state(before), states[first:behind]])
    # What is known of a door that exists when the page begins was reported before it begins.
    born = door_rows.ALWAYS if life.added[1] < 0 else life.added
    return PageDoor(
        DoorId(door_id),
        life,
        said[door_rows.DoorLifetime(born, life.removed).covers(said)],
        door_rows.DoorFold().take(rest),
    )


def _life(changes: door_changes.Changes) -> door_rows.DoorLifetime:
    added, removed = (
        _first_stamp(changes[door_changes.of_presence(changes, presence)])
        for presence in (Presence.COMES, Presence.GOES)
    )
    # A removal before the adding was of no door.
    return door_rows.DoorLifetime(added, removed if removed > added else door_rows.NEVER)


def _first_stamp(rows: door_changes.Changes) -> door_changes.Stamp:
    return (int(rows["folds_ns"][0]), int(rows["number"][0])) if len(rows) else door_rows.NEVER


def _opening_state(before: Door | None) -> Rows:
    """Return the row with a door's state when the page begins."""
    if before is None:
        return np.empty(0, door_changes.STATE_CHANGE)
    seen_ns = before.last_seen_ns or 0
    row = (before.door_id, seen_ns, -1, DoorAdded.kind, int(before.state))
    return np.array([row], door_changes.STATE_CHANGE)


def coded_states(told: list[PageDoor], span: Span) -> tuple[Iterator[dict[str, Any]], int]:
    """Return each door's states as `t` and `s`, and by how much `last seen` may lag, milliseconds.

    `t` are the times in milliseconds, of the first after the page's begin, of the others after the
    one before; `s` the states, a digit each.
    """
    times = [_counting_ms(page_door.states, span) for page_door in told]
    held = [np.append(t[1:] != t[:-1], True)[: len(t)] for t in times]
    times = [t[kept] for t, kept in zip(times, held, strict=True)]
    states = [
        door_changes.known_states(page_door.states["state"][kept])
        for page_door, kept in zip(told, held, strict=True)
    ]
    step_ms = _step_ms(times, states)
    thinned = (
        (t[kept], s[kept])
        for t, s in zip(times, states, strict=True)
        for kept in [_kept(t, s, step_ms)]
    )
    return ({"t": _deltas(t), "s": "".join(map(str, s.tolist()))} for t, s in thinned), step_ms


def coded_lapses(timeline: Timeline, span: Span) -> list[int]:
    """Return when lapses begin and end, in turn, each in milliseconds after the one before."""
    edges_ns = np.stack([timeline.lapse_start_ns, timeline.lapse_end_ns], -1)
    edges = -(-edges_ns // MS_NS) - span.begin_ms
    return _deltas(edges[edges[:, 0] < edges[:, 1]].ravel())


def _counting_ms(rows: Rows, span: Span) -> Rows:
    milliseconds: Rows = -(-rows["folds_ns"] // MS_NS) - span.begin_ms
    return milliseconds


def _step_ms(times: list[Rows], states: list[Rows]) -> int:
    """Return the least step at which few enough sightings are kept; 0: all are kept."""
    if sum(map(len, times)) <= MOST_STATES:
        return 0
    changes = sum(int(np.count_nonzero(np.diff(s))) for s in states)
    step_ms = SHORTEST_STEP_MS
    while step_ms < 2**40 and changes + MOST_STATES < sum(
        int(np.count_nonzero(_kept(t, s, step_ms))) for t, s in zip(times, states, strict=True)
    ):
        step_ms *= 2
    return step_ms


def _kept(times: Rows, states: Rows, step_ms: int) -> Rows:
    """Return which rows stay: each change, the last state, and the first repeat in each step."""
    kept = np.ones(len(times), np.bool_)
    if step_ms and len(times):
        steps = times // step_ms
        kept[1:] = (steps[1:] != steps[:-1]) | (states[1:] != states[:-1])
        kept[-1] = True
    return kept


def _deltas(times: Rows) -> list[int]:
    deltas: list[int] = np.diff(times, prepend=0).tolist()
    return deltas


def coded_life(page_door: PageDoor, span: Span) -> dict[str, Any]:
    """Return a door's lifetime, places, and the probabilities that were set.

    For other objects, also the names of the states.
    """
    removed, shape = page_door.life.removed, page_door.shape
    words = [shape.object_class.word(state).capitalize() for state in DoorState]
    of_others = {"isOutlined": not shape.is_line, "words": words}
    return {
        **({} if shape.object_class.is_door else of_others),
        "added": span.since_begin(page_door.life.added[0]),
        "removed": None if removed == door_rows.NEVER else span.since_begin(removed[0]),
        "places": [_place(row, shape, span) for row in page_door.picture.placements],
        "probs": [
            [span.since_begin(int(row["folds_ns"])),
             _number(row["prob_open"], 6), _number(row["prob_closed"], 6)]
            for row in page_door.picture.probabilities
        ],
    }  # fmt: skip


def _place(row: Any, shape: door_rows.ObjectShape, span: Span) -> list[Any]:
    """Return [from when, level, x and y of its start, of its end]; no coordinates: unplaced.

    An object that is not a line has x and y of each corner, with the first repeated at the end.
    """
    since, level = span.since_begin(int(row["folds_ns"])), int(row["level"])
    x, y, theta, width = (float(row[name]) for name in ("x", "y", "theta", "width"))
    ends = (x, y, x + width * math.cos(theta), y + width * math.sin(theta))
    if not all(map(math.isfinite, ends)):
        return [since, level]
    if not shape.is_line:
        points = shape.strips(row[None])[0].ravel()
        seen = points.tolist() if np.isfinite(points).all() else []
        return [since, level, *(_number(value, 3) for value in seen)]
    return [since, level, *(_number(value, 3) for value in ends)]


def _number(value: float, digits: int) -> float | None:
    return None if math.isnan(value) else round(float(value), digits)


POSE = np.dtype([("folds_ns", "i8"), ("level", "u2"), ("x", "f4"), ("y", "f4"), ("robot", "u2")])
STAMP = np.dtype([("folds_ns", "i8"), ("number", "i8")])

MOST_CHANGES = 200
"""So many of the last changes are listed in words."""
TOLD = tuple(
    kind
    for kind in KINDS
    if not (kind.effect.is_sighting or kind in (PatrolStarted, PatrolFinished, RobotPose))
)
"""Kinds that are always listed; sightings are listed where they report another state."""

Rows = NDArray[Any]


@dataclass(slots=True)
class PageEvents:
    """The findings in the order in which they count: by (folds_ns, number)."""

    states: Rows
    """Rows of `STATE_CHANGE`, by door first."""
    rest: Rows
    """Rows of `CHANGE` that add, place or remove a door, or set its probabilities."""
    poses: Rows
    """Rows of `POSE`."""
    told: Rows
    """Rows of `STAMP`: the latest events of the kinds `TOLD`, and passages that failed."""
    events: int
    first_ns: int | None
    """When the first of the events happened; None: there are none."""
    last_ns: int | None


def gather(excerpt: Excerpt, progress: Callable[[int, int], None] | None = None) -> PageEvents:
    """Read the events of an excerpt."""
    reading = _Reading(robots_of(excerpt.log.info.robot))
    for batch in excerpt.happened(progress):
        reading.take(batch)
    return reading.page_events()


@dataclass(slots=True)
class _Reading:
    robots: tuple[str, ...]
    states: list[Rows] = field(default_factory=lambda: [np.empty(0, door_changes.STATE_CHANGE)])
    rest: list[Rows] = field(default_factory=lambda: [np.empty(0, door_changes.CHANGE)])
    poses: list[Rows] = field(default_factory=lambda: [np.empty(0, POSE)])
    told: Rows = field(default_factory=lambda: np.empty(0, STAMP))
    events: int = 0
    first_ns: int | None = None
    last_ns: int | None = None

    def take(self, batch: EventBatch) -> None:
        folds_ns = batch.folds_ns
        first_ns, last_ns = int(folds_ns.min()), int(folds_ns.max())
        self.first_ns = first_ns if self.first_ns is None else min(self.first_ns, first_ns)
        self.last_ns = last_ns if self.last_ns is None else max(self.last_ns, last_ns)
        self.events += len(batch)
        self.states += door_changes.parts_of(
            batch, door_changes.STATE_CHANGE, setting=door_changes.STATE
        )
        self.rest += door_changes.parts_of(
            batch, door_changes.CHANGE, setting=door_changes.EVERYTHING & ~door_changes.STATE
        )
        if RobotPose in batch:
            self.poses.append(_poses(batch, self.robots))
        self._tell(batch)

    def page_events(self) -> PageEvents:
        states, rest = np.concatenate(self.states), np.concatenate(self.rest)
        poses = np.concatenate(self.poses)
        return PageEvents(
            states=states[np.lexsort((states["number"], states["folds_ns"], states["door_id"]))],
            rest=door_rows.sorted_by_stamp(rest),
            poses=poses[np.argsort(poses["folds_ns"], kind="stable")],
            told=self.told,
            events=self.events,
            first_ns=self.first_ns,
            last_ns=self.last_ns,
        )

    def _tell(self, batch: EventBatch) -> None:
        told = np.isin(batch.kind, [kind.kind for kind in TOLD])
        if DoorPassed in batch:
            told[batch.where(DoorPassed)[~batch[DoorPassed]["passed"].astype(bool)]] = True
        stamps = np.empty(int(np.count_nonzero(told)), STAMP)
        stamps["folds_ns"], stamps["number"] = batch.folds_ns[told], batch.number[told]
        self.told = door_rows.sorted_by_stamp(np.concatenate([self.told, stamps]))[-MOST_CHANGES:]


def _poses(batch: EventBatch, robots: tuple[str, ...]) -> Rows:
    poses = np.empty(len(batch.where(RobotPose)), POSE)
    poses["folds_ns"] = batch.folds_ns[batch.where(RobotPose)]
    poses["robot"] = robots_of_poses(batch, robots)
    with np.errstate(over="ignore"):  # what float32 cannot hold is nowhere near a building
        for name in ("level", "x", "y"):
            poses[name] = batch[RobotPose][name]
    finite: Rows = poses[np.isfinite(poses["x"]) & np.isfinite(poses["y"])]
    return finite
