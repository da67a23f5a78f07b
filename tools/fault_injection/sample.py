"""Logs that hold one of everything, for damage to be done to copies of them.

Three segments of five commits each: the first compacted, the second as written, the third live
(or closed). Every kind of event, notes, a floor map, a commit of several chunks, a retraction;
keyframes at the segments' heads, within them, and in the middle of a commit.
"""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypedDict

import numpy as np
from steady_clock import SteadyClock

import semmap_log as sl
from fault_injection.judging import TELL_THE_END, remove_all
from fault_injection.story import constants
from semmap_log.core.model.commits import Commit, Note
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    DoorAdded,
    DoorObserved,
    Event,
    FloorMap,
    LevelAdded,
    LogExported,
    Retracted,
    RobotPose,
)
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader

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


OFFICE = Path(__file__).parents[2] / "recordings" / "office"
DIVERGED_FROM = 2
"""The copy has the first two segments in common with the log."""


def _seen(door: int, state: str, log: sl.DoorLogWriter) -> object:
    return log.observe(door, state, accuracy=0.8, source="camera")


FOURTH: tuple[Callable[[sl.DoorLogWriter], object], ...] = (
    lambda log: log.append(
        [DoorAdded(door_id=DoorId(11), level=0, x=4.0, y=1.0, theta=0.0, width=0.8)]
    ),
    partial(_seen, 7, "open"),
    lambda log: log.annotate(11, "name", "back"),
    partial(_seen, 11, "closed"),
    lambda log: log.update_door(1, prob_open=0.3),
)


@dataclass(frozen=True)
class Chain:
    """A log at rest, and all that it once was or might have been."""

    title: str
    log: Path
    early: dict[str, tuple[Path, ...]]
    """File name -> closed versions of that segment with fewer commits, and of other files."""
    diverged: Path | None
    """The same log, gone on differently: the same event numbers, times and sizes."""
    foreign: Path
    """Another log, whose segments have the same names."""

    @property
    def is_live(self) -> bool:
        """Whether nothing tells where its last segment ends: a writer was killed, or marks went."""
        return self.title in {"live", "untold"}


def make_chains(folder: Path) -> list[Chain]:
    """Write the logs: closed, live, without marks, compacted, and the office recording."""
    closed, live = folder / "closed" / NAME, folder / "live" / NAME
    early = _write(closed, live, folder / "early")
    diverged = _diverged(closed, folder)
    compacted, packed = folder / "compacted" / NAME, folder / "packed" / NAME
    shutil.copytree(closed, compacted, ignore=shutil.ignore_patterns(".lock"))
    compact(compacted, merge=False)
    shutil.copytree(diverged, packed, ignore=shutil.ignore_patterns(".lock"))
    compact(packed, merge=False)
    untold = folder / "untold" / NAME
    shutil.copytree(closed, untold, ignore=shutil.ignore_patterns(".lock"))
    remove_all(untold, TELL_THE_END)
    office = folder / "office" / "office"
    shutil.copytree(OFFICE, office)
    foreign = _another_log(folder / "foreign" / NAME)
    return [
        Chain("closed", closed, early, diverged, foreign),
        Chain("live", live, early, diverged, foreign),
        Chain("untold", untold, early, diverged, foreign),
        Chain("compacted", compacted, early, packed, foreign),
        Chain("office", office, {}, None, foreign),
    ]


def _another_log(path: Path) -> Path:
    """Write a log with the same names and numbers, that is another one."""
    with (
        small_segments(COMMITS_A_SEGMENT),
        sl.create(path, tz="UTC", compact=False, clock=SteadyClock()) as log,
    ):
        for _ in range(4 * COMMITS_A_SEGMENT):
            log.add_door()
    return path


def _write(path: Path, live: Path, early: Path) -> dict[str, tuple[Path, ...]]:
    """Write the log, a copy of it before it was closed, and early versions of its segments."""
    acts: tuple[Callable[[sl.DoorLogWriter], object], ...] = (*FIRST, *SECOND, *THIRD, *FOURTH)
    versions: dict[str, tuple[Path, ...]] = {}
    with small_segments(COMMITS_A_SEGMENT):
        log = sl.create(
            path,
            tz="Europe/Vienna",
            building="office",
            robot="tug1",
            compact=False,
            clock=SteadyClock(),
            entropy=random.Random(1).randbytes,
        )
        with log:
            for done, act in enumerate(acts, 1):
                act(log)
                if done % COMMITS_A_SEGMENT in (1, 3):
                    _keep_early(path, early / str(done) / NAME, versions)
            shutil.copytree(path, live, ignore=shutil.ignore_patterns(".lock"))
    return versions


def _keep_early(log: Path, to: Path, versions: dict[str, tuple[Path, ...]]) -> None:
    """Close a copy of a log as it is now: what its last segment, and its other files, once were."""
    shutil.copytree(log, to, ignore=shutil.ignore_patterns(".lock"))
    sl.append(to, compact=False).close()
    last = max(to.glob("*.mcap"))
    others = [p for p in to.iterdir() if p.suffix != ".mcap" and p.name != ".lock"]
    for path in (last, *others):
        versions[path.name] = (*versions.get(path.name, ()), path)


def _diverged(closed: Path, folder: Path) -> Path:
    """Return a log with the same first segments, that went on with as many other events."""
    path = folder / "diverged" / NAME
    path.mkdir(parents=True)
    for segment in sorted(closed.glob("*.mcap"))[:DIVERGED_FROM]:
        shutil.copy2(segment, path)
    original = LogReader(closed)
    first = original.segments[DIVERGED_FROM].header.first_event
    clock = SteadyClock(LogReader(path).last_log_time_ns() + 10**6)
    with (
        small_segments(COMMITS_A_SEGMENT),
        sl.append(path, compact=False, clock=clock, entropy=random.Random(2).randbytes) as log,
    ):
        for commit in original.commits():
            if commit.first_event >= first:
                numbers = range(commit.first_event, commit.last_event + 1)
                log.append([_otherwise(original.event(number).event) for number in numbers])
    return path


def _otherwise(event: Event) -> Event:
    """Return what another sensor might have seen."""
    if not isinstance(event, DoorObserved):
        return event
    state = DoorState.OPEN if event.state is DoorState.CLOSED else DoorState.CLOSED
    return replace(event, state=state)
