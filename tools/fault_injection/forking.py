"""A child process that plays, is ended at any moment, and has told what it had promised."""

from __future__ import annotations

import ctypes
import os
import signal
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import NoReturn

from fault_injection.player import Tell, Told

CRASHED = 3
_PR_SET_PDEATHSIG = 1
_write = os.write
"""The call itself: what stands in for it, under a fault, is for the log's writes."""


@dataclass(frozen=True, slots=True)
class Ended:
    """How a child ended, and what it told."""

    lines: tuple[str, ...]
    status: int
    """Exit code; negative: the signal that ended it."""
    error: str = ""
    """The traceback of what it did not expect."""

    @property
    def told(self) -> Told:
        """What it promised."""
        return Told.of(self.lines)

    @property
    def seen(self) -> int:
        """How many calls it counted, if it came to tell."""
        return int(self.lines[-1].removeprefix("seen "))


class Child:
    """A child process at work; what it tells goes through a pipe.

    A line is safe as soon as `tell` returns, however the process ends.
    """

    def __init__(self, work: Callable[[Tell], None]) -> None:
        """Start it."""
        self._heard = b""
        self._pipe, writer = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            os.close(self._pipe)
            _work(work, writer)
        os.close(writer)

    def heard(self) -> list[str]:
        """Return the lines that it has told until now; they are told by `wait` again."""
        os.set_blocking(self._pipe, False)
        with suppress(BlockingIOError):
            while data := os.read(self._pipe, 2**16):
                self._heard += data
        os.set_blocking(self._pipe, True)
        return self._heard.decode().splitlines()

    def kill(self) -> None:
        """End it, if it has not ended."""
        os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> Ended:
        """Return how it ended, once it has."""
        with os.fdopen(self._pipe, "rb") as pipe:
            lines = (self._heard + pipe.read()).decode().splitlines()
        _, status = os.waitpid(self.pid, 0)
        errors = [line[1:].replace("\0", "\n") for line in lines if line.startswith("!")]
        told = tuple(line for line in lines if not line.startswith("!"))
        return Ended(told, os.waitstatus_to_exitcode(status), "".join(errors))


def forked(work: Callable[[Tell], None]) -> Ended:
    """Return what became of `work` in a child process of its own."""
    return Child(work).wait()


def _work(work: Callable[[Tell], None], writer: int) -> NoReturn:
    code = CRASHED
    try:
        _end_with_parent()
        work(lambda line: _write_line(writer, line))
        code = 0
    except BaseException:  # noqa: BLE001 - the parent shows it
        _write_line(writer, "!" + traceback.format_exc().replace("\n", "\0"))
    finally:
        os._exit(code)


def _end_with_parent() -> None:
    """Have this process killed when the one that started it ends, however that ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def _write_line(fd: int, line: str) -> None:
    _write(fd, f"{line}\n".encode())
