"""Which part of a log a view shows: a span of happened time, and some of the doors.

It also holds the floor plans on which each level is drawn, and from when on, since a building may
be mapped again. Doors and robots of a time lie in the frame of that time's map; times before the
first plan are drawn on the first.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, Retractions, in_ranges
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.core.model.moments import check_ordered
from semmap_log.log import Scope, Window, kinds_mask, warn_of_clock

if TYPE_CHECKING:
    from semmap_log.core.model.moments import Time
    from semmap_log.log import DoorLog


MOST_PLANS = 20
"""Of a level. A robot that maps while it drives may report a plan a minute. If there are more,
those that lasted longest are drawn, each until the next."""

PLAN = np.dtype([("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8")])

Stamps = NDArray[np.void]
"""Rows of `PLAN`."""


@dataclass(frozen=True, slots=True)
class PlanEra:
    """A time in which a level is drawn on one plan."""

    since: Stamps
    """One row of `PLAN`: the event that brought it."""
    plan_event: int
    """The number of the event that carries the plan; -1: there is none."""
    floor: FloorMap | None
    """None: the plan was retracted, and there was none before it."""


@dataclass(frozen=True, slots=True)
class LevelPlans:
    """The plans of a level along each timeline, each from when on it counts."""

    happened: tuple[PlanEra, ...] = ()
    recorded: tuple[PlanEra, ...] = ()
    """In the order of recording: along `recorded` and `event`."""

    @property
    def is_one(self) -> bool:
        """True where the level is drawn on one plan, or on none, at all times."""
        return len(self.happened) < 2 and len(self.recorded) < 2


NO_PLANS = LevelPlans()


def level_plans(excerpt: Excerpt, levels: Collection[int]) -> dict[int, LevelPlans]:
    """Return the plans that levels are drawn on, of those that have one."""
    told = _told(excerpt)
    found = {}
    for level in sorted(told.keys() & set(levels)):
        stamps = np.array(told[level], PLAN)
        found[level] = LevelPlans(
            _loaded(excerpt, _kept(_along_happened(excerpt, stamps), "folds_ns")),
            _loaded(excerpt, _kept(_along_recorded(excerpt, stamps), "recorded_ns")),
        )
    return found


def doors_at_ends(eras: Sequence[PlanEra], excerpt: Excerpt) -> Iterator[tuple[PlanEra, DoorMap]]:
    """Yield the plans along `happened`, each with the doors just before the next, or at the end."""
    ends = [int(era.since["folds_ns"][0]) - 1 for era in eras[1:]]
    for era, end_ns in zip(eras, [*ends, excerpt.last_ns()], strict=True):
        yield era, excerpt.log.replay(at=end_ns)


def _told(excerpt: Excerpt) -> dict[int, list[tuple[int, int, int]]]:
    """Return rows of `PLAN` by level, retracted plans included; numbers ascend."""
    told: dict[int, list[tuple[int, int, int]]] = {}
    window = Window(happened_before_ns=excerpt.until_ns, kinds=kinds_mask([FloorMap]))
    for batch in excerpt.log.batches_in(window):
        for each in batch:
            assert isinstance(each.event, FloorMap)
            folds_ns = min(each.happened_ns, each.recorded_ns)
            told.setdefault(each.event.level, []).append((each.number, folds_ns, each.recorded_ns))
    return told


Era = tuple[Stamps, int]
"""Since when, and the number of the event that carries the plan; -1: none."""


def _along_happened(excerpt: Excerpt, stamps: Stamps) -> list[Era]:
    stands = stamps[~excerpt.is_retracted(stamps["number"])]
    ordered = stands[np.lexsort((stands["number"], stands["folds_ns"]))]
    eras = [(ordered[[i]], int(ordered["number"][i])) for i in range(len(ordered))]
    return _from_begin(eras, "folds_ns", excerpt.since_ns)


def _along_recorded(excerpt: Excerpt, stamps: Stamps) -> list[Era]:
    """Return the plan that was known after each event that set or retracted one."""
    known = excerpt.retractions
    back = [n for n, ends in zip(known.numbers, known.ranges, strict=True)
            if in_ranges(stamps["number"], [ends]).any()]  # fmt: skip
    changes = np.sort(np.concatenate([stamps, _of_events(excerpt, back)]), order="number")
    if excerpt.until_ns is not None:
        changes = changes[changes["recorded_ns"] < excerpt.until_ns]
    eras: list[Era] = []
    for i, number in enumerate(changes["number"].tolist()):
        ends = [ends for n, ends in zip(known.numbers, known.ranges, strict=True) if n <= number]
        there = stamps[(stamps["number"] <= number) & ~in_ranges(stamps["number"], ends)]
        latest = np.lexsort((there["number"], there["folds_ns"]))[-1:]
        plan = int(there["number"][latest[0]]) if len(latest) else -1
        if not eras or eras[-1][1] != plan:
            eras.append((changes[[i]], plan))
    return _from_begin(eras, "recorded_ns", excerpt.since_ns)


def _of_events(excerpt: Excerpt, numbers: Sequence[int]) -> Stamps:
    rows = np.empty(len(numbers), PLAN)
    for row, number in zip(rows, numbers, strict=True):
        told = excerpt.log.event(number)
        row["number"], row["recorded_ns"] = number, told.recorded_ns
        row["folds_ns"] = min(told.happened_ns, told.recorded_ns)
    return rows


def _from_begin(eras: list[Era], time: str, since_ns: int | None) -> list[Era]:
    """Leave out eras that ended before the excerpt, or were replaced at the same time."""
    eras = [era for era, after in zip(eras, [*eras[1:], None], strict=True)
            if after is None or int(after[0][time][0]) > int(era[0][time][0])]  # fmt: skip
    over = [since_ns is not None and int(era[0][time][0]) < since_ns for era in eras[1:]]
    return eras[sum(over) :]


def _kept(eras: list[Era], time: str) -> list[Era]:
    if len(eras) <= MOST_PLANS:
        return eras
    begins = np.array([era[0][time][0] for era in eras])
    stood = np.append(np.diff(begins), np.iinfo(np.int64).max)
    longest = np.sort(np.argsort(-stood, kind="stable")[:MOST_PLANS])
    return [eras[i] for i in longest.tolist()]


def _loaded(excerpt: Excerpt, eras: list[Era]) -> tuple[PlanEra, ...]:
    """Return the eras with their plans; an era with the same plan as the last is merged into it."""
    found: list[PlanEra] = []
    for since, number in eras:
        floor = None if number < 0 else _floor(excerpt, number)
        if not found or found[-1].floor != floor:
            found.append(PlanEra(since, number, floor))
    return tuple(found)


def _floor(excerpt: Excerpt, number: int) -> FloorMap:
    event = excerpt.log.event(number).event
    assert isinstance(event, FloorMap)
    return replace(event, happened_ns=None)


@dataclass(frozen=True, slots=True)
class Excerpt:
    """The part of a log that a view shows, along each timeline from `since` on and before `until`.

    Along `happened` these are the events that happened then, with all that is known today; along
    `recorded` and `event` those recorded then, including later retracted ones. Most are both.
    """

    log: DoorLog
    since_ns: int | None = None
    """None: from the log's start; `of` begins at the horizon of a log that has one."""
    until_ns: int | None = None
    """None: to the log's end."""
    doors: frozenset[DoorId] | None = None
    """Events about these doors, and about none; None: all doors."""

    @classmethod
    def of(
        cls, log: DoorLog, since: Time, until: Time, doors: Collection[DoorId] | None
    ) -> Excerpt:
        """Return the excerpt between two moments.

        Raises:
            MomentError: A time cannot be read, or `since` comes after `until`.
            HorizonError: It begins, or ends, before the log's horizon.
        """
        chosen = None if doors is None else frozenset(doors)
        since_ns, until_ns = log.instant(since), log.instant(until)
        check_ordered(since_ns, until_ns)
        warn_of_clock(log, since_ns)
        return cls(log, log.shown_from_ns(since_ns, until_ns), until_ns, chosen)

    def read(self, progress: Callable[[int, int], None] | None = None) -> Iterator[EventBatch]:
        """Yield the events of any of the timelines, about any door, numbers ascending.

        About a MiB of the log at a time, retracted ones included.
        """
        # An event never counts as later than it was recorded: so both ranges lie in this one.
        window = Window(recorded_from_ns=self.since_ns, happened_before_ns=self.until_ns)
        for batch in self.log.batches_in(window, progress=progress):
            if len(batch):
                yield batch

    def chosen(self, batch: EventBatch) -> EventBatch:
        """Return those that are about the doors, or about none."""
        if self.doors is None:
            return batch
        return batch.select(batch.of_doors(self.doors) | ~batch.about_doors())

    def batches(self, progress: Callable[[int, int], None] | None = None) -> Iterator[EventBatch]:
        """Yield the same as `read`, about the doors alone."""
        for batch in self.read(progress):
            chosen = self.chosen(batch)
            if len(chosen):
                yield chosen

    def happened(self, progress: Callable[[int, int], None] | None = None) -> Iterator[EventBatch]:
        """Yield those of `batches` that stand on the timeline `happened`."""
        for batch in self.batches(progress):
            standing = batch.select(self.has_happened(batch.number, batch.folds_ns))
            if len(standing):
                yield standing

    @property
    def retractions(self) -> Retractions:
        """The retractions, as known today."""
        return self.log.retractions()

    def is_retracted(self, numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return for each event whether it was retracted."""
        known = self.retractions
        return in_ranges(numbers, known.ranges) & ~np.isin(numbers, known.numbers)

    def has_happened(
        self, numbers: NDArray[np.int64], folds_ns: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Return which events stand on the timeline `happened`."""
        happened = ~self.is_retracted(numbers)
        if self.since_ns is not None:
            happened &= folds_ns >= self.since_ns
        return happened

    def was_recorded(
        self, numbers: NDArray[np.int64], recorded_ns: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Return which events stand on the timelines `recorded` and `event`."""
        known = self.retractions
        ahead = [(max(first, number), last) for number, (first, last)
                 in zip(known.numbers, known.ranges, strict=True) if last > number]  # fmt: skip
        recorded = ~(in_ranges(numbers, ahead) & ~np.isin(numbers, known.numbers))
        if self.until_ns is not None:
            recorded &= recorded_ns < self.until_ns
        return recorded

    def part_of(self, batch: EventBatch) -> EventBatch:
        """Return a batch's events that belong to the excerpt, without regard to `until`."""
        recorded = batch
        if self.since_ns is not None:
            recorded = batch.select(batch.recorded_ns >= self.since_ns)
        return self.chosen(recorded)

    def before(self) -> DoorMap:
        """Return the map just before the first event; empty where the excerpt starts the log."""
        if self.since_ns is None:
            return DoorMap({}, {})
        earlier = self.log.replay(at=self._before_ns(self.since_ns))
        kept = {
            i: door for i, door in earlier.doors.items() if self.doors is None or i in self.doors
        }
        return DoorMap(kept, earlier.levels, earlier.event)

    def known_before(self) -> DoorMapState:
        """Return the fold of what was known just before the first event was recorded."""
        if self.since_ns is None:
            return DoorMapState()
        return self.log.state_in(Scope(known_at_ns=self._before_ns(self.since_ns)))

    def number_before(self) -> int:
        """Return the number of the last event known then; -1: none."""
        if self.since_ns is None:
            return -1
        known = self.log.limit_of(Scope(known_at_ns=self._before_ns(self.since_ns)))
        assert known is not None, "knowledge has a bound"
        return known

    def _before_ns(self, since_ns: int) -> int:
        """Return the moment whose state opens an excerpt; no moment before a log's horizon."""
        return max(since_ns - 1, self.log.horizon_ns(), 0)

    def last_ns(self) -> int | None:
        """Return the last nanosecond that counts; None: the log's end."""
        return None if self.until_ns is None else max(self.until_ns - 1, 0)
