"""The logs that are measured: made once for a run, in its folder."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from benchmark.patrol import START_NS, STEP_NS, grouped, patrol

DAY_NS = 24 * 3600 * 10**9
DAILY_STATES = ("open", "closed", "open")
TORN_BYTES = 200
"""The last commit of a log that was killed lacks so many bytes."""

SLOW_EVENTS = 20_000
"""A peer below 100,000 events/s reads the first segments only, with at least so many events."""


@dataclass(frozen=True, slots=True)
class BenchLog:
    """A patrol's log on disk."""

    path: Path
    count: int
    """Events in it."""
    segments: tuple[Path, ...]
    first_events: tuple[int, ...]
    """Number of the first event of each segment."""
    chunks: tuple[int, ...]
    """How many chunks each segment has."""

    def start(self, least: int = SLOW_EVENTS) -> BenchLog:
        """Return the log's first segments, as many as hold at least so many events."""
        ends = (*self.first_events[1:], self.count)
        n = next((i for i, end in enumerate(ends, start=1) if end >= least), len(ends))
        return BenchLog(self.path, ends[n - 1], self.segments[:n], self.first_events[:n],
                        self.chunks[:n])  # fmt: skip


@dataclass(slots=True)
class Workshop:
    """The folder of a run, and what was made in it so far."""

    folder: Path
    say: Callable[[str], None]
    """Told what is being made."""
    _logs: dict[tuple[int, int, bool], BenchLog] = field(default_factory=dict)

    def log(self, count: int, per_commit: int, *, compacted: bool) -> BenchLog:
        """Return a patrol's log; made when it is asked for first.

        Args:
            count: Events.
            per_commit: Events a commit.
            compacted: In chunks of about a MiB, zstd; else as it was written.
        """
        key = (count, per_commit, compacted)
        if key not in self._logs:
            self._logs[key] = self._make(count, per_commit, compacted=compacted)
        return self._logs[key]

    def folder_for(self, name: str) -> Path:
        """Return a new, empty folder."""
        path = self.folder / name
        path.mkdir()
        return path

    def _make(self, count: int, per_commit: int, *, compacted: bool) -> BenchLog:
        name = f"{count}_by_{per_commit}_{'compacted' if compacted else 'live'}"
        path = self.folder / name / "log"
        path.parent.mkdir()
        if compacted:
            from semmap_log.log.compaction import compact

            live = self.log(count, per_commit, compacted=False)
            self.say(f"compacting {count:,} events, {per_commit} a commit")
            shutil.copytree(live.path, path)
            compact(path)
        else:
            self.say(f"writing {count:,} events, {per_commit} a commit")
            write_patrol(path, count, per_commit)
        return _described(path, count)


def write_patrol(path: Path, count: int, per_commit: int) -> None:
    """Write a patrol's log as a robot would, without waiting for the disk at each commit."""
    from patrol_sim.journal import SimulatedClock

    import semmap_log as sl

    clock = SimulatedClock(START_NS, bytes(16))
    entropy = random.Random(count).randbytes
    with sl.create(path, tz="Europe/Vienna", clock=clock, entropy=entropy, compact=False) as log:
        for events in grouped(patrol(count), per_commit):
            clock.now_ns += STEP_NS * len(events)
            log.append(events, sync=False)
        log.sync()


def write_days(path: Path, days: int) -> None:
    """Write a log of a few sightings a day, a segment a day, and leave it as a kill does."""
    from patrol_sim.journal import SimulatedClock

    import semmap_log as sl

    clock = SimulatedClock(START_NS, bytes(16))
    source = path.with_name("running") / path.name
    source.parent.mkdir()
    options = {"tz": "UTC", "clock": clock, "entropy": random.Random(days).randbytes}
    with sl.create(source, **options, durability="flush", compact=False) as log:
        door = log.add_door()
        for _ in range(days - 1):
            clock.now_ns += DAY_NS
            for state in DAILY_STATES:
                log.observe(door, state)
        shutil.copytree(source, path)
    last = max(path.glob("*.mcap"))
    last.write_bytes(last.read_bytes()[:-TORN_BYTES])


def _described(path: Path, count: int) -> BenchLog:
    import semmap_log as sl

    segments = sl.read(path).reader.segments
    return BenchLog(
        path,
        count,
        tuple(segment.path for segment in segments),
        tuple(segment.header.first_event for segment in segments),
        tuple(len(segment.chunks) for segment in segments),
    )
