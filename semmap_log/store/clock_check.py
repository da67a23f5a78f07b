"""Clocks lie: which commits bear a wall clock that cannot be right."""

from __future__ import annotations

from dataclasses import dataclass

from semmap_log.core.model.commits import Commit
from semmap_log.core.model.moments import format_utc

JUMP_NS = 60 * 10**9
"""A wall clock that moves by more than this against the monotonic clock of its boot is suspect."""
NEVER_BEFORE_NS = 946_684_800 * 10**9
"""2000-01-01: no log is older, so a clock that says so was never set."""
NEVER_AFTER_NS = 4_102_444_800 * 10**9
"""2100-01-01: no log is so young, so a clock that says so is wrong."""

_UNITS = ((365 * 86_400, "years"), (86_400, "days"), (3_600, "h"), (60, "min"), (1, "s"))


@dataclass(frozen=True, slots=True)
class SuspectCommit:
    """A commit whose wall clock cannot be right."""

    event: int
    """Its first event."""
    wall_clock_ns: int
    why: str

    @property
    def text(self) -> str:
        """Return it in words."""
        return f"event {self.event}, {format_utc(self.wall_clock_ns)}: {self.why}"


class ClockCheck:
    """Looks at commits in their order."""

    def __init__(self) -> None:
        self._previous: Commit | None = None

    def add(self, commit: Commit) -> SuspectCommit | None:
        """Take the next commit; return what is suspect about it."""
        why = clock_problem(self._previous, commit)
        self._previous = commit
        return SuspectCommit(commit.first_event, commit.wall_clock_ns, why) if why else None

    def forget(self) -> None:
        """Start over: the next commit is not the one that came after the last."""
        self._previous = None


def clock_problem(previous: Commit | None, commit: Commit) -> str:
    """Return why a commit's wall clock cannot be right; empty if it can.

    Args:
        previous: The commit before it in the log; None: there is none.
        commit: The commit.
    """
    is_unset = commit.wall_clock_ns < NEVER_BEFORE_NS
    if is_unset and (previous is None or previous.wall_clock_ns >= NEVER_BEFORE_NS):
        return "the wall clock was not set from here on: it says a time before the year 2000"
    if commit.wall_clock_ns >= NEVER_AFTER_NS and (
        previous is None or previous.wall_clock_ns < NEVER_AFTER_NS
    ):
        return "the wall clock was wrong from here on: it says a time after the year 2099"
    if previous is None:
        return ""
    moved = commit.wall_clock_ns - previous.wall_clock_ns
    if moved < 0:
        return f"the wall clock went back by {_length(-moved)}"
    if commit.boot_id != previous.boot_id or not any(commit.boot_id):
        return ""
    drift = moved - (commit.monotonic_clock_ns - previous.monotonic_clock_ns)
    if drift > JUMP_NS:
        return f"the wall clock jumped ahead by {_length(drift)}"
    if drift < -JUMP_NS:
        done = "stood still for" if not moved else "fell behind by"
        return f"the wall clock {done} {_length(-drift)}"
    return ""


def _length(ns: int) -> str:
    """Return a length of time in its largest unit: `2.5 h`."""
    seconds = ns / 1e9
    for unit_s, name in _UNITS:
        if seconds >= unit_s:
            return f"{seconds / unit_s:.3g} {name}"
    return f"{seconds:.3g} s"
