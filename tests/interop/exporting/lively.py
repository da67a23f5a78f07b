"""A log with all that a markers' bag has to get right, and what each moment of it looks like."""

from __future__ import annotations

import math
import random
from pathlib import Path

import semmap_log as sl
from semmap_log.core.model.doors import Door, DoorMap
from semmap_log.core.model.events import (
    DoorAnnotated,
    FloorMap,
    LevelAdded,
    PatrolStarted,
    RobotPose,
)
from semmap_log.views.palette import DEFAULT, Palette
from tests.conftest import SteadyClock
from tests.interop.formats.bags.marked import Seen
from tests.views.rerun.some_logs import SECOND, START, restless_log, room

NAMES = ["front", "Tür 2 / вход", "大门", "", "a" * 61]
EVENTS = 300
END = START + EVENTS * 60 * SECOND


def lively_log(path: Path, *, seed: int) -> sl.DoorLog:
    """A restless log whose levels get heights, plans and robots, whose doors get names, and some
    of whose events are retracted; all of it happened somewhere in between.
    """
    restless_log(path, seed=seed, events=EVENTS).replay()
    rng = random.Random(seed)
    clock = SteadyClock(END)
    with sl.append(path, clock=clock) as log:
        doors = sorted(sl.read(path).replay().doors)
        for door_id in doors * 3:
            log.append([DoorAnnotated(door_id=door_id, key="name", value=rng.choice(NAMES),
                                      happened_ns=_some_time(rng))])  # fmt: skip
        for level in (1, 2, 1):
            turned = {"origin_x": rng.uniform(-9, 9), "origin_theta": rng.uniform(-1, 1)}
            log.append([FloorMap(level=level, resolution=0.05, origin_y=1.5,
                                 happened_ns=_some_time(rng),
                                 cells=room(level).cells, **turned)])  # fmt: skip
        for elevation in (3.5, 4.25):
            log.append([LevelAdded(level=2, name="first", elevation=elevation,
                                   happened_ns=_some_time(rng))])  # fmt: skip
        for _ in range(30):
            pose = {"x": rng.uniform(-5, 5), "y": rng.uniform(-4, 4), "theta": rng.uniform(-3, 3)}
            log.append([RobotPose(level=rng.choice([1, 2]), happened_ns=_some_time(rng), **pose)])
        log.append([PatrolStarted(patrol=7, happened_ns=_some_time(rng))],
                   note=sl.Note(actor="rover", reason="evening round"))  # fmt: skip
        for number in rng.sample(range(2, EVENTS), 20):
            log.retract(number)
    return sl.read(path)


def _some_time(rng: random.Random) -> int:
    return rng.randrange(START, END)


def seen_in(door_map: DoorMap, level: int, *, palette: Palette = DEFAULT) -> dict[int, Seen]:
    """Return what a person should see of a level: id -> door."""
    known = door_map.levels.get(level)
    z = known.elevation if known and math.isfinite(known.elevation) else 0.0
    return {
        int(door_id): seen(door, z, palette)
        for door_id, door in door_map.doors.items()
        if door.is_placed and door.level == level
    }


def seen(door: Door, z: float = 0.0, palette: Palette = DEFAULT) -> Seen:
    """Return what a person should see of a door."""
    ends = [tuple(round(value, 6) + 0.0 for value in (*end, z)) for end in (door.start, door.end)]
    return Seen(door.label, palette.of_state(door.state), palette.text_of_state(door.state),
                ends[0], ends[1])  # type: ignore[arg-type]  # fmt: skip


def some_moments(log: sl.DoorLog, seed: int, count: int = 40) -> list[int]:
    """Return moments between and at events, ascending."""
    rng = random.Random(seed)
    at_events = [entry.happened_ns for entry in log.history()]
    return sorted(
        rng.choice(at_events) if rng.random() < 0.5 else rng.randrange(START, log.end_ns() + 1)
        for _ in range(count)
    )
