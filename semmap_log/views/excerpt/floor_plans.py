"""On which floor plan a level is drawn, from when on: a building may be mapped anew.

Doors and robots of a time lie in the frame of the map of that time. Before the first plan there is
none to draw on but the first.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.retraction import in_ranges
from semmap_log.core.model.doors import DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.window import Window
from semmap_log.views.excerpt.span import Excerpt

MOST_PLANS = 20
"""Of a level. A robot that maps while it drives tells a plan a minute: of more, those are drawn
that stood longest, each until the next."""

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
    """None: what was told was taken back, and nothing was there before."""


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
    """Return rows of `PLAN` by level: when plans were told, taken back or not; numbers ascend."""
    told: dict[int, list[tuple[int, int, int]]] = {}
    window = Window(happened_before_ns=excerpt.until_ns, kinds=bits_of_kinds([FloorMap]))
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
    """Return the plan that was known behind each event that told one, or took one back."""
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
    """Leave out what was over when the excerpt begins, or was replaced at the same time."""
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
    """Return the eras with their plans; one that tells the plan before it once more is not new."""
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
