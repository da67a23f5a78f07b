"""A clock for logs that are to be the same at each run."""

from __future__ import annotations


class SteadyClock:
    """A clock that ticks a millisecond at each look, from a given moment on."""

    boot_id = bytes(range(16))

    def __init__(self, start_ns: int = 1_772_400_000 * 10**9) -> None:
        self.now_ns = start_ns
        self.ticks_ns = 0

    def wall_ns(self) -> int:
        self.now_ns += 10**6
        return self.now_ns

    def monotonic_ns(self) -> int:
        self.ticks_ns += 10**6
        return self.ticks_ns
