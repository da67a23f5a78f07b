"""A player that does not give up: what a careful program does when its log says that it failed.

It also holds the log to what it promises of failures: after the first failed write or sync nothing
more is acknowledged, nothing more is written, and what had failed is not written later.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from fault_injection.player import Player, Tell
from fault_injection.story import Act, Story
from semmap_log.core.model.events import PatrolStarted
from semmap_log.errors import LogError, LogPoisonedError, SemmapError
from semmap_log.log.door_log.door_log_writer import DoorLogWriter

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
