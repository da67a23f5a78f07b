"""What became of a log that was asked: a row of every fleet's answer."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class LogOutcome(str, Enum):
    """How a log answered."""

    ok = "ok"
    live = "live"
    """It answered; somebody is writing to it, or it was not closed."""
    damaged = "damaged"
    gone = "gone"
    """There is no log, or none any more."""
    newer = "newer"
    """A later version of this program has written what is asked for."""
    refused = "refused"
    """The store or the disk does not let us, or does not answer."""
    failed = "failed"
    """The question itself failed on it."""
    worker_died = "worker died"
    """Each worker that was given it was ended: by its memory, or by a crash."""
    no_answer = "no answer"
    """No worker has answered for as long as the run waits: one has gone, or needs longer."""

    @property
    def is_good(self) -> bool:
        """Whether there is an answer."""
        return self in (LogOutcome.ok, LogOutcome.live)


@dataclass(frozen=True, slots=True)
class AskedLog:
    """A log, and what became of it."""

    place: str
    """Its path or URL, as it was asked."""
    outcome: LogOutcome
    log_id: str = ""
    robot: str = ""
    building: str = ""
    head: str = ""
    """Of the log as it answered: the hash of its last commit, in hexadecimal digits."""
    events: int = 0
    bytes: int = 0
    """Of its segments, read or not."""
    file: str = ""
    """Where the damage is."""
    byte: int | None = None
    text: str = ""
    """Why there is no answer."""
    is_kept: bool = False
    """An earlier run had its answer."""
