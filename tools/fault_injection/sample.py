"""A small log that holds one of everything, for damage to be done to copies of it.

Three segments of five commits each: the first compacted, the second as written, the third live
(or closed). Every kind of event, notes, a floor map, a commit of several chunks, a retraction;
keyframes at the segments' heads, within them, and in the middle of a commit.
"""

from __future__ import annotations

import random
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypedDict

import numpy as np
from steady_clock import SteadyClock

import semmap_log as sl
from semmap_log.domain.commits import Commit, Note
from semmap_log.domain.doors import DoorId, DoorState
from semmap_log.domain.events import (
    DoorAdded,
    DoorObserved,
    Event,
    FloorMap,
    LevelAdded,
    LogExported,
    Retracted,
    RobotPose,
)

NAME = "log"
COMMITS_A_SEGMENT = 5
LONG_COMMIT = 9
"""So many sightings make a commit of several chunks, once `CHUNK_BYTES` is small."""


class About(TypedDict):
    """What makes two samples the same, byte for byte."""

    clock: SteadyClock
    entropy: Callable[[int], bytes]
    compact: bool


@dataclass(frozen=True, slots=True)
class Sample:
    """The log at rest and how its writer came there."""

    closed: Path
    """As `close` leaves it."""
    live: Path
    """As a writer that was killed leaves it: the last segment has neither index nor footer."""
    older: Path
    """Of each segment, a version that it once was: what a disk might give back as stale."""
    commits: tuple[Commit, ...]
    """As `append` answered them."""


def make_sample(folder: Path) -> Sample:
    """Write the log into that folder, by way of the public calls alone."""
    path, older, live = folder / NAME, folder / "older" / NAME, folder / "live" / NAME
    with small_segments():
        make: About = {
            "clock": SteadyClock(),
            "entropy": random.Random(1).randbytes,
            "compact": False,
        }
        with sl.create(path, tz="Europe/Vienna", building="office", robot="tug1", **make) as log:
            commits = [do(log) for do in FIRST]
        shutil.copytree(path, older)
        compact_folder(path)
        with sl.append(path, **make) as log:
            commits += [do(log) for do in SECOND[:3]]
            shutil.copy2(path / f"{NAME}_000001.mcap", older)
            commits += [do(log) for do in (*SECOND[3:], *THIRD[:3])]
            shutil.copy2(path / f"{NAME}_000002.mcap", older)
            commits += [do(log) for do in THIRD[3:]]
            shutil.copytree(path, live)
    return Sample(path, live, older, tuple(commits))


def compact_folder(path: Path) -> None:
    """Compact the closed segments of a log."""
    from semmap_log.store.compaction import compact

    compact(path)


@contextmanager
def small_segments(commits: int = COMMITS_A_SEGMENT, chunk_bytes: int = 400) -> Iterator[None]:
    """Let writers roll after so many commits, and split commits at so few bytes.

    Keyframes stand within segments, and in the middle of long commits.
    """
    keyframes = {"KEYFRAME_EVERY_BYTES": 2 * chunk_bytes, "KEYFRAME_RARITY": 0}
    with constants(ROLL_COMMITS=commits, CHUNK_BYTES=chunk_bytes, **keyframes):
        yield


@contextmanager
def constants(*, within: str = "semmap_log.store.", **values: int) -> Iterator[None]:
    """Give constants of the log's form other values, wherever modules within have imported them."""
    modules = [m for name, m in list(sys.modules.items()) if name.startswith(within)]
    old = [(m, name, getattr(m, name)) for m in modules for name in values if hasattr(m, name)]
    assert {name for _, name, _ in old} == set(values), "a constant has another name"
    try:
        for module, name, _ in old:
            setattr(module, name, values[name])
        yield
    finally:
        for module, name, value in old:
            setattr(module, name, value)


Do = Callable[[sl.DoorLogWriter], Commit]


def _append(events: list[Event], log: sl.DoorLogWriter, **note: str) -> Commit:
    return log.append(events, note=Note(**note)).commit


def _plan(log: sl.DoorLogWriter) -> Commit:
    cells = np.arange(48, dtype=np.int8).reshape(6, 8)
    plan = FloorMap(level=1, resolution=0.05, origin_x=-1.0, origin_y=2.0, cells=cells)
    return _append([LevelAdded(level=1, name="first floor", elevation=3.5), plan], log)


def _sightings(log: sl.DoorLogWriter) -> Commit:
    states = (DoorState.OPEN, DoorState.CLOSED)
    seen = [DoorObserved(door_id=DoorId(1), state=states[i % 2]) for i in range(LONG_COMMIT)]
    return _append([RobotPose(level=0, x=1.0, y=2.0, theta=0.5), *seen], log, source="camera")


def _named(log: sl.DoorLogWriter) -> Commit:
    log.add_door(x=1.0, y=2.0, theta=0.1, width=0.9, name="front", actor="survey")
    return list(log.commits())[-1]


def _observed(state: str, log: sl.DoorLogWriter) -> Commit:
    return log.observe("front", state, accuracy=0.9, reason="seen in passing").commit


FIRST: tuple[Do, ...] = (
    _named,
    _plan,
    partial(
        _append, [DoorAdded(door_id=DoorId(7), level=0), DoorAdded(door_id=DoorId(9), level=1)]
    ),
    _sightings,
    partial(_observed, "open"),
)
SECOND: tuple[Do, ...] = (
    lambda log: log.update_door("front", prob_open=0.4, width=1.1).commit,
    lambda log: log.request("front", "open", actor="porter").commit,
    lambda log: log.start_patrol(reason="evening")[0].commit,
    _sightings,
    lambda log: log.passed("front", waited_s=2.5).commit,
)
THIRD: tuple[Do, ...] = (
    partial(_append, [Retracted(first_event=7, last_event=8)], actor="me"),
    lambda log: log.finish_patrol()[0].commit,
    _sightings,
    lambda log: log.remove_door(DoorId(9)).commit,
    partial(_append, [LogExported(format="yaml", file_name="doors.yaml", at_ns=10**18)]),
)
