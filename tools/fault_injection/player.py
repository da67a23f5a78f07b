"""Plays a story on a log, by the public functions, and tells what was promised when.

It also holds the log to what it promises of failures: after the first failed write or sync nothing
more is acknowledged, nothing more is written, and what had failed is not written later.
"""

from __future__ import annotations

import gc
import hashlib
import logging
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import accumulate
from pathlib import Path
from random import Random

from steady_clock import SteadyClock

import semmap_log as sl
from fault_injection.story import Act, Story
from semmap_log.core.model.events import PatrolStarted
from semmap_log.errors import LogError, LogPoisonedError, SemmapError
from semmap_log.interop.exporting.log_files import export
from semmap_log.log.door_log.appender import Appended
from semmap_log.log.door_log.door_log_writer import DoorLogWriter
from semmap_log.store.compaction import compact

LEVELS = ("event", "batch", "flush", "none")
BATCH_EVENTS = 8
NEVER_S = 3600.0
"""For batches: what is synced when then does not hang on how quick the machine is."""

_compactions = logging.getLogger("semmap_log")
_compactions.propagate = False  # that the background thread meets faults, too, is no news here
_compactions.addHandler(logging.NullHandler())

Tell = Callable[[str], None]
"""Takes a line; must have put it into safety outside the log's folder when it returns."""


@dataclass(frozen=True, slots=True)
class Told:
    """What a player had told when it was ended: wishes are counted from the first."""

    asked: int = 0
    """So many were given to `append`: more cannot be in the log."""
    accepted: int = 0
    """So many were answered: they survive the end of the process, if they are not held back."""
    durable: int = 0
    """So many were promised to survive a power cut."""
    exporting: int = 0
    """So many exports were begun,"""
    exported: tuple[str, ...] = ()
    """of which these ended; the digest of each file."""

    @classmethod
    def of(cls, lines: Iterable[str]) -> Told:
        """Return what these lines tell."""
        counts: dict[str, int] = {}
        exported: list[str] = []
        for line in lines:
            word, _, value = line.partition(" ")
            if word == "exported":
                exported.append(value)
            elif word in ("asked", "accepted", "durable", "exporting"):
                counts[word] = int(value)
        return cls(**counts, exported=tuple(exported))

    def lines(self) -> list[str]:
        """Return lines that tell this."""
        counts = ("asked", "accepted", "durable", "exporting")
        told = [f"{word} {getattr(self, word)}" for word in counts]
        return told + [f"exported {digest}" for digest in self.exported]


class Player:
    """Does a story's acts, one after the other; exports go into a folder `out` beside the log."""

    def __init__(
        self,
        folder: Path,
        story: Story,
        tell: Tell,
        durability: str = "event",
        batch_s: float = NEVER_S,
    ) -> None:
        self.folder = folder
        self.batch_s = batch_s
        self.out = folder.parent / "out" / "doors.yaml"
        self.durability = durability
        self.log: DoorLogWriter | None = None
        self._story = story
        self._tell = tell
        self._clock = SteadyClock()
        self._random = Random(0)
        self._accepted = self._durable = 0
        self._waits_for: Appended | None = None
        self._exports = 0

    def play(self) -> None:
        """Do all of it, and close the log."""
        for act in self._story.acts:
            self.do(act)
        self.close()

    def do(self, act: Act) -> None:
        """Do one act; raises what the log raises."""
        {
            "append": self._append,
            "repeat": self._repeat,
            "sync": self._sync,
            "wait": self._wait,
            "reopen": self.close,
            "export": self._export,
            "compact": self._compact,
        }[act]()

    def open(self) -> DoorLogWriter:
        """Return the log, open for writing."""
        if self.log is None:
            make = sl.append if list(self.folder.glob("*.mcap")) else _create
            self.log = make(
                self.folder,
                durability=self.durability,
                batch_events=BATCH_EVENTS,
                batch_s=self.batch_s,
                clock=self._clock,
                entropy=self._random.randbytes,
            )
        return self.log

    def close(self) -> None:
        """Close the log if it is open."""
        if self.log is not None:
            self.log.close()
            self.log = self._waits_for = None
            self._promise(self._accepted)

    def _append(self) -> None:
        log = self.open()
        wish = self._story.wishes[self._accepted]
        self._tell(f"asked {self._accepted + 1}")
        appended = log.append(wish.events, note=wish.note, command_id=wish.command_id)
        self._accepted += 1
        self._tell(f"accepted {self._accepted}")
        self._waits_for = appended
        self._tell_durable(log.durable_before, appended.commit.last_event + 1)

    def _repeat(self) -> None:
        log = self.open()
        if self._accepted == 0:
            return
        wish = self._story.wishes[self._accepted - 1]
        again = log.append(wish.events, note=wish.note, command_id=wish.command_id)
        assert again.repeated, "a command that was stored is stored once more"

    def _sync(self) -> None:
        self.open().sync()
        self._promise(self._accepted)

    def _wait(self) -> None:
        if self._waits_for is not None:
            self._waits_for.wait()
            self._promise(self._accepted)

    def _promise(self, durable: int) -> None:
        self._durable = durable
        self._tell(f"durable {durable}")

    def _tell_durable(self, durable_before: int, appended_before: int) -> None:
        """Tell what the log itself says to be on the disk; check that it is what it promises."""
        ends = accumulate(len(wish.events) for wish in self._story.wishes)
        self._promise(sum(end <= durable_before for end in ends))
        unsynced = appended_before - durable_before
        if self.durability == "event":
            assert unsynced == 0, "an append returned before it was durable"
        if self.durability == "batch":
            assert unsynced < BATCH_EVENTS, f"{unsynced} events of a batch are not durable"

    def _export(self) -> None:
        log = self.open()
        self._tell(f"exporting {self._exports + 1}")
        export(log, self.out, default_prob=0.5)
        self._exports += 1
        unwatched = Path(f"/proc/self/root{self.out}")  # a fault is not meant to hit this reading
        digest = hashlib.sha256(unwatched.read_bytes()).hexdigest()
        self._tell(f"exported {digest}")

    def _compact(self) -> None:
        self.close()
        if list(self.folder.glob("*.mcap")):
            compact(self.folder)


_create = partial(sl.create, tz="UTC")


MOST_TRIES = 3
"""Of one act; then the fault is one that stays, and the run is over."""


class StubbornPlayer(Player):
    """Opens the log again after each failure, and does what failed once more."""

    def __init__(
        self,
        folder: Path,
        story: Story,
        tell: Tell,
        durability: str,
        failed: Callable[[], None] = lambda: None,
    ) -> None:
        """Prepare.

        Args:
            folder: The log's.
            story: What to play.
            tell: Hears what was promised; and `failure …`, and `broken …` for a broken promise.
            durability: The log's.
            failed: Called after the first failure: to make room on a disk, for instance.
        """
        super().__init__(folder, story, tell, durability)
        self._after_failure = failed

    def play(self) -> None:
        """Do all of it, or as much as can be done."""
        if all(self._done(act) for act in (*self._story.acts, "reopen")):
            self._tell("finished")

    def _done(self, act: Act) -> bool:
        """Do one act; tell whether it was done in the end."""
        return any(self._tried(act) for _ in range(MOST_TRIES))

    def open(self) -> DoorLogWriter:
        """Return the log; what waited in memory when it failed has to be wished once more."""
        was_closed = self.log is None
        log = super().open()
        if was_closed and self.durability == "none":
            self._accepted = min(self._accepted, sum(1 for _ in log.commits()))
            if self._accepted < self._durable:
                self._tell(f"broken {self._durable - self._accepted} synced commits are gone")
        return log

    def _tried(self, act: Act) -> bool:
        try:
            self.do(act)
        except (SemmapError, OSError) as error:
            self._tell(f"failure {act}: {type(error).__name__}: {error}")
            if not isinstance(error, SemmapError):
                self._tell(f"broken {act}: an error that is none of the log's: {error!r}")
            self._recover(error)
            return False
        return True

    def _recover(self, error: Exception) -> None:
        """Let go of the log as a program does; check that nothing is written behind its back."""
        self._after_failure()  # first: what had failed could be written now
        log, self.log, self._waits_for = self.log, None, None
        if log is not None:
            if isinstance(error, LogPoisonedError):
                before = self._segments()
                self._check_refuses(log)
                self._check_unchanged(before, "the next append")
                _close(log)
                self._check_unchanged(before, "close")
                del log
                gc.collect()
                self._check_unchanged(before, "garbage collection")
            else:
                _close(log)

    def _check_refuses(self, log: DoorLogWriter) -> None:
        """Check that a log that has failed acknowledges nothing more."""
        for what, call in (
            ("append", lambda: log.append([PatrolStarted(patrol=0)])),
            ("sync", log.sync),
        ):
            with suppress(LogError):
                call()
                self._tell(f"broken {what} is acknowledged after a failed write or sync")

    def _segments(self) -> dict[str, tuple[int, int, int]] | None:
        """Return what changes when a segment does; None: no file may be opened to look."""
        try:
            found = [(path.name, path.stat()) for path in self.folder.glob("*.mcap")]
        except OSError:
            return None
        return {name: (status.st_ino, status.st_size, status.st_mtime_ns) for name, status in found}

    def _check_unchanged(self, before: dict[str, tuple[int, int, int]] | None, what: str) -> None:
        after = self._segments()
        if None not in (before, after) and after != before:
            self._tell(f"broken after a failure, {what} changed a segment")


def _close(log: DoorLogWriter) -> None:
    with suppress(SemmapError):
        log.close()
