"""What becomes of the events of a log in the view of a join.

Doors and levels get the building's numbers, poses its frame, rounds numbers of their own, and
retractions reach the same events. What does not hold for the building (geometry without a
transform, the floor map of a level that another log draws) is left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.renumbering import NewNumbers, renamed
from semmap_log.core.model.doors import CLASS, NAN, DoorId
from semmap_log.core.model.events import (
    DOOR_KINDS,
    KINDS,
    Changed,
    ClassDefined,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    MomentPinned,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
    SightingsThinned,
)
from semmap_log.core.model.meaning import ALL_CHANGED, FIELDS, PLACING
from semmap_log.fleet.join.door_plan import DoorPlan
from semmap_log.fleet.join.joined_logs import JoinedLog

_QUICK = {kind.kind for kind in (DoorObserved, DoorRequested, DoorPassed, RobotPose)}
"""Kinds that are translated as columns."""
_NAME = "name"


class EventTranslation:
    """Translates the commits of one log, in their order."""

    def __init__(
        self,
        log: JoinedLog,
        plan: DoorPlan,
        rounds: dict[tuple[str, int], int],
        horizon_ns: int = -1,
    ) -> None:
        """Take a log.

        Args:
            log: The log.
            plan: Its doors and levels in the building.
            rounds: (log, round) -> number in the view, of all logs.
            horizon_ns: Where the history of the view begins; -1: it has no horizon.
        """
        self._horizon_ns = horizon_ns
        self._log, self._plan, self._rounds = log, plan, rounds
        self._own, self._building = plan.ids[log.name]
        self._own_and_none = np.append(self._own, -1)
        self._numbers = NewNumbers(log.last_event + 1)
        self.left_out: Counter[str] = Counter()
        """Kind -> events that are not in the view."""

    def translated(self, batch: EventBatch, first: int, *, is_late: bool) -> list[Any]:
        """Return the events of a commit as the view has them, as a list for the writer.

        Args:
            batch: The events.
            first: The number that the first of them gets.
            is_late: The view records it later, since it has others of that moment: no event counts
                later for that than it did in its own log.
        """
        batch = self._of_known_doors(batch)
        happened = batch.folds_ns if is_late else batch.happened_ns
        if set(batch.columns) <= _QUICK and not batch.objects and len(batch):
            return self._quickly(batch, happened, first)
        return self._one_by_one(batch, happened.tolist(), first)

    def _of_known_doors(self, batch: EventBatch) -> EventBatch:
        """Return a batch without events of doors that were never added: lost, in a damaged log."""
        if all(
            self._knows(rows["door_id"]).all()
            for kind, rows in batch.columns.items()
            if kind in DOOR_KINDS
        ):
            return batch
        keep = ~batch.about_doors() | self._knows(batch.door_ids())
        self._leave_out(batch.select(~keep))
        return batch.select(keep)

    def _knows(self, door_ids: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
        places = np.searchsorted(self._own, door_ids)
        known: NDArray[np.bool_] = self._own_and_none[places] == door_ids
        return known

    def _leave_out(self, batch: EventBatch) -> None:
        self.left_out.update(type(recorded.event).__name__ for recorded in batch)

    def _quickly(
        self, batch: EventBatch, happened: NDArray[np.int64], first: int
    ) -> list[EventBatch]:
        """Return a batch of sightings and poses."""
        if RobotPose in batch and self._log.frame is None:
            keep = batch.kind != RobotPose.kind
            self._leave_out(batch.select(~keep))
            batch, happened = batch.select(keep), happened[keep]
            if not len(batch):
                return []
        self._numbers.add(batch.number, first)
        columns = {kind: self._moved(kind, rows.copy()) for kind, rows in batch.columns.items()}
        return [replace(batch, happened_ns=happened, columns=columns, known_door_ids=None)]

    def _moved(self, kind: int, rows: NDArray[np.void]) -> NDArray[np.void]:
        if kind in DOOR_KINDS:
            rows["door_id"] = self._building[np.searchsorted(self._own, rows["door_id"])]
        elif KINDS[kind - 1] is RobotPose and self._log.frame is not None:
            moved = self._log.frame.moved(rows["x"], rows["y"], rows["theta"])
            rows["x"], rows["y"], rows["theta"] = moved
            levels = np.unique(rows["level"])
            news = [self._plan.levels.of(self._log.name, level) for level in levels.tolist()]
            rows["level"] = np.array(news, rows["level"].dtype)[
                np.searchsorted(levels, rows["level"])
            ]
        return rows

    def _one_by_one(self, batch: EventBatch, happened: list[int], first: int) -> list[Event]:
        made: list[Event] = []
        added: dict[DoorId, int] = {}
        for recorded, happened_ns in zip(batch, happened, strict=True):
            event = replace(recorded.event, happened_ns=happened_ns)
            becomes = list(self._becomes(event, recorded.number))
            if becomes:
                self._numbers.add(recorded.number, first + len(made))
            elif not isinstance(event, Retracted):
                self.left_out[type(event).__name__] += 1
            made += becomes
            if isinstance(event, DoorAdded) and becomes and isinstance(becomes[0], DoorAdded):
                added[becomes[0].door_id] = happened_ns
        return made if self._plan.is_alone else made + list(self._names(made, added))

    def _names(self, made: Iterable[Event], added: dict[DoorId, int]) -> Iterator[Event]:
        """Yield the names of added doors that the same commit does not name."""
        named = {e.door_id for e in made if isinstance(e, DoorAnnotated) and e.key == _NAME}
        for door_id, happened_ns in added.items():
            if door_id not in named:
                name = self._plan.names[door_id]
                yield DoorAnnotated(
                    door_id=door_id,
                    key=_NAME,
                    value=name,
                    happened_ns=happened_ns,
                )

    def _becomes(self, event: Event, number: int) -> Iterable[Event]:
        """Return the events of the view for an event: none, itself, or several."""
        if isinstance(event, DoorEvent):
            place = int(np.searchsorted(self._own, event.door_id))
            if place == len(self._own) or self._own[place] != event.door_id:
                return []
            event = replace(event, door_id=DoorId(int(self._building[place])))
            return self._of_door(event, number)
        if isinstance(event, Retracted):
            return renamed(event, self._numbers.ranges)
        if isinstance(event, (PatrolStarted, PatrolFinished)):
            return [replace(event, patrol=self._round(event.patrol))]
        if isinstance(event, RobotPose):
            return self._pose(event)
        if isinstance(event, LevelAdded):
            level = self._plan.levels.of(self._log.name, event.level)
            mine = self._plan.levels.told_by.get(level, self._log.name) == self._log.name
            return [replace(event, level=level)] if mine else []
        if isinstance(event, FloorMap):
            return self._floor(event)
        if isinstance(event, ClassDefined):
            return [replace(event, class_name=self._class(event.class_name))]
        if isinstance(event, MomentPinned) and event.at_ns < self._horizon_ns:
            return []  # the state that it keeps is that of the log alone
        return [event]

    def _of_door(self, event: DoorEvent, number: int) -> Iterable[Event]:
        if isinstance(event, DoorAdded):
            return self._added(event, number)
        if isinstance(event, DoorUpdated):
            return self._updated(event)
        if isinstance(event, DoorRemoved):
            return self._removed(event, number)
        if isinstance(event, DoorAnnotated) and event.key == _NAME and not self._plan.is_alone:
            return [replace(event, value=self._plan.names[event.door_id])]
        if isinstance(event, DoorAnnotated) and event.key == CLASS:
            return [replace(event, value=self._class(event.value))]
        if isinstance(event, SightingsThinned):
            return renamed(event, self._numbers.ranges)
        return [event]

    def _class(self, name: str) -> str:
        """Return what the view calls a class of the log."""
        return self._plan.classes.get((self._log.name, name), name)

    def _added(self, event: DoorAdded, number: int) -> Iterable[Event]:
        placed = self._placed(event)
        if (self._log.name, number) in self._plan.adding or self._is_own(event.door_id):
            return [placed]
        knows = ALL_CHANGED
        if not event.state.is_known:
            knows &= ~Changed.STATE
        if placed.x != placed.x:
            knows &= ~PLACING
        if event.prob_open != event.prob_open:
            knows &= ~Changed.PROB_OPEN
        if event.prob_closed != event.prob_closed:
            knows &= ~Changed.PROB_CLOSED
        return self._update(placed, Changed(knows))

    def _is_own(self, door_id: int) -> bool:
        """Return whether no other door, of any log, is the same door of the building."""
        return np.count_nonzero(self._building == door_id) == 1 and not self._is_shared(door_id)

    def _is_shared(self, door_id: int) -> bool:
        return any(
            log != self._log.name and door_id in building
            for log, (_, building) in self._plan.ids.items()
        )

    def _update(self, values: DoorAdded | DoorUpdated, knows: Changed) -> Iterable[Event]:
        if not knows:
            return []
        told = {name: getattr(values, name) for name in FIELDS}
        if not knows & Changed.POSE:
            told |= {"level": 0, "x": NAN, "y": NAN, "theta": NAN}
        if not knows & Changed.WIDTH:
            told["width"] = NAN
        return [
            DoorUpdated(
                door_id=values.door_id, changed=knows, happened_ns=values.happened_ns, **told
            )
        ]

    def _updated(self, event: DoorUpdated) -> Iterable[Event]:
        if self._log.frame is None and event.changed & PLACING:
            return self._update(event, Changed(event.changed & ~PLACING))
        return [self._placed(event)] if event.changed & Changed.POSE else [event]

    def _placed(self, event: Any) -> Any:
        """Return an addition or an update with its pose in the building's frame, or without one."""
        level = self._plan.levels.of(self._log.name, event.level)
        if self._log.frame is None:
            return replace(event, level=level, x=NAN, y=NAN, theta=NAN, width=NAN)
        x, y, theta = self._log.frame.moved(event.x, event.y, event.theta)
        return replace(event, level=level, x=float(x), y=float(y), theta=float(theta))

    def _removed(self, event: DoorRemoved, number: int) -> Iterable[Event]:
        if (self._log.name, number) in self._plan.removing or self._is_own(event.door_id):
            return [event]
        return []

    def _round(self, patrol: int) -> int:
        if self._plan.is_alone:
            return patrol
        return self._rounds.setdefault((self._log.name, patrol), len(self._rounds) + 1)

    def _pose(self, event: RobotPose) -> Iterable[Event]:
        if self._log.frame is None:
            return []
        x, y, theta = self._log.frame.moved(event.x, event.y, event.theta)
        level = self._plan.levels.of(self._log.name, event.level)
        return [replace(event, level=level, x=float(x), y=float(y), theta=float(theta))]

    def _floor(self, event: FloorMap) -> Iterable[Event]:
        level = self._plan.levels.of(self._log.name, event.level)
        is_drawn = self._plan.is_alone or self._plan.levels.drawn_by.get(level) == self._log.name
        if self._log.frame is None or not is_drawn:
            return []
        moved = self._log.frame.moved(event.origin_x, event.origin_y, event.origin_theta)
        x, y, theta = map(float, moved)
        return [replace(event, level=level, origin_x=x, origin_y=y, origin_theta=theta)]
