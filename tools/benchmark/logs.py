"""The logs and tables that are measured: made once for a run, in its folder."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmark.patrol import START_NS, STEP_NS, grouped, patrol

LIVE, PLAIN, ZSTD = "live", "plain", "zstd"
"""As it was written; compacted, chunks of about a MiB left as they are; compacted as it is done."""
FORMS = (LIVE, PLAIN, ZSTD)

DAY_NS = 24 * 3600 * 10**9
DAILY_STATES = ("open", "closed", "open")
TORN_BYTES = 200
"""The last commit of a log that was killed lacks so many bytes."""

SLOW_EVENTS = 20_000
"""A peer below 500,000 events/s reads so many events only, from the log's beginning."""


@dataclass(frozen=True, slots=True)
class Sample:
    """The beginning of a log: what a slow peer is given."""

    files: tuple[Path, ...]
    """The segments that it lies in."""
    count: int
    """Events in it."""
    until_ns: int
    """Everything in it was recorded before then, and everything behind it after."""


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

    def sample(self) -> Sample:
        """Return its first `SLOW_EVENTS`, or all."""
        count = min(self.count, SLOW_EVENTS)  # a whole number of commits, whatever their size
        files = [path for path, first in zip(self.segments, self.first_events, strict=True)
                 if first < count]  # fmt: skip
        return Sample(tuple(files), count, START_NS + count * STEP_NS + STEP_NS // 2)

    def start(self, least: int = SLOW_EVENTS) -> BenchLog:
        """Return the log's first segments, as many as hold at least so many events."""
        ends = (*self.first_events[1:], self.count)
        n = next((i for i, end in enumerate(ends, start=1) if end >= least), len(ends))
        return BenchLog(self.path, ends[n - 1], self.segments[:n], self.first_events[:n],
                        self.chunks[:n])  # fmt: skip

    @property
    def bytes(self) -> int:
        """Size of its segments."""
        return sum(path.stat().st_size for path in self.segments)


@dataclass(slots=True)
class Workshop:
    """The folder of a run, and what was made in it so far."""

    folder: Path
    say: Callable[[str], None]
    """Told what is being made."""
    most_bytes: int = 0
    """Most that lay in the folder at a time, as far as `look` saw."""
    _logs: dict[tuple[int, int, str], BenchLog] = field(default_factory=dict)
    _tables: dict[tuple[str, int], Path] = field(default_factory=dict)

    def log(self, count: int, per_commit: int, form: str) -> BenchLog:
        """Return a patrol's log; made when it is asked for first.

        Args:
            count: Events.
            per_commit: Events a commit.
            form: One of `FORMS`.
        """
        key = (count, per_commit, form)
        if key not in self._logs:
            self._logs[key] = self._make(count, per_commit, form)
        return self._logs[key]

    def table(self, name: str, count: int, write: Callable[[Path, int], None]) -> Path:
        """Return a patrol's events as a table of somebody else's, made when asked for first.

        Args:
            name: Of the file.
            count: Events.
            write: Writes that patrol to a path.

        Raises:
            ModuleNotFoundError: What writes it is not installed.
        """
        key = (name, count)
        if key not in self._tables:
            self.say(f"writing {count:,} events to {name}")
            path = self.folder / f"{count}_{name}"
            write(path, count)
            self._tables[key] = path
        return self._tables[key]

    def folder_for(self, name: str) -> Path:
        """Return a new, empty folder."""
        path = self.folder / name
        path.mkdir()
        return path

    def look(self) -> None:
        """See how much lies in the folder now."""
        files = [path for path in self.folder.rglob("*") if path.is_file()]
        self.most_bytes = max(self.most_bytes, sum(path.stat().st_size for path in files))

    def clear(self) -> None:
        """Remove all that was made, so that one size's logs make room for the next."""
        self.look()
        self._logs.clear()
        self._tables.clear()
        for path in self.folder.iterdir():
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink()

    def _make(self, count: int, per_commit: int, form: str) -> BenchLog:
        path = self.folder / f"{count}_by_{per_commit}_{FORMS.index(form)}" / "log"
        path.parent.mkdir()
        if form == LIVE:
            self.say(f"writing {count:,} events, {per_commit} a commit")
            write_patrol(path, count, per_commit)
        else:
            from semmap_log.store.compaction import compact

            live = self.log(count, per_commit, LIVE)
            self.say(f"compacting {count:,} events, {per_commit} a commit")
            shutil.copytree(live.path, path)
            with uncompressed() if form == PLAIN else nullcontext():
                compact(path, keep_s=0)
            _check_form(path, form)
        return _described(path, count)


@contextmanager
def uncompressed() -> Iterator[None]:
    """Have compaction leave its chunks as they are, to see what reading costs without zstd.

    Users have no such choice: it is a change to the library's inside, for the experiment.
    """
    from unittest.mock import patch

    from semmap_log.store.chunks import build_chunk
    from semmap_log.store.compaction import merge

    def build_plain(records: Any, offsets: Any, *, compression: str = "") -> Any:
        del compression
        return build_chunk(records, offsets, compression="")

    with patch.object(merge, "build_chunk", build_plain):
        yield


def _check_form(path: Path, form: str) -> None:
    """Return if the chunks of a log are what its rows in the table will say.

    Raises:
        RuntimeError: They are not: the experiment's change has no effect any more.
    """
    from benchmark.mcap_fold import compressed_share

    share = compressed_share(sorted(path.glob("*.mcap")))
    if (share > 0.5) != (form == ZSTD):
        raise RuntimeError(f"{form}: {share:.0%} of the bytes are in compressed chunks")


def write_patrol(path: Path, count: int, per_commit: int) -> None:
    """Write a patrol's log as a robot would, without waiting for the disk at each commit."""
    import semmap_log as sl
    from semmap_log.core.io.clock import KeptClock

    clock = KeptClock(START_NS)
    entropy = random.Random(count).randbytes
    with sl.create(path, tz="Europe/Vienna", clock=clock, entropy=entropy, compact=False) as log:
        for events in grouped(patrol(count), per_commit):
            clock.recorded_ns += STEP_NS * len(events)
            log.append(events, sync=False)
        log.sync()


def write_days(path: Path, days: int) -> None:
    """Write a log of a few sightings a day, a segment a day, and leave it as a kill does."""
    import semmap_log as sl
    from semmap_log.core.io.clock import KeptClock

    clock = KeptClock(START_NS)
    source = path.with_name("running") / path.name
    source.parent.mkdir()
    options: dict[str, Any] = {
        "tz": "UTC",
        "clock": clock,
        "entropy": random.Random(days).randbytes,
    }
    with sl.create(source, **options, durability="flush", compact=False) as log:
        door = log.add_door()
        for _ in range(days - 1):
            clock.recorded_ns += DAY_NS
            for state in DAILY_STATES:
                log.observe(door, state)
        shutil.copytree(source, path)
    last = max(path.glob("*.mcap"))
    last.write_bytes(last.read_bytes()[:-TORN_BYTES])


def _described(path: Path, count: int) -> BenchLog:
    from semmap_log.store.reading.reader import LogReader

    segments = LogReader(path).segments
    return BenchLog(
        path,
        count,
        tuple(segment.path for segment in segments),
        tuple(segment.header.first_event for segment in segments),
        tuple(len(segment.chunks) for segment in segments),
    )
