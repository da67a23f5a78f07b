"""Plan a patrol from what is believed: in which order to visit rooms or doors, and why.

The plan says what to expect at each stop, why a stop is where it is, and why another was left out.
It starts where the robot was last. Reports on doors during the round change their chances, and the
plan is made again while the robot is under way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypedDict

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.door_beliefs import BeliefQuery
from semmap_log.analysis.planning import patrol_round
from semmap_log.analysis.planning.door_chances import (
    LONGEST_S,
    UNKNOWN_P,
    DoorChances,
    PassingProjection,
    SkipRule,
    beliefs_at,
    learnt_chances,
    passings_in,
    round_times_s,
    wait_s,
)
from semmap_log.analysis.planning.patrol_plan import (
    LOOK_S,
    NamedPlaces,
    NotVisited,
    PatrolOptions,
    PatrolPlan,
    PlannedStop,
    Wanted,
    WantedTarget,
    WaysBetween,
    all_wanted,
    check_options,
    wanted_by_name,
)
from semmap_log.analysis.planning.round_task import RoundTask
from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs
from semmap_log.analysis.rooms.door_ways import Place
from semmap_log.analysis.rooms.level_rooms import room_plan
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.events import RobotPose
from semmap_log.core.model.moments import SECOND_NS, Moment, Time
from semmap_log.errors import PlanError
from semmap_log.log import DoorLog

if TYPE_CHECKING:
    from typing_extensions import Unpack


class RoundWish(TypedDict, total=False):
    """The keywords of `patrol_plan`, which documents them; `begun_round` takes them, too."""

    start_at: str | None
    rooms: Sequence[str]
    doors: Sequence[str]
    start: Time
    estimator: str | None
    tz: str | None
    options: PatrolOptions
    progress: Progress | None


def patrol_plan(log: DoorLog, **wish: Unpack[RoundWish]) -> PatrolPlan:
    """Return the order of rooms and doors with the least mean time to visit.

    Args:
        log: The log of the building.
        start_at: Where the robot starts: `X,Y`, `X,Y,LEVEL`, a room, or a door; None: where the
            log saw it last.
        rooms: Numbers or names of rooms to visit.
        doors: Ids or names of doors to go through; without either: all rooms.
        start: The start; default: the log's end. For an earlier time only events up to then
            count.
        estimator: None: `filter` up to a day after the log's end, `schedule` beyond.
        tz: IANA zone of the building's clocks; None: the log's.
        options: The options of the round.
        progress: Called with the progress of reading.

    Raises:
        PlanError: There is nothing to visit, no such place, no time, or no way.
        UnknownDoorError: There is no such door.
        EstimatorError: There is no such estimator.
        MomentError: The time or the zone cannot be read.
    """
    return begun_round(log, **wish).plan


def begun_round(
    log: DoorLog,
    *,
    start_at: str | None = None,
    rooms: Sequence[str] = (),
    doors: Sequence[str] = (),
    start: Time = None,
    estimator: str | None = None,
    tz: str | None = None,
    options: PatrolOptions = PatrolOptions(),
    progress: Progress | None = None,
) -> BegunRound:
    """Return the plan with all that is needed to continue it: see `FollowedRound`.

    Its keywords are those of `patrol_plan`.

    Raises:
        PlanError: There is nothing to visit, no such place, no time, or no way.
        UnknownDoorError: There is no such door.
        EstimatorError: There is no such estimator.
        MomentError: The time or the zone cannot be read.
    """
    check_options(options)
    query, start_ns = beliefs_at(
        log, start, estimator=estimator, tz=tz,
        progress=progress,
    )  # fmt: skip
    at = None if start_ns > query.known_ns else Moment(ns=start_ns)
    ways = WaysBetween(room_plan(log, at=at), speed_m_s=options.speed_m_s)
    names = NamedPlaces(log, ways, at)
    where = _start_place(log, names, start_at, at)
    if rooms or doors:
        wanted = wanted_by_name(ways, names, rooms, doors, where)
    else:
        wanted = all_wanted(ways, where)
    passing = None
    if options.asks:
        passing = log.fold(PassingProjection(query.estimator, query.clock.tz), at)
    return RoundPlanner(RoundQuery(query, start_ns, passing), ways, options, where).begun(wanted)


def _start_place(
    log: DoorLog, names: NamedPlaces, start_at: str | None, at: Moment | None
) -> Place | None:
    if start_at is not None:
        return names.place(start_at, "--from")
    last = log.fold(LastPoseProjection(), at)
    if last is None or _was_remapped(log, last[1].level, last[0], at):
        return None
    return last[1]


def _was_remapped(log: DoorLog, level: int, since_ns: int, at: Moment | None) -> bool:
    """Return whether a level got another floor map since, on which older places are invalid."""
    since = Moment(ns=max(since_ns, log.horizon_ns()))
    then, now = (log.replay(at=moment).levels.get(level) for moment in (since, at))
    known = None if then is None else then.floor_map_event
    return known is not None and now is not None and now.floor_map_event != known


THROUGH_P = 0.8
"""Ways lead through doors that are at least so likely open; through others only if they must."""
A_WAY_S = 30.0
"""From stop to stop, for how far ahead P is looked up; later times keep the last."""


@dataclass(frozen=True, slots=True)
class RoundQuery:
    """The beliefs, and the start of the round."""

    query: BeliefQuery
    start_ns: int
    passing: Beliefs | None
    """Of P(passes); None: the robot does not ask."""


@dataclass(frozen=True, slots=True)
class RoundDoor:
    """A door by which to go in."""

    target: WantedTarget
    door: Door
    place: Place
    """Where to stand before it."""
    row: int
    """Of the chances."""


@dataclass(frozen=True, slots=True)
class BegunRound:
    """A plan, and all that is needed to continue it while the robot is under way."""

    plan: PatrolPlan
    order: patrol_round.PatrolRound
    """Its doors are places among `doors`."""
    doors: tuple[RoundDoor, ...]
    chances: DoorChances
    """Of all doors of the map."""
    news: RoundNews
    planner: RoundPlanner

    @property
    def targets(self) -> list[WantedTarget]:
        """The targets, each once."""
        found: list[WantedTarget] = []
        for door in self.doors:
            if door.target not in found:
                found.append(door.target)
        return found


class RoundPlanner:
    """Plans one round, and learns of its doors while the robot is under way."""

    def __init__(
        self, asked: RoundQuery, ways: WaysBetween, options: PatrolOptions, where: Place | None
    ) -> None:
        self._query = asked.query
        self._passing = asked.passing
        self._start_ns = asked.start_ns
        self.ways = ways
        self._options = options
        self._where = where
        self._ids = [door.door_id for door in asked.query.doors]
        self._row = {door_id: row for row, door_id in enumerate(self._ids)}
        self._open = self._chances(asked.query.beliefs)
        self._chosen = self._open
        if asked.passing is not None:
            self._chosen = self._chances(asked.passing).or_else(self._open)
        self._is_skipped = options.skip.is_skipped(self._chosen)

    def begun(self, wanted: Wanted) -> BegunRound:
        """Return the plan for the wanted targets, and its round.

        Raises:
            PlanError: None of them can be visited.
        """
        targets, left_out = wanted
        entries = [
            RoundDoor(target, door, self.ways.nearest(places, self._where), self._row[door.door_id])
            for target in targets
            for door, places in zip(target.doors, target.places, strict=True)
        ]
        reached, from_start_s, leg_s = self._reached(entries)
        left_out = [*left_out, *self._unreached(entries, reached)]
        if not reached:
            raise PlanError(_nothing(left_out))
        by_target: dict[int, list[int]] = {}
        for place, entry in enumerate(reached):
            by_target.setdefault(targets.index(entry.target), []).append(place)
        round_ = patrol_round.PatrolRound(
            self._task([entry.row for entry in reached], from_start_s, leg_s),
            [
                patrol_round.PatrolTarget(str(number), tuple(doors))
                for number, doors in by_target.items()
            ],
            skipped=np.array([self._is_skipped[entry.row] for entry in reached]),
        )
        for shut in round_.left_out:
            rows = [reached[door].row for door in shut.doors]
            said = shut_text(self._chosen, rows)
            left_out.append(NotVisited(targets[int(shut.name)].name, "shut", said))
        left_out += [
            NotVisited(targets[int(late.name)].name, "budget", "reached after the budget")
            for late in round_.cut_off()
        ]
        stops = [self.stop(each, reached, self._chosen) for each in round_.plan()]
        news = RoundNews(
            self._query, self._passing, self._start_ns, self._times_s_of_round(), self._open.mean()
        )
        plan = self._made(stops, left_out)
        return BegunRound(plan, round_, tuple(reached), self._chosen, news, self)

    def stop(
        self, planned: patrol_round.PlannedTry, entries: Sequence[RoundDoor], chances: DoorChances
    ) -> PlannedStop:
        """Return a try as a stop, by what is known of the doors."""
        entry = entries[planned.door]
        arrives_ns = self._start_ns + round(planned.arrives_s * SECOND_NS)
        low, high = chances.interval_at(entry.row, planned.arrives_s)
        others = [
            entries[other].door
            for other in planned.target.doors
            if other != planned.door and not self._is_skipped[entries[other].row]
        ]
        return PlannedStop(
            entry.target, entry.door, entry.place, tuple(others), arrives_ns, planned.p_passes,
            low, high, bool(chances.is_known[entry.row]),
            self._wait_s(entry.door.door_id, arrives_ns),
            why_tried(chances, entry.row, planned, self._options.skip),
        )  # fmt: skip

    def _made(self, stops: list[PlannedStop], left_out: list[NotVisited]) -> PatrolPlan:
        chances = np.array([stop.p_passes for stop in stops])
        times_s = np.array([(s.arrives_ns - self._start_ns) / SECOND_NS for s in stops])
        visits = float(chances.sum())
        query = self._query
        return PatrolPlan(
            self._start_ns, query.known_ns, query.clock.tz, query.estimator, self._options,
            self._where, tuple(stops), tuple(left_out),
            float((chances * times_s).sum() / visits) if visits > 0 else math.nan,
            visits, tuple(self._notes(stops)), self._avoided(),
        )  # fmt: skip

    def _notes(self, stops: list[PlannedStop]) -> list[str]:
        notes = []
        if self._where is None:
            notes.append("nobody said where the robot is: the round begins at its first stop")
        if flat := self.ways.without_plan(stop.place.level for stop in stops):
            notes.append(flat)
        if not all(stop.is_known for stop in stops):
            as_others = "as the others do on average, and by their own looks at such hours"
            if not self._chosen.is_known.any():
                as_others = f"{UNKNOWN_P:g}, since nothing is known of any door"
            notes.append(f"UNKNOWN doors, with too few looks, count {as_others}")
        return notes

    def _chances(self, beliefs: Beliefs) -> DoorChances:
        return learnt_chances(
            beliefs, self._ids, known_ns=self._query.known_ns, start_ns=self._start_ns,
            times_s=self._times_s_of_round(),
        )  # fmt: skip

    def _times_s_of_round(self) -> NDArray[np.float64]:
        a_stop_s = A_WAY_S + max(self._options.enter_s, self._options.wait_s + LOOK_S)
        longest_s = self._options.budget_s or min(LONGEST_S, len(self._ids) * a_stop_s)
        return round_times_s(longest_s)

    def _reached(
        self, entries: list[RoundDoor]
    ) -> tuple[list[RoundDoor], NDArray[np.float64], NDArray[np.float64]]:
        """Return the reachable doors, and the times from the start and between them."""
        if not entries:
            return [], np.zeros(0), np.zeros((0, 0))
        places = [entry.place for entry in entries]
        start = places[:1] if self._where is None else [self._where]
        times_s = self._times_s([*start, *places], places)
        kept = np.flatnonzero(np.isfinite(times_s[0]))
        from_start_s, leg_s = times_s[0, kept], times_s[1:][np.ix_(kept, kept)]
        if self._where is None:
            from_start_s = np.zeros(len(kept))
        return [entries[place] for place in kept.tolist()], from_start_s, leg_s

    def _unreached(self, entries: list[RoundDoor], reached: list[RoundDoor]) -> list[NotVisited]:
        there = [entry.target for entry in reached]
        missed = [entry.target for entry in entries if entry.target not in there]
        start = self._where or entries[0].place if entries else None
        return [
            NotVisited(target.name, "no way", self._no_way(target, start))
            for place, target in enumerate(missed)
            if target not in missed[:place]
        ]

    def _no_way(self, target: WantedTarget, start: Place | None) -> str:
        level = target.doors[0].level
        if start is None or level == start.level:
            return "no way leads there"
        return f"no lift leads to level {self.ways.plan.door_map.level_name(level)}"

    def _times_s(self, sources: list[Place], targets: list[Place]) -> NDArray[np.float64]:
        found = self.ways.between_s(sources, targets, self._avoided())
        if np.isfinite(found).all():
            return found
        through_any = self.ways.between_s(sources, targets)
        return np.where(np.isfinite(found), found, through_any)

    def _avoided(self) -> frozenset[DoorId]:
        at_start = self._open.p_passes[:, 0]
        return frozenset(self._ids[row] for row in np.flatnonzero(at_start < THROUGH_P).tolist())

    def _task(
        self, rows: list[int], from_start_s: NDArray[np.float64], leg_s: NDArray[np.float64]
    ) -> RoundTask:
        alike = np.ones(len(rows))
        return RoundTask(
            from_start_s, leg_s, self._chosen.p_passes[rows], alike * self._options.enter_s,
            alike * (self._options.wait_s + LOOK_S), step_s=self._chosen.step_s,
            budget_s=self._options.budget_s,
        )  # fmt: skip

    def _wait_s(self, door_id: DoorId, arrives_ns: int) -> float | None:
        """Return the expected wait until the door is open, if the estimator provides it."""
        if not self._open.is_known[self._row[door_id]]:
            return None
        return wait_s(self._query, door_id, arrives_ns)


def _nothing(left_out: list[NotVisited]) -> str:
    """Return why there is no plan."""
    if not left_out:
        return "patrol-plan: nothing to visit."
    first = left_out[0]
    more = f" (and {len(left_out) - 1} more)" if len(left_out) > 1 else ""
    return f"patrol-plan: nothing can be visited. {first.name}: {first.said}{more}."


_Stamped = tuple[int, Place] | None


class LastPoseProjection:
    """The fold: the robot's last place and when it was there; None before the first."""

    name = "last_pose"
    version = 1

    def initial(self) -> _Stamped:
        """Return no place."""
        return None

    def apply(self, state: _Stamped, batch: EventBatch, /) -> _Stamped:
        """Fold a batch in."""
        if RobotPose not in batch:
            return state
        times_ns = batch.folds_ns[batch.where(RobotPose)]
        latest = len(times_ns) - 1 - int(times_ns[::-1].argmax())
        if state is not None and times_ns[latest] < state[0]:
            return state
        row = batch[RobotPose][latest]
        place = Place(int(row["level"]), float(row["x"]), float(row["y"]))
        return int(times_ns[latest]), place


@dataclass(slots=True)
class RoundNews:
    """What was known at a round's start, and what was reported since."""

    query: BeliefQuery
    passing: Beliefs | None
    """Of P(passes); None: the robot does not ask."""
    start_ns: int
    times_s: NDArray[np.float64]
    """(k,), times of the round at which P is computed."""
    mean: NDArray[np.float64]
    """(k,), P of the doors on average, for one of which too little is known."""

    def take_in(self, batch: EventBatch) -> None:
        """Take in reports on doors."""
        self.query.beliefs.evidence.apply(batch)
        if self.passing is not None:
            self.passing.evidence.apply(passings_in(batch))

    def relearn(self, log: DoorLog, event: int) -> None:
        """Learn from a log again, up to an event that retracted some of it."""
        estimator, tz = self.query.estimator, self.query.clock.tz
        beliefs = log.fold(BeliefProjection(estimator, tz), event=event)
        self.query = replace(self.query, beliefs=beliefs)
        if self.passing is not None:
            self.passing = log.fold(PassingProjection(estimator, tz), event=event)

    def chances(self, door_id: DoorId, known_ns: int) -> DoorChances:
        """Return those of one door as known at a moment; at earlier times of the round, as then."""
        by_state = self._learnt(self.query.beliefs, door_id, known_ns)
        if self.passing is None:
            return by_state
        return self._learnt(self.passing, door_id, known_ns).or_else(by_state)

    def _learnt(self, beliefs: Beliefs, door_id: DoorId, known_ns: int) -> DoorChances:
        since_s = (known_ns - self.start_ns) / SECOND_NS
        return learnt_chances(
            beliefs, [door_id], known_ns=known_ns, start_ns=self.start_ns,
            times_s=np.maximum(self.times_s, since_s), others=self.mean,
        )  # fmt: skip


CHANGES_BY = 0.15
"""P at arrival is shown next to P at the start where they differ by so much."""
HOUR_S = 3600.0


def why_tried(
    chances: DoorChances, row: int, planned: patrol_round.PlannedTry, skip: SkipRule
) -> str:
    """Return why a door is tried then."""
    if skip.seem_shut(chances)[row]:
        return f"seems shut, {unseen_text(float(chances.unseen_s[row]))}: looked at again"
    if not chances.is_known[row]:
        return "UNKNOWN: too little seen of it"
    now = float(chances.p_passes[row, 0])
    if abs(planned.p_passes - now) >= CHANGES_BY:
        turns = "opens" if planned.p_passes > now else "closes"
        return f"{turns} about then: {now:.2f} at the start"
    return (
        "likely open"
        if planned.p_passes >= patrol_round.EXPECTED_P
        else "more likely shut: worth a try"
    )


def shut_text(chances: DoorChances, rows: Sequence[int]) -> str:
    """Return why a target is left out all whose doors seem shut."""
    looks, found_open = (int(each) for each in chances.looks[list(rows)].sum(axis=0))
    high = max(float(chances.looks_high[row]) for row in rows)
    unseen = unseen_text(max(float(chances.unseen_s[row]) for row in rows))
    at_looks = f"at {looks - found_open} of {looks} looks at such hours"
    return f"shut {at_looks}, open at most {high:.2f} of the time; {unseen}"


def unseen_text(seconds: float) -> str:
    """Return how long ago a door was last seen."""
    if not math.isfinite(seconds):
        return "never looked at"
    if seconds < HOUR_S:
        return f"looked at {seconds / 60:.0f} min before"
    return f"looked at {seconds / HOUR_S:.0f} h before"
