"""A process of a test: what it has said so far, and its end."""

from __future__ import annotations

import re
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

DEADLINE_S = 100.0
"""How long anything may take that takes a second or two on an idle machine: it may have to share
its cores with everything else. Only a test that fails waits for so long."""


def wait_until(
    condition: Callable[[], T | None],
    what: str | Callable[[], str],
    *,
    timeout_s: float = DEADLINE_S,
) -> T:
    """Return what `condition` returns as soon as that is true; fail, saying what was awaited.

    A function for `what` is called at the end: it knows what was said meanwhile.
    """
    end = time.monotonic() + timeout_s
    while not (found := condition()):
        if time.monotonic() > end:
            awaited = what() if callable(what) else what
            raise AssertionError(f"waited {timeout_s:.0f} s in vain: {awaited}")
        time.sleep(0.02)
    return found


@dataclass(slots=True)
class Running:
    """A process that was started; `with` stops it at the end, also when the test fails."""

    process: subprocess.Popen[bytes]
    command: str
    folder: Path
    """Holds its output."""

    @property
    def output(self) -> str:
        """Return what it has written to standard output so far."""
        return (self.folder / "stdout").read_text(encoding="utf-8", errors="replace")

    @property
    def errors(self) -> str:
        """Return what it has written to standard error so far."""
        return (self.folder / "stderr").read_text(encoding="utf-8", errors="replace")

    @property
    def is_over(self) -> bool:
        return self.process.poll() is not None

    def __enter__(self) -> Running:  # noqa: PYI034 - Self came with Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        if not self.is_over:
            self.process.kill()
        self.process.wait(timeout=DEADLINE_S)

    def wait_for(self, pattern: str, *, timeout_s: float = DEADLINE_S) -> re.Match[str]:
        """Wait until it has said something, on either stream; fail if it ends without."""

        def said() -> re.Match[str] | None:
            is_over = self.is_over  # before looking: what it says last counts
            found = re.search(pattern, self.output + self.errors, re.MULTILINE)
            assert found or not is_over, f"ended without {pattern!r}: {self}"
            return found

        return wait_until(said, lambda: f"{pattern!r} of {self}", timeout_s=timeout_s)

    def write(self, text: str) -> None:
        """Send it something on standard input."""
        assert self.process.stdin is not None
        self.process.stdin.write(text.encode())
        self.process.stdin.flush()

    def wait(self, *, timeout_s: float = DEADLINE_S) -> int:
        """Return its exit code, once it has ended by itself."""
        try:
            return self.process.wait(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"did not end within {timeout_s:.0f} s: {self}") from None

    def finish(self, *, timeout_s: float = DEADLINE_S) -> str:
        """Return all its output, once it has ended by itself, with exit code 0."""
        code = self.wait(timeout_s=timeout_s)
        assert code == 0, f"exit code {code}: {self}"
        return self.output

    def stop(self, number: int = signal.SIGINT, *, timeout_s: float = DEADLINE_S) -> int:
        """Ask it to end, as Ctrl-C does; return its exit code."""
        self.process.send_signal(number)
        return self.wait(timeout_s=timeout_s)

    def kill(self) -> None:
        """End it as a power cut does."""
        self.process.kill()
        self.process.wait(timeout=DEADLINE_S)

    def __str__(self) -> str:
        return f"{self.command}\n{self.output[-4000:]}\n{self.errors[-4000:]}"
