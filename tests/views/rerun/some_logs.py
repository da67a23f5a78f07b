"""Logs to look at, and what a viewer would find in a recording of them."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    PatrolFinished,
    PatrolStarted,
    Retracted,
    RobotPose,
)
from semmap_log.errors import SemmapError
from tests.conftest import SteadyClock

SECOND = 10**9
FIRST_OF_WILD = 4
"""Number of the first event of a `wild_log` that is about doors; nothing before is taken back."""

CLEAR = "Clear:is_recursive"

START = 1_772_400_000 * SECOND
"""2026-03-01T21:20:00Z"""


def room(level: int = 0, *, theta: float = 0.0) -> FloorMap:
    """A plan of 10 m x 8 m, walls around it."""
    cells = np.zeros((160, 200), np.int8)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = 100, 100, 100, 100
    return FloorMap(
        level=level, resolution=0.05, origin_x=-5.0, origin_y=-4.0, origin_theta=theta, cells=cells
    )


def small_log(path: Path) -> sl.DoorLog:
    """Two doors, `front` and number 2, an hour of a robot's round; front opens, 2 is removed."""
    clock = SteadyClock(START)
    with sl.create(path, tz="UTC", clock=clock, robot="rover") as log:
        log.append([room()], note=sl.Note(actor="survey"))
        log.append([
            DoorAdded(door_id=DoorId(1), x=-1.0, y=0.0, theta=0.0, width=1.0,
                      state=DoorState.CLOSED, prob_open=0.25, prob_closed=0.75),
            DoorAnnotated(door_id=DoorId(1), key="name", value="front"),
            DoorAdded(door_id=DoorId(2), x=2.0, y=1.0, theta=math.pi / 2, width=0.8),
        ], note=sl.Note(actor="survey", reason="first plan"))  # fmt: skip
        clock.now_ns = START + 600 * SECOND
        log.append([PatrolStarted(patrol=1)])
        for step in range(10):
            clock.now_ns = START + (600 + 10 * step) * SECOND
            log.append([RobotPose(x=step * 0.5 - 3, y=-2.0, theta=0.0)])
        log.append([DoorObserved(door_id=DoorId(1), state=DoorState.OPEN, accuracy_open=0.9,
                                 accuracy_closed=0.9)], note=sl.Note(actor="rover"))  # fmt: skip
        log.append([DoorUpdated(door_id=DoorId(1), changed=Changed.PROB_OPEN, prob_open=0.5)])
        clock.now_ns = START + 1200 * SECOND
        log.append([DoorPassed(door_id=DoorId(2), passed=False, waited_s=12.0)])
        log.append([PatrolFinished(patrol=1)])
        clock.now_ns = START + 1800 * SECOND
        log.append(
            [DoorRemoved(door_id=DoorId(2))], note=sl.Note(actor="anna", reason="a wall now")
        )
        clock.now_ns = START + 3600 * SECOND
        log.append([DoorObserved(door_id=DoorId(1), state=DoorState.CLOSED)])
    return sl.read(path)


def restless_log(path: Path, *, seed: int, events: int = 300, doors: int = 6) -> sl.DoorLog:
    """Doors on two levels that are added, placed, moved, sighted and removed; a third told late."""
    rng = random.Random(seed)
    clock = SteadyClock(START)
    with sl.create(path, tz="UTC", clock=clock) as log:
        log.append([LevelAdded(level=1, name="ground"), LevelAdded(level=2, name="first")])
        present: dict[int, int] = {}
        for number in range(events):
            clock.now_ns = START + number * 60 * SECOND
            if len(present) < doors and (not present or rng.random() < 0.05):
                door_id = number + 1
                present[door_id] = clock.now_ns
                log.append([_new_door(rng, door_id)])
                continue
            door_id = rng.choice(sorted(present))
            late_s = rng.choice([0, 0, rng.randrange(1, 10_000)])
            event = _something_new(rng, door_id, clock.now_ns - late_s * SECOND)
            if isinstance(event, DoorRemoved):
                del present[door_id]
            log.append([event])
    return sl.read(path)


def _new_door(rng: random.Random, door_id: int) -> Event:
    if rng.random() < 0.3:
        return DoorAdded(door_id=DoorId(door_id), level=0)
    return DoorAdded(
        door_id=DoorId(door_id), level=rng.choice([1, 2]), x=rng.uniform(-5, 5),
        y=rng.uniform(-4, 4), theta=rng.uniform(-3, 3), width=rng.uniform(0.5, 2),
        state=rng.choice(list(DoorState)), prob_open=rng.random(),
    )  # fmt: skip


def _something_new(rng: random.Random, door_id: int, happened_ns: int) -> Event:
    door: Any = {"door_id": DoorId(door_id), "happened_ns": happened_ns}
    chance = rng.random()
    if chance < 0.45:
        return DoorObserved(**door, state=rng.choice(list(DoorState)))
    if chance < 0.55:
        return DoorPassed(**door, passed=rng.random() < 0.7)
    if chance < 0.75:
        return DoorUpdated(
            **door, level=rng.choice([1, 2]), x=rng.uniform(-5, 5), y=rng.uniform(-4, 4),
            theta=rng.uniform(-3, 3), width=rng.uniform(0.5, 2),
            changed=Changed.POSE | Changed.WIDTH,
        )  # fmt: skip
    if chance < 0.98:
        return DoorUpdated(
            **door,
            changed=rng.choice([Changed.PROB_OPEN, Changed.PROB_CLOSED, Changed.STATE]),
            prob_open=rng.random(), prob_closed=rng.random(), state=rng.choice(list(DoorState)),
        )  # fmt: skip
    return DoorRemoved(door_id=DoorId(door_id))


def wild_log(path: Path, *, seed: int, commits: int = 150) -> sl.DoorLog:
    """As `restless_log`, and more: commits of some events, late removals, much is taken back."""
    rng = random.Random(seed)
    clock = SteadyClock(START)
    with sl.create(path, tz="UTC", clock=clock) as log:
        log.append([LevelAdded(level=1, name="ground"), LevelAdded(level=2, name="first")])
        log.append([room(1), room(2)])
        numbers, doors = FIRST_OF_WILD, 0
        for turn in range(commits):
            clock.now_ns = START + turn * 60 * SECOND
            events: list[Event] = []
            if numbers == FIRST_OF_WILD or doors < 3 or rng.random() < 0.05:
                doors += 1
                early_s = rng.choice([0, rng.randrange(1, 3_000)])
                new = replace(_new_door(rng, doors), happened_ns=clock.now_ns - early_s * SECOND)
                events.append(new)
            elif rng.random() < 0.15:
                first = rng.randrange(max(FIRST_OF_WILD, numbers - 40), numbers)
                events.append(Retracted(first_event=first, last_event=min(
                    first + rng.choice([0, 1, 10]), numbers - 1)))  # fmt: skip
            else:
                for _ in range(rng.choice([1, 1, 4])):
                    told_ns = clock.now_ns - rng.choice([0, 0, rng.randrange(5_000)]) * SECOND
                    about = rng.randrange(1, doors + 1)
                    event = _something_new(rng, about, told_ns)
                    if rng.random() < 0.05:
                        event = DoorRemoved(door_id=DoorId(about), happened_ns=told_ns)
                    events.append(event)
            try:
                numbers = log.append(events).commit.last_event + 1
            except SemmapError:
                continue  # about a door that is not there, or taken back already: not in the log
    return sl.read(path)


class Drawn:
    """A recording, asked as the viewer asks it: the latest value of a component at a time."""

    def __init__(self, rrd: Path, recording_id: str | None = None) -> None:
        import rerun as rr

        reader = rr.chunk.RrdReader(rrd)
        (store,) = (
            store for store in reader.recordings() if recording_id in (None, store.recording_id)
        )
        self.store = store
        self.blueprints = len(reader.blueprints())
        self.most_rows = 0
        self.statics: dict[tuple[str, str], Any] = {}
        self._rows: dict[tuple[str, str], list[tuple[dict[str, int], bytes, Any]]] = {}
        for chunk in reader.stream(store=store):
            self._take(chunk)

    def _take(self, chunk: Any) -> None:
        batch = chunk.to_record_batch()
        self.most_rows = max(self.most_rows, chunk.num_rows)
        columns = dict(zip(batch.schema.names, batch.columns, strict=True))
        row_ids = columns.pop("rerun.controls.RowId").to_pylist()
        times = {}
        for name in chunk.timeline_names:
            times[name] = columns.pop(name).cast("int64").to_pylist()
        for component, column in columns.items():
            for row, value in enumerate(column.to_pylist()):
                if value is None:
                    continue
                if chunk.is_static:
                    self.statics[chunk.entity_path, component] = value
                    continue
                at = {name: stamps[row] for name, stamps in times.items()}
                key = (chunk.entity_path, component)
                self._rows.setdefault(key, []).append((at, row_ids[row], value))

    @property
    def entities(self) -> set[str]:
        return {entity for entity, _ in (*self._rows, *self.statics)}

    @property
    def timelines(self) -> set[str]:
        return {name for rows in self._rows.values() for at, _, _ in rows for name in at}

    def rows(
        self, entity: str, component: str, timeline: str = "happened"
    ) -> list[tuple[int, Any]]:
        """All rows of a component, in order of that timeline."""
        found = [(at[timeline], row_id, value)
                 for at, row_id, value in self._rows.get((entity, component), [])
                 if timeline in at]  # fmt: skip
        return [(time, value) for time, _, value in sorted(found, key=lambda row: row[:2])]

    def shows(self) -> dict[tuple[str, str, str], list[tuple[int, str]]]:
        """(entity, component, timeline) -> from when on it shows what, as text; NaN is like NaN."""
        found = {}
        for entity, component in self._rows:
            for timeline in self.timelines if component != CLEAR else ():
                found[entity, component, timeline] = self._steps(entity, component, timeline)
        return {key: steps for key, steps in found.items() if steps}

    def _steps(self, entity: str, component: str, timeline: str) -> list[tuple[int, str]]:
        told = [*self._stamped(entity, component, timeline)]
        told += [(at, row_id, None) for at, row_id, _ in self._stamped(entity, CLEAR, timeline)]
        last = {at: repr(value) for at, _, value in sorted(told, key=lambda row: row[:2])}
        steps: list[tuple[int, str]] = []
        for at, value in last.items():
            if value != (steps[-1][1] if steps else repr(None)):
                steps.append((at, value))
        return steps

    def latest(self, entity: str, component: str, at: int, timeline: str = "happened") -> Any:
        """The value that holds at a time, or None; a Clear behind it takes it away."""
        values, clears = (
            [row for row in self._stamped(entity, asked, timeline) if row[0] <= at]
            for asked in (component, CLEAR)
        )
        if not values:
            return None
        time, row_id, value = max(values, key=lambda row: row[:2])
        return None if any(row[:2] > (time, row_id) for row in clears) else value

    def _stamped(
        self, entity: str, component: str, timeline: str
    ) -> Iterator[tuple[int, bytes, Any]]:
        for at, row_id, value in self._rows.get((entity, component), []):
            if timeline in at:
                yield at[timeline], row_id, value
