"""A large building's log to look at: months of a robot's rounds past hundreds of doors.

Half of the events are sightings, 40 % poses, 8 % updates; the others are the rounds' begins and
ends. A door is mostly seen as it was seen before. Drawn as columns: a million events take seconds.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from benchmark.patrol import START_NS

if TYPE_CHECKING:
    from semmap_log.core.batches.event_batch import EventBatch
    from semmap_log.core.model.events import FloorMap

SECOND_NS = 10**9
STEP_NS = 4 * SECOND_NS
"""From one event of a round to the next."""
ROUND, ROUND_EVERY_NS = 2_000, 4 * 3600 * SECOND_NS
"""Events of a round, which takes a little over two hours, and from one round to the next."""

CHANGES_SHARE = 0.12
"""Of the sightings: those that see another state than the last one."""
UPDATED_SHARE, SEEN_SHARE = 0.08, 0.51
ROOM_M, CORRIDOR_M = 4.0, 2.5
RESOLUTION_M = 0.05
IN_A_ROW = 25
"""Doors along one side of a corridor."""


@dataclass(frozen=True, slots=True)
class Rounds:
    """How long the log is, and of how many doors."""

    events: int
    doors: int

    def write(self, path: Path) -> None:
        """Write the log, a round at a time, without waiting for the disk at each commit."""
        import semmap_log as sl
        from semmap_log.core.io.clock import KeptClock

        clock = KeptClock(START_NS)
        entropy = random.Random(self.events).randbytes
        with sl.create(
            path, tz="Europe/Vienna", clock=clock, entropy=entropy, compact=False
        ) as log:
            log.append([self._plan()], sync=False)
            log.append(self._doors(), sync=False)
            for batch, last_ns in self._batches(self.events - 1 - self.doors):
                clock.recorded_ns = max(clock.recorded_ns, last_ns)
                log.append(batch, sync=False)
            log.sync()

    def _plan(self) -> FloorMap:
        from semmap_log.core.model.events import FloorMap

        height_m = self._rows * (2 * ROOM_M + CORRIDOR_M)
        cells = np.zeros((_cells(height_m), _cells(IN_A_ROW * ROOM_M)), np.int8)
        for row in range(self._rows):
            for wall_m in (0.0, ROOM_M, ROOM_M + CORRIDOR_M):
                at = _cells(row * (2 * ROOM_M + CORRIDOR_M) + wall_m)
                cells[at : at + 3] = 100
        for room in range(IN_A_ROW):
            cells[:, _cells(room * ROOM_M) : _cells(room * ROOM_M) + 3] = 100
        for row in range(self._rows):
            at = _cells(row * (2 * ROOM_M + CORRIDOR_M) + ROOM_M) + 3
            cells[at : at + _cells(CORRIDOR_M) - 3] = 0
        return FloorMap(resolution=RESOLUTION_M, origin_x=0.0, origin_y=0.0, cells=cells,
                        happened_ns=START_NS)  # fmt: skip

    def _doors(self) -> EventBatch:
        from semmap_log.core.batches.event_batch import EventBatch
        from semmap_log.core.model.events import DoorAdded

        x, y = self._places()
        return EventBatch.of(DoorAdded, happened_ns=START_NS, door_id=np.arange(1, self.doors + 1),
                             x=x, y=y, theta=0.0, width=1.0, prob_open=0.5)  # fmt: skip

    @property
    def _rows(self) -> int:
        """Corridors."""
        return -(-self.doors // (2 * IN_A_ROW))

    def _places(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where the doors' lines begin: on both sides of each corridor."""
        row, beside = np.divmod(np.arange(self.doors), 2 * IN_A_ROW)
        side, room = np.divmod(beside, IN_A_ROW)
        y = row * (2 * ROOM_M + CORRIDOR_M) + ROOM_M + side * CORRIDOR_M
        return room * ROOM_M + 1.5, y + 0.07

    def _batches(self, count: int) -> Iterator[tuple[EventBatch, int]]:
        """Yield round after round as events, each with its last time."""
        x, y = self._places()
        states = np.ones(self.doors + 1, np.uint8)
        for number, first in enumerate(range(0, count, ROUND)):
            rng = np.random.default_rng([7, number])
            size = min(ROUND, count - first)
            times_ns = START_NS + number * ROUND_EVERY_NS + np.arange(1, size + 1) * STEP_NS
            along = (np.arange(size) * self.doors / ROUND).astype(np.int64) % self.doors
            driven = _Round(number, times_ns, along, x, y)
            yield _events(rng, driven, states), int(times_ns[-1])


@dataclass(frozen=True, slots=True)
class _Round:
    number: int
    times_ns: NDArray[np.int64]
    along: NDArray[np.int64]
    """Which door each event is at."""
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    """Of the doors."""


def _events(rng: np.random.Generator, driven: _Round, states: NDArray[np.uint8]) -> EventBatch:
    """Return a round's events; `states` is what each door was last seen as, and goes on."""
    from semmap_log.core.batches.event_batch import EventBatch
    from semmap_log.core.model.doors import DoorState
    from semmap_log.core.model.events import (
        Changed,
        DoorObserved,
        DoorUpdated,
        PatrolFinished,
        PatrolStarted,
        RobotPose,
    )

    times_ns, along = driven.times_ns, driven.along
    draw = rng.random(len(times_ns))
    kinds = np.where(draw < SEEN_SHARE, DoorObserved.kind,
                     np.where(draw < SEEN_SHARE + UPDATED_SHARE, DoorUpdated.kind,
                              RobotPose.kind))  # fmt: skip
    kinds[0] = PatrolStarted.kind
    if len(kinds) > 1:
        kinds[-1] = PatrolFinished.kind
    there = (DoorObserved, DoorUpdated, RobotPose, PatrolStarted, PatrolFinished)
    where = {kind: np.flatnonzero(kinds == kind.kind) for kind in there}
    seen = along[where[DoorObserved]] + 1
    changes = rng.random(len(seen)) < CHANGES_SHARE
    looks = np.empty(len(seen), np.uint8)
    for i, (door, changed) in enumerate(zip(seen.tolist(), changes.tolist(), strict=True)):
        if changed:
            states[door] = DoorState.OPEN + DoorState.CLOSED - states[door]
        looks[i] = states[door]
    here, number = along[where[RobotPose]], driven.number
    parts = [
        EventBatch.of(DoorObserved, happened_ns=times_ns[where[DoorObserved]], door_id=seen,
                      state=looks, accuracy_open=0.9, accuracy_closed=0.95),
        EventBatch.of(DoorUpdated, happened_ns=times_ns[where[DoorUpdated]],
                      door_id=along[where[DoorUpdated]] + 1, changed=int(Changed.PROB_OPEN),
                      prob_open=rng.random(len(where[DoorUpdated])).round(2)),
        EventBatch.of(RobotPose, happened_ns=times_ns[where[RobotPose]],
                      x=driven.x[here] + rng.random(len(here)) * ROOM_M / 2,
                      y=driven.y[here] // 1 + 1.0 + rng.random(len(here)) / 4,
                      theta=rng.random(len(here)) / 2),
        EventBatch.of(PatrolStarted, happened_ns=times_ns[where[PatrolStarted]], patrol=number),
        EventBatch.of(PatrolFinished, happened_ns=times_ns[where[PatrolFinished]], patrol=number),
    ]  # fmt: skip
    return EventBatch.mixed(kinds, *[part for part in parts if len(part)])


def _cells(metres: float) -> int:
    return round(metres / RESOLUTION_M)
