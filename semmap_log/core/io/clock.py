"""What time it is, as an argument: the machine's clocks, which may lie, or a test's."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


MAX_TIME_NS = 2**63 - 1
"""Times are stored as MCAP's uint64 and handled as int64: good until the year 2262."""
_LATEST_NS = MAX_TIME_NS - 2**53
"""In 2261. Recorded times only grow: a clock that once showed the last time must leave room."""


class Clock(Protocol):
    """Where a log gets its times from."""

    boot_id: bytes
    """16 bytes that distinguish this boot of the machine from others; zeros: not known."""

    def wall_ns(self) -> int:
        """Return the wall clock, nanoseconds since 1970, UTC."""

    def monotonic_ns(self) -> int:
        """Return nanoseconds since some moment of this boot; never goes back."""


class SystemClock:
    """The machine's own clocks."""

    def __init__(self) -> None:
        try:
            self.boot_id = bytes.fromhex(_BOOT_ID.read_text().strip().replace("-", ""))
        except (OSError, ValueError):
            self.boot_id = bytes(16)

    def wall_ns(self) -> int:
        """Return the wall clock, nanoseconds since 1970, UTC."""
        return time.time_ns()

    def monotonic_ns(self) -> int:
        """Return nanoseconds since boot, sleep not counted."""
        return time.monotonic_ns()


@dataclass(slots=True)
class KeptClock:
    """The moment at which another log recorded a commit, for the log that takes it over."""

    recorded_ns: int
    boot_id: bytes = bytes(16)
    """Not known: the readings of its monotonic clock have no meaning any more."""

    def wall_ns(self) -> int:
        """Return that moment."""
        return self.recorded_ns

    def monotonic_ns(self) -> int:
        """Return 0: not known."""
        return 0


def believable_ns(clock: Clock) -> int:
    """Return what a wall clock says, nanoseconds since 1970; one far off counts as 1970 or 2261."""
    return min(max(clock.wall_ns(), 0), _LATEST_NS)
