"""Logs of four segments to damage, their earlier versions, and a copy that went on differently."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from steady_clock import SteadyClock

import semmap_log as sl
from fault_injection.sample import FIRST, NAME, SECOND, THIRD, small_segments
from fault_injection.subject import TELL_THE_END, remove_all
from semmap_log.domain.doors import DoorId, DoorState
from semmap_log.domain.events import DoorAdded, DoorObserved, Event
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader

OFFICE = Path(__file__).parents[2] / "recordings" / "office"
COMMITS_A_SEGMENT = 5
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
