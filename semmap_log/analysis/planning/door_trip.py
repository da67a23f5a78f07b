"""A trip through a log's building: how long it takes, and what to do at doors that are shut.

A trip can only lead through doors on a way that enters no room twice.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semmap_log.analysis.beliefs.door_beliefs import BeliefQuery
from semmap_log.analysis.planning.door_chances import (
    UNKNOWN_P,
    DoorChances,
    PassingProjection,
    beliefs_at,
    learnt_chances,
    round_times_s,
    wait_s,
)
from semmap_log.analysis.planning.patrol_plan import NamedPlaces, WaysBetween
from semmap_log.analysis.planning.round_task import (
    GOAL,
    MOST_DOORS,
    NOTHING,
    START,
    ShutDoorChoice,
    TripDoor,
    TripPolicy,
    TripTask,
    opened,
)
from semmap_log.analysis.rooms.door_ways import Place
from semmap_log.analysis.rooms.level_rooms import room_plan
from semmap_log.analysis.rooms.room_graph import OUTSIDE, RoomGraph, RoomId
from semmap_log.analysis.rooms.walking import SPEED_M_S
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.moments import SECOND_NS, Moment, Time
from semmap_log.core.texts import counted
from semmap_log.errors import PlanError
from semmap_log.log import DoorLog

ON_REQUEST_P = 0.5
"""P(a shut door opens for who asks) where nobody has tried; the answer says that it is assumed."""
LEAST_SHUT = 0.001
LONGEST_TRIP_S = 3600.0
"""P is looked up for so long ahead."""


@dataclass(frozen=True, slots=True)
class TripStop:
    """A door on the way, as the trip goes if each is open."""

    door: Door
    arrives_ns: int
    p_open: float
    low: float
    high: float
    is_known: bool
    """False: UNKNOWN; P is the others' mean, and the wait is unknown."""
    wait_s: float | None
    """The wait once it was found shut; None: unknown."""
    p_answers: float | None
    """P(it opens for who asks); None: one cannot ask."""
    if_shut: ShutDoorChoice


@dataclass(frozen=True, slots=True)
class DoorTrip:
    """A trip, planned."""

    start: Place
    goal: Place
    depart_ns: int
    known_ns: int
    tz: str
    estimator: str
    walk_s: float
    """If no door is shut."""
    expected_s: float
    """On average; inf: the wait is unknown where there is no other way."""
    stops: tuple[TripStop, ...]
    others: tuple[Door, ...]
    """Doors of other ways, which count if one of the stops is shut."""
    notes: tuple[str, ...]


def door_trip(
    log: DoorLog,
    start_at: str,
    goal_at: str,
    *,
    depart: Time = None,
    estimator: str | None = None,
    tz: str | None = None,
    speed_m_s: float = SPEED_M_S,
    asks: bool = False,
    patience_s: float | None = None,
    progress: Progress | None = None,
) -> DoorTrip:
    """Return how long a trip takes on average, and what to do at doors that are shut.

    Args:
        log: The log of the building.
        start_at: From where: `X,Y`, `X,Y,LEVEL`, a room, or a door (the left of its line).
        goal_at: To where; before a door, on the side that is reached first.
        depart: The departure; default: the log's end. For an earlier time only events up to then
            count.
        estimator: Default: `filter` up to a day after the log's end, `schedule` beyond, which has
            no waits.
        tz: IANA zone of the building's clocks; None: the log's.
        speed_m_s: The robot's speed.
        asks: Whether the robot may ask for doors.
        patience_s: The longest wait; anything later counts as zero. None: it waits until the door
            is open.
        progress: Called with the progress of reading.

    Raises:
        PlanError: There is no such place, no way from one to the other, no map then, or no
            patience at all.
        EstimatorError: There is no such estimator.
        MomentError: The time or the zone cannot be read.
    """
    query, depart_ns = beliefs_at(log, depart, estimator=estimator, tz=tz, progress=progress)
    at = None if depart_ns > query.known_ns else Moment(ns=depart_ns)
    ways = WaysBetween(room_plan(log, at=at), speed_m_s=speed_m_s)
    names = NamedPlaces(log, ways, at)
    if patience_s is not None and not (math.isfinite(patience_s) and patience_s > 0):
        raise PlanError(f"patience: expected a time above 0 s, got {patience_s:g} s.")
    if not (ways.plan.floors or query.doors):
        told = f" The log {ways.plan.why_no_plan()}." if ways.plan.later else ""
        raise PlanError(f"go: neither a floor plan nor a door is in the map then.{told}")
    start = names.place(start_at, "FROM")
    goal = names.place(goal_at, "TO", seen_from=start)
    passing = None
    if asks:
        fold = PassingProjection(query.estimator, query.clock.tz)
        passing = log.fold(fold, at)
    way = _Way(ways, start, goal)
    chances, asked = (
        None if beliefs is None else learnt_chances(
            beliefs, [door.door_id for door in query.doors], known_ns=query.known_ns,
            start_ns=depart_ns, times_s=round_times_s(LONGEST_TRIP_S),
        )
        for beliefs in (query.beliefs, passing)
    )  # fmt: skip
    assert chances is not None
    return _Trip(_Known(query, depart_ns, chances, asked, patience_s), way).planned()


@dataclass(frozen=True, slots=True)
class _Known:
    """What is known of all doors at the departure."""

    query: BeliefQuery
    depart_ns: int
    chances: DoorChances
    asked: DoorChances | None
    """Of passing; None: the robot does not ask."""
    patience_s: float | None


class _Way:
    """The doors of a trip, and the times between them."""

    def __init__(self, ways: WaysBetween, start: Place, goal: Place) -> None:
        self.start, self.goal = start, goal
        graph, door_map = ways.plan.graph, ways.plan.door_map
        in_lifts = {door for lift in graph.lifts for door in lift.doors}
        all_doors = {door_id for door_id in door_map.doors if door_id not in in_lifts}
        rooms = [ways.room_of(place) for place in (start, goal)]
        for place, room in zip((start, goal), rooms, strict=True):
            if room is None and place.level in ways.plan.floors:
                raise PlanError(_no_room(place))
        self.without_plan = ways.without_plan((start.level, goal.level))
        between = doors_between(graph, *rooms) if None not in rooms else []  # type: ignore[arg-type]
        with_sides = [
            (door, sides) for door in between
            if len(sides := ways.before(door_map[door])) == 2
        ]  # fmt: skip
        kept = self._nearest(ways, with_sides)
        self.left_out = len(with_sides) - len(kept)
        self.doors = [door_map[door] for door, _ in kept]
        places = [start, goal, *(place for _, sides in kept for place in sides)]
        self.walk_s = ways.between_s(places, places, all_doors)
        self.cross_s = np.array([
            float(ways.between_s(sides[:1], sides[1:], all_doors - {door})[0, 0])
            for door, sides in kept
        ])  # fmt: skip

    def _nearest(
        self, ways: WaysBetween, doors: Sequence[tuple[DoorId, list[Place]]]
    ) -> list[tuple[DoorId, list[Place]]]:
        """Return the doors of the least detours, as many as the computation allows."""
        if len(doors) <= MOST_DOORS:
            return list(doors)
        places = [sides[0] for _, sides in doors]
        detour_s = ways.between_s([self.start], places)[0] + ways.between_s(
            places, [self.goal]
        )[:, 0]  # fmt: skip
        nearest = np.sort(np.argsort(detour_s, kind="stable")[:MOST_DOORS])
        return [doors[place] for place in nearest.tolist()]


def _no_room(place: Place) -> str:
    return (
        f"({place.x:g}, {place.y:g}) on level {place.level} lies in no room: in a wall, or too "
        "near to a door; name a place in the open."
    )


def with_mean(waits_s: Sequence[float | None]) -> list[float]:
    """Return waits with unknown ones replaced by the mean of the others, or inf."""
    known = [wait for wait in waits_s if wait is not None]
    mean_s = sum(known) / len(known) if known else math.inf
    return [mean_s if wait is None else wait for wait in waits_s]


class _Trip:
    """Plans one trip."""

    def __init__(self, known: _Known, way: _Way) -> None:
        self._query = known.query
        self._depart_ns = known.depart_ns
        self._way = way
        self._chances = known.chances
        self._asked = known.asked
        self._patience_s = known.patience_s
        rows = {door.door_id: row for row, door in enumerate(known.query.doors)}
        self._rows = [rows[door.door_id] for door in way.doors]
        free = TripTask(way.walk_s, way.cross_s, (TripDoor(1.0, 0.0),) * len(way.doors))
        if not free.is_possible:
            raise PlanError(
                "go: no way leads from FROM to TO: no doors join their rooms, and no lift their "
                "levels."
            )
        self._soonest_s = free.shortest_s(frozenset(range(len(way.doors))))
        p_open = [self._p_open(door) for door in range(len(way.doors))]
        waits_s = with_mean([self._wait_s(door) for door in range(len(p_open))])
        doors = [
            TripDoor(p, wait, self._answers(self._rows[door], p))
            for door, (p, wait) in enumerate(zip(p_open, waits_s, strict=True))
        ]
        self._task = TripTask(way.walk_s, way.cross_s, tuple(doors))

    def planned(self) -> DoorTrip:
        """Return the trip."""
        policy = TripPolicy(self._task)
        stops, place, found, now_s = [], START, NOTHING, 0.0
        while math.isfinite(policy.expected_s):
            target, _ = policy.next_place(place, found)
            now_s += policy.walk_s(place, target, found)
            if target == GOAL:
                break
            door = TripTask.door_at(target)
            stops.append(self._stop(door, now_s, policy.when_shut(target, found)))
            now_s += float(self._task.cross_s[door])
            place, found = TripTask.other_side(target), opened(found, door)
        way, query = self._way, self._query
        on_way = {stop.door.door_id for stop in stops}
        return DoorTrip(
            way.start, way.goal, self._depart_ns, query.known_ns, query.clock.tz, query.estimator,
            float(self._soonest_s[START, GOAL]), policy.expected_s, tuple(stops),
            tuple(door for door in way.doors if door.door_id not in on_way),
            tuple(self._notes(policy)),
        )  # fmt: skip

    def _p_open(self, door: int) -> float:
        """Return P on arrival at a door, if the others are open."""
        return self._p_at(self._chances, self._rows[door], self._arrival_s(door))

    def _arrival_s(self, door: int) -> float:
        return float(self._soonest_s[START, list(TripTask.sides(door))].min())

    @staticmethod
    def _p_at(chances: DoorChances, row: int, after_s: float) -> float:
        times_s = np.arange(chances.p_passes.shape[1]) * chances.step_s
        return float(np.interp(after_s, times_s, chances.p_passes[row]))

    def _wait_s(self, door: int) -> float | None:
        """Return the expected wait at a door that was found shut; None: unknown."""
        if not self._chances.is_known[self._rows[door]]:
            return None
        arrives_ns = self._depart_ns + round(self._arrival_s(door) * SECOND_NS)
        door_id = self._way.doors[door].door_id
        return wait_s(self._query, door_id, arrives_ns, most_s=self._patience_s, is_shut=True)

    def _answers(self, row: int, p_open: float) -> float:
        """Return P(a shut door opens for who asks), from how often tries got through."""
        if self._asked is None:
            return 0.0
        if not self._asked.is_known[row]:
            return ON_REQUEST_P
        passes = float(self._asked.p_passes[row, 0])
        return min(1.0, max(0.0, (passes - p_open) / max(1 - p_open, LEAST_SHUT)))

    def _stop(self, door: int, now_s: float, choice: ShutDoorChoice) -> TripStop:
        row, expected = self._rows[door], self._task.doors[door]
        low, high = self._chances.interval_at(row, self._arrival_s(door))
        return TripStop(
            self._way.doors[door], self._depart_ns + round(now_s * SECOND_NS), expected.p_open,
            low, high, bool(self._chances.is_known[row]),
            expected.wait_s if math.isfinite(expected.wait_s) else None,
            None if self._asked is None else expected.p_answers, choice,
        )  # fmt: skip

    def _notes(self, policy: TripPolicy) -> list[str]:
        notes = []
        if self._patience_s is not None:
            notes.append(
                f"waits count up to {self._patience_s:g} s, as if the door were open then; "
                "a robot that leaves is not there yet"
            )
        if self._way.without_plan:
            notes.append(f"{self._way.without_plan}; doors do not count")
        unknown = [
            door.label for door, row in zip(self._way.doors, self._rows, strict=True)
            if not self._chances.is_known[row]
        ]  # fmt: skip
        if unknown:
            counted_as = "that of all doors on average"
            if not self._chances.is_known.any():
                counted_as = f"{UNKNOWN_P:g}, since nothing is known of any door"
            notes.append(
                f"UNKNOWN, too little seen: {', '.join(unknown)}; P counts as {counted_as}, "
                "the wait as that of the others on the way, where one is known"
            )
        if self._asked is not None:
            untried = [
                door.label for door, row in zip(self._way.doors, self._rows, strict=True)
                if not self._asked.is_known[row]
            ]  # fmt: skip
            if untried:
                notes.append(f"never asked for: {', '.join(untried)}; counted as {ON_REQUEST_P:g}")
        if not math.isfinite(policy.expected_s):
            notes.append(
                "no expected time: each way leads through a door whose wait when shut is unknown"
            )
        if self._way.left_out:
            others = counted(self._way.left_out, "door")
            notes.append(
                f"{others} of longer ways taken to be shut: of more than {MOST_DOORS} "
                f"doors not all can be thought through"
            )
        return notes


Pair = frozenset[RoomId]


def doors_between(graph: RoomGraph, start: RoomId, goal: RoomId) -> list[DoorId]:
    """Return the doors on the ways between two rooms, ascending; none: they are one room.

    A way never returns to the room that it came from: so these are few of all doors. The outside is
    only on ways that begin or end there.
    """
    if start == goal:
        return []
    doors = _doors_of_pairs(graph, {start, goal})
    wanted = frozenset((start, goal))
    pairs = set(doors) | {wanted}
    block = next(block for block in _blocks(pairs, start) if wanted in block)
    return sorted(door for pair in block for door in doors.get(pair, ()))


def _doors_of_pairs(graph: RoomGraph, ends: set[RoomId]) -> dict[Pair, list[DoorId]]:
    """Return the doors between each two rooms; a lift joins rooms without one."""
    doors: defaultdict[Pair, list[DoorId]] = defaultdict(list)
    for door_id, doorway in graph.doorways.items():
        if doorway.joins_two and graph.lift_of(door_id) is None:
            doors[frozenset((doorway.left, doorway.right))].append(door_id)  # type: ignore[arg-type]
    for lift in graph.lifts:
        stops = [graph.doorways[door] for door in lift.doors if door in graph.doorways]
        rooms = {side for each in stops for side in (each.left, each.right) if side is not None}
        for one in rooms:
            for other in rooms - {one}:
                doors[frozenset((one, other))] += []
    return {pair: ids for pair, ids in doors.items() if OUTSIDE not in pair or OUTSIDE in ends}


def _blocks(pairs: set[Pair], start: RoomId) -> list[set[Pair]]:
    """Return the biconnected components of a graph, as sets of their edges.

    J. Hopcroft, R. Tarjan, Commun. ACM 16, 1973; without recursion.
    """
    beside: defaultdict[RoomId, list[RoomId]] = defaultdict(list)
    for one, other in sorted(tuple(sorted(pair)) for pair in pairs):
        beside[one].append(other)
        beside[other].append(one)
    depth, low = {start: 0}, {start: 0}
    path, edges, blocks = [(start, iter(beside[start]))], list[Pair](), list[set[Pair]]()
    while path:
        here, onward = path[-1]
        there = next(onward, None)
        before = path[-2][0] if len(path) > 1 else None
        if there is None:
            path.pop()
            if before is not None:
                low[before] = min(low[before], low[here])
                if low[here] >= depth[before]:
                    cut = edges.index(frozenset((before, here)))
                    blocks.append(set(edges[cut:]))
                    del edges[cut:]
        elif there not in depth:
            depth[there] = low[there] = len(path)
            edges.append(frozenset((here, there)))
            path.append((there, iter(beside[there])))
        elif there != before and depth[there] < depth[here]:
            low[here] = min(low[here], depth[there])
            edges.append(frozenset((here, there)))
    return blocks
