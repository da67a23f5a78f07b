"""One round: its plan from what is believed, and a plan anew while the robot is under way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.belief_query import BeliefQuery
from semmap_log.analysis.planning.asked_beliefs import wait_s
from semmap_log.analysis.planning.door_chances import UNKNOWN_P, DoorChances
from semmap_log.analysis.planning.learnt_chances import LONGEST_S, learnt_chances, round_times_s
from semmap_log.analysis.planning.patrol_plan import LOOK_S, PatrolOptions, PatrolPlan, PlannedStop
from semmap_log.analysis.planning.patrol_round import PatrolRound, PatrolTarget, PlannedTry
from semmap_log.analysis.planning.patrol_targets import NotVisited, Wanted, WantedTarget
from semmap_log.analysis.planning.patrol_words import shut_in_words, why_then
from semmap_log.analysis.planning.round_news import RoundNews
from semmap_log.analysis.planning.round_task import RoundTask
from semmap_log.analysis.planning.ways_between import WaysBetween
from semmap_log.analysis.probabilities.belief_fold import Beliefs
from semmap_log.analysis.rooms import Place
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.errors import PlanError

THROUGH_P = 0.8
"""Ways lead through doors that are at least so likely open; through others only if they must."""
A_WAY_S = 30.0
"""From stop to stop, for how far ahead P is looked up; later times keep the last."""


@dataclass(frozen=True, slots=True)
class AskedRound:
    """What is believed, and from when on the round is."""

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
    """A plan, and what it takes to go on with it while the robot is under way."""

    plan: PatrolPlan
    order: PatrolRound
    """Its doors are places among `doors`."""
    doors: tuple[RoundDoor, ...]
    chances: DoorChances
    """Of all doors of the map."""
    news: RoundNews
    planner: RoundPlanner

    @property
    def targets(self) -> list[WantedTarget]:
        """What is to be visited, each once."""
        found: list[WantedTarget] = []
        for door in self.doors:
            if door.target not in found:
                found.append(door.target)
        return found


class RoundPlanner:
    """Plans one round, and learns of its doors while the robot is under way."""

    def __init__(
        self, asked: AskedRound, ways: WaysBetween, options: PatrolOptions, where: Place | None
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
        """Return the plan for what is wanted, and its round.

        Raises:
            PlanError: Nothing of it can be visited.
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
        round_ = PatrolRound(
            self._task([entry.row for entry in reached], from_start_s, leg_s),
            [PatrolTarget(str(number), tuple(doors)) for number, doors in by_target.items()],
            skipped=np.array([self._is_skipped[entry.row] for entry in reached]),
        )
        for shut in round_.left_out:
            rows = [reached[door].row for door in shut.doors]
            said = shut_in_words(self._chosen, rows)
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
        self, planned: PlannedTry, entries: Sequence[RoundDoor], chances: DoorChances
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
            why_then(chances, entry.row, planned, self._options.skip),
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
            notes.append(f"UNKNOWN doors, of which too little was seen, count {as_others}")
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
        """Return the doors that can be come to, and the times from the start and between them."""
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
        """Return the expected wait until the door is open, where the estimator tells."""
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
