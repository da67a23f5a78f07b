"""Cases: costmaps, and one over a day."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import semmap_log as sl
from benchmark.case import Case, Peer, Work
from benchmark.costmaps import (
    INSCRIBED_M,
    PART,
    RADIUS_M,
    SCALING,
    Costmap,
    change_case,
    checksum,
    rebuild_case,
)
from benchmark.logs import DAY_NS, Workshop
from benchmark.made_building import Building, made_building
from benchmark.patrol import START_NS
from benchmark.peers import OURS
from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    LETHAL,
    NO_INFORMATION,
    DoorLine,
)
from semmap_log.core.io.clock import KeptClock
from semmap_log.core.model.doors import DoorState

if TYPE_CHECKING:
    from semmap_log.analysis.costmaps import CostmapFrame


CHANGES = 10_000
TRIED_OUT = 200
REDRAWN = 2
"""So many of the day's grids are drawn anew, to tell what all of them would cost."""
DAY_ROUNDS = 3
PER_COMMIT = 10
STATES = {LETHAL: DoorState.CLOSED, FREE_SPACE: DoorState.OPEN, NO_INFORMATION: DoorState.UNKNOWN}

Change = tuple[int, int]
"""A door, and its cost from now on."""


def day_case(shop: Workshop, side: int, rounds: int | None, *, tries_out: bool) -> Case:
    """Return: from a log on disk to the costmap after each of its changes; the time of one.

    Args:
        shop: Where the log is made.
        side: Cells along each edge of the map.
        rounds: Rounds that count; None: `DAY_ROUNDS`.
        tries_out: Only a few changes, to see whether everything works.
    """
    count = TRIED_OUT if tries_out else CHANGES
    path = shop.folder_for("day") / "log"
    shop.say(f"writing a day of {count:,} changes")
    _write(path, made_building(side), count)
    expected = (count + 1, _after(side, count, count))
    ours = Peer(OURS, partial(_ours, path), expected, units=count, promise="< 1 ms")
    redrawn = Peer(f"{OURS}, each drawn anew", partial(_redrawn, side, count),
                   _after(side, count, REDRAWN), units=REDRAWN)  # fmt: skip
    title = f"A day, {count:,} changes: each"
    return Case("costmap", title, "ms", (ours, redrawn), rounds or DAY_ROUNDS,
                memory_promise=False, warms_up=False)  # fmt: skip


def _changes(building: Building, count: int) -> Iterator[Change]:
    """Yield the changes, the same at each run: a closed door opens, any other closes."""
    chance = random.Random(count)
    costs = {door: line.cost for door, line in building.doors.items()}
    doors = list(costs)
    for _ in range(count):
        door = chance.choice(doors)
        costs[door] = FREE_SPACE if costs[door] == LETHAL else LETHAL
        yield door, costs[door]


def _write(path: Path, building: Building, count: int) -> None:
    from semmap_log.core.model.events import DoorAdded, DoorObserved, FloorMap

    clock = KeptClock(START_NS)
    geometry = building.geometry
    occupancy = np.where(building.costs == LETHAL, np.int8(100), np.int8(0))
    occupancy[building.costs == NO_INFORMATION] = -1
    floor = FloorMap(
        resolution=float(np.float32(geometry.resolution)),
        origin_x=geometry.origin_x,
        origin_y=geometry.origin_y,
        cells=occupancy,
    )
    entropy = random.Random(count).randbytes
    with sl.create(path, tz="UTC", clock=clock, entropy=entropy, compact=False) as log:
        doors = [
            DoorAdded(door_id=sl.DoorId(door), x=line.x, y=line.y, theta=line.theta,
                      width=line.width, state=STATES[line.cost])
            for door, line in building.doors.items()
        ]  # fmt: skip
        log.append([floor, *doors], sync=False)
        changes = list(_changes(building, count))
        for first in range(0, count, PER_COMMIT):
            clock.recorded_ns = START_NS + DAY_NS * (first + PER_COMMIT) // count
            log.append([
                DoorObserved(door_id=sl.DoorId(door), state=STATES[cost],
                             happened_ns=START_NS + DAY_NS * (first + n + 1) // count)
                for n, (door, cost) in enumerate(changes[first : first + PER_COMMIT])
            ], sync=False)  # fmt: skip
        log.sync()


def _ours(path: Path) -> Work:
    from semmap_log.analysis.costmaps import CostmapOptions, costmap_frames

    options = CostmapOptions(inflate_m=RADIUS_M, scaling=SCALING, inscribed_m=INSCRIBED_M)

    def once(_: None) -> tuple[int, CostmapFrame]:
        frames = enumerate(costmap_frames(sl.read(path), options, since=START_NS), start=1)
        ((count, last),) = deque(frames, maxlen=1)
        return count, last

    return Work(once, answer=lambda told: (told[0], checksum(told[1].costmap.master.costs)))


def _redrawn(side: int, count: int) -> Work:
    building = made_building(side)
    changes = list(_changes(building, count))[:REDRAWN]

    def once(_: None) -> Costmap:
        doors = dict(building.doors)
        for change in changes:
            _take(doors, change)
            costmap = Costmap(building, doors)
        return costmap

    return Work(once, answer=lambda costmap: checksum(costmap.master.costs))


def _after(side: int, count: int, changes: int) -> int:
    """Return the checksum of the master after so many changes: all doors drawn in one go."""
    building = made_building(side)
    doors = dict(building.doors)
    for change in list(_changes(building, count))[:changes]:
        _take(doors, change)
    return checksum(Costmap(building, doors).master.costs)


def _take(doors: dict[int, DoorLine], change: Change) -> None:
    door, cost = change
    doors[door] = replace(doors[door], cost=cost)


SIDE = 4000
"""Cells along each edge of the large map: 200 m."""


def costmap_cases(shop: Workshop, rounds: int | None, *, tries_out: bool = False) -> Iterator[Case]:
    """Yield: the whole map; a door's change; a day of changes.

    Args:
        shop: Told what is being made.
        rounds: Rounds that count; None: each case's own.
        tries_out: Only the corner of the map, to see whether everything works.
    """
    side = PART if tries_out else SIDE
    shop.say("drawing a costmap by plain loops, to compare with")
    yield rebuild_case(side, rounds)
    yield change_case(side, rounds)
    yield day_case(shop, side, rounds, tries_out=tries_out)
