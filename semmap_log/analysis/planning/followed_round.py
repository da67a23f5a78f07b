"""A round under way, as its log shows it: after each event, where the robot goes next.

What counts is what happened after the round's start:

- the robot passed a door, or is in a room: it is visited;
- it gave up at a door, or that door is seen shut while the robot stands before it, being sent
  there: the room's other door is tried, or the next room;
- any other door of the round is reported open or shut: its P is learnt again, by the same
  estimator, and the order is recomputed if the door is now expected to be otherwise;
- a door leaves the map: it is not gone to;
- `PatrolFinished`, or the budget: the round is over.

Events may come late, in any order, and be retracted. The round is what the valid events make of it
in the order in which they happened, whatever order they came in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

from semmap_log.analysis.planning.patrol_plan import PlannedStop, WantedTarget, middle_of
from semmap_log.analysis.planning.patrol_round import PatrolRound, PlannedTry
from semmap_log.analysis.planning.round_planner import BegunRound
from semmap_log.analysis.rooms.door_ways import Place
from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent, Retractions
from semmap_log.core.model import events as ev
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.meaning import Changed
from semmap_log.core.model.moments import SECOND_NS, Moment
from semmap_log.log import DoorLog

AT_DOOR_M = 2.0
"""The largest distance from a door's middle of a robot that stands before it."""
PAST_CHANGED = "what happened before came later, or was taken back"


@dataclass(frozen=True, slots=True)
class RoundStep:
    """A step: after an event the robot goes elsewhere, or the round is over."""

    event: int
    """Its number."""
    at_ns: int
    """When it happened."""
    because: str
    """What it reported."""
    stop: PlannedStop | None
    """Where to go now; None: the round is over."""
    left: int
    """Stops of the plan now, this one included."""
    visited: tuple[WantedTarget, ...]
    """So far, in that order."""


class FollowedRound:
    """A round, and its progress so far; deterministic in the events."""

    def __init__(self, begun: BegunRound, log: Callable[[], DoorLog]) -> None:
        """Begin the round.

        Args:
            begun: The round.
            log: Returns the log with all that is written, to learn from again when events are
                retracted.
        """
        self._begun = begun
        self._log = log
        self._start_ns = begun.plan.start_ns
        self._doors = _places_of(begun)
        self._targets = begun.targets
        self._taken: list[RecordedEvent] = []
        """In the order in which they happened."""
        self._restart()

    @property
    def visited(self) -> list[WantedTarget]:
        """The visited targets, in order."""
        return list(self._visited)

    @property
    def not_visited(self) -> list[WantedTarget]:
        """The planned targets that are not visited, yet or ever."""
        return [target for target in self._targets if target not in self._visited]

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to do."""
        return self._is_finished or self._order.next_try() is None

    def stops(self) -> list[PlannedStop]:
        """Return the remaining stops, in order."""
        return [] if self._is_finished else list(map(self._stop, self._order.plan()))

    def next_stop(self) -> PlannedStop | None:
        """Return where to go now; None: the round is over."""
        planned = None if self._is_finished else self._order.next_try()
        return None if planned is None else self._stop(planned)

    def take(self, batch: EventBatch) -> list[RoundStep]:
        """Take in events as they are recorded, and return the new steps.

        Raises:
            LogError: Some are retracted, and the remaining ones cannot be read.
        """
        known = self._taken
        if ev.Retracted in batch:
            known = self._without_retracted(batch)
            self._begun.news.relearn(self._log(), int(batch.number[-1]))
        else:
            self._begun.news.take_in(batch)
        new = [one for one in batch if self._counts(one)]
        is_late = bool((batch.folds_ns <= self._start_ns).any())
        ordered = sorted([*known, *new], key=_when)
        if len(known) == len(self._taken) and ordered[: len(known)] == known and not is_late:
            self._taken = ordered
            return self._steps(ordered[len(known) :])
        return self._redo_round(ordered, batch)

    def _without_retracted(self, batch: EventBatch) -> list[RecordedEvent]:
        hidden = Retractions()
        hidden.apply(batch)
        return [one for one in self._taken if hidden.first_hiding(one.number) is None]

    def _counts(self, one: RecordedEvent) -> bool:
        if _when(one)[0] <= self._start_ns:
            return False
        event = one.event
        if isinstance(event, ev.DoorEvent):
            return event.door_id in self._doors
        return isinstance(event, (ev.RobotPose, ev.PatrolFinished))

    def _restart(self) -> None:
        self._order: PatrolRound = self._begun.order.copied()
        self._chances = self._begun.chances
        self._told: dict[DoorId, str] = {}
        """Door -> what was last reported of it during the round."""
        self._visited: list[WantedTarget] = []
        self._robot = self._begun.plan.start
        self._is_finished = False

    def _redo_round(self, events: list[RecordedEvent], batch: EventBatch) -> list[RoundStep]:
        """Go through the round again; if that leads elsewhere, it is one step."""
        before = self._now()
        self._restart()
        self._taken = events
        for one in events:
            self._apply(one)
        if self._now() == before or not len(batch):
            return []
        return [self._step(int(batch.number[-1]), int(batch.folds_ns[-1]), PAST_CHANGED)]

    def _steps(self, events: Iterable[RecordedEvent]) -> list[RoundStep]:
        steps = []
        for one in events:
            before = self._now()
            because = self._apply(one)
            if because is not None and self._now() != before:
                steps.append(self._step(one.number, _when(one)[0], because))
        return steps

    def _now(self) -> tuple[int | None, int]:
        """Return the next door and the number of rooms visited; a change in either is a step."""
        planned = None if self._is_finished else self._order.next_try()
        return (None if planned is None else planned.door), len(self._visited)

    def _step(self, event: int, at_ns: int, because: str) -> RoundStep:
        stops = self.stops()
        return RoundStep(
            event, at_ns, because, stops[0] if stops else None, len(stops), tuple(self._visited)
        )

    def _apply(self, one: RecordedEvent) -> str | None:
        """Take in an event; return what it reported, if that concerns the round."""
        if self.is_over:
            return None
        at_ns, event = _when(one)[0], one.event
        now_s = (at_ns - self._start_ns) / SECOND_NS
        budget_s = self._begun.plan.options.budget_s
        if isinstance(event, ev.PatrolFinished) or (budget_s is not None and now_s > budget_s):
            self._is_finished = True
            return "the round was finished" if isinstance(event, ev.PatrolFinished) else "budget"
        self._not_before(now_s)
        if isinstance(event, ev.RobotPose):
            return self._stands(Place(event.level, event.x, event.y), now_s)
        assert isinstance(event, ev.DoorEvent)
        if isinstance(event, ev.DoorPassed):
            return self._tried(event, at_ns, now_s)
        if isinstance(event, ev.DoorRemoved):
            for place in self._doors[event.door_id]:
                self._order.rule_out(place)
            return f"{self._label(event.door_id)} was removed"
        if event.sets() & Changed.STATE:
            return self._seen(event.door_id, event.values_set()["state"], at_ns, now_s)
        return None

    def _not_before(self, now_s: float) -> None:
        """Postpone the plan if the robot is late: the next stop cannot lie in the past."""
        planned = self._order.next_try()
        if planned is not None and planned.arrives_s < now_s:
            self._order.now_s += now_s - planned.arrives_s

    def _stands(self, where: Place, now_s: float) -> str | None:
        self._robot = where
        room = self._begun.planner.ways.room_of(where)
        inside = [t for t in self._targets if t.room == room and t not in self._visited]
        if room is None or not inside:
            return None
        by = self._places_of_target(inside[0])
        self._visit(self._chosen(by), now_s)
        return f"the robot is in {inside[0].name}"

    def _tried(self, event: ev.DoorPassed, at_ns: int, now_s: float) -> str:
        label = self._label(event.door_id)
        places = [p for p in self._doors[event.door_id] if self._target(p) not in self._visited]
        if not places:  # it comes out of the room again
            self._order.now_s = now_s
        elif event.passed:
            self._visit(self._chosen(places), now_s)
        else:
            self._fail(places, now_s)
        if event.passed:
            self._learn(event.door_id, "told on the way: passed", at_ns)
        return f"{label}: passed" if event.passed else f"{label}: gave up"

    def _seen(self, door_id: DoorId, state: DoorState, at_ns: int, now_s: float) -> str | None:
        label, places = self._label(door_id), self._doors[door_id]
        planned = self._order.next_try()
        is_sent = planned is not None and planned.door in places
        if state is DoorState.CLOSED and is_sent and self._is_at(door_id):
            self._fail([place for place in places if self._order.is_left(place)], now_s)
            return f"{label}: shut, the robot is there"
        self._learn(door_id, f"told on the way: {state.name}", at_ns)
        return f"{label}: {state.name}"

    def _visit(self, place: int, now_s: float) -> None:
        """Record that the robot goes in; it continues after its time inside."""
        self._visited.append(self._target(place))
        left_s = now_s + self._begun.plan.options.enter_s
        self._order.tell(place, passed=True, now_s=left_s)

    def _fail(self, places: list[int], now_s: float) -> None:
        left = [place for place in places if self._order.is_left(place)]
        if not left:  # reported already
            self._order.now_s = now_s
            return
        first = self._chosen(left)
        self._order.tell(first, passed=False, now_s=now_s)
        for place in left:
            if place != first:
                self._order.rule_out(place)

    def _learn(self, door_id: DoorId, said: str, at_ns: int) -> None:
        """Learn a door's P again, if the robot may still go there."""
        left = [place for place in self._doors[door_id] if self._order.is_left(place)]
        if not left:
            return
        learnt = self._begun.news.chances(door_id, at_ns)
        self._chances = self._chances.with_row(self._begun.doors[left[0]].row, learnt)
        self._told[door_id] = said
        for place in left:
            self._order.learn(place, learnt.p_passes[0])

    def _is_at(self, door_id: DoorId) -> bool:
        door, robot = self._begun.doors[self._doors[door_id][0]].door, self._robot
        if robot is None or robot.level != door.level:
            return False
        middle = middle_of(door)
        return math.dist((middle.x, middle.y), (robot.x, robot.y)) <= AT_DOOR_M

    def _chosen(self, places: list[int]) -> int:
        """Return the door, of some, by which the robot goes: the one that it was sent to."""
        planned = self._order.next_try()
        return planned.door if planned is not None and planned.door in places else places[0]

    def _places_of_target(self, target: WantedTarget) -> list[int]:
        doors = enumerate(self._begun.doors)
        return [place for place, door in doors if door.target is target]

    def _target(self, place: int) -> WantedTarget:
        return self._begun.doors[place].target

    def _label(self, door_id: DoorId) -> str:
        return self._begun.doors[self._doors[door_id][0]].door.label

    def _stop(self, planned: PlannedTry) -> PlannedStop:
        begun = self._begun
        stop = begun.planner.stop(planned, begun.doors, self._chances)
        told = self._told.get(stop.door.door_id)
        return stop if told is None else replace(stop, why=told)


def events_since(
    log: DoorLog, start_ns: int, *, stop: Callable[[], bool] | None = None
) -> Iterator[EventBatch]:
    """Yield a log's events after a moment, then new ones as they are recorded.

    Args:
        log: As it was opened when the round was planned.
        start_ns: The moment.
        stop: Called before each poll; once it returns true, the iteration ends with what is there.

    Raises:
        LogError: The log is damaged, or another lies there now.
    """
    last = log.last_event()
    yield from log.batches(since=Moment(ns=start_ns + 1))
    for followed in log.follow(last, stop=stop):
        yield followed.batch


def _when(one: RecordedEvent) -> tuple[int, int]:
    """Return the sort key of events."""
    return min(one.happened_ns, one.recorded_ns), one.number


def _places_of(begun: BegunRound) -> dict[DoorId, list[int]]:
    """Return the places of each door in a round: one for each target that it leads into."""
    places: dict[DoorId, list[int]] = {}
    for place, door in enumerate(begun.doors):
        places.setdefault(door.door.door_id, []).append(place)
    return places
