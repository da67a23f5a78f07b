"""A child process that plays, is ended at any moment, and has told what it had promised."""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable
from dataclasses import dataclass

from fault_injection.player import Tell, Told

CRASHED = 3


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


def forked(work: Callable[[Tell], None]) -> Ended:
    """Return what became of `work` in a child process of its own.

    What it tells goes through a pipe: it is safe as soon as `tell` returns, however it ends.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        code = CRASHED
        try:
            work(lambda line: _write_line(writer, line))
            code = 0
        except BaseException:  # noqa: BLE001 - the parent shows it
            _write_line(writer, "!" + traceback.format_exc().replace("\n", "\0"))
        finally:
            os._exit(code)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        lines = pipe.read().decode().splitlines()
    _, status = os.waitpid(child, 0)
    errors = [line[1:].replace("\0", "\n") for line in lines if line.startswith("!")]
    told = tuple(line for line in lines if not line.startswith("!"))
    return Ended(told, os.waitstatus_to_exitcode(status), "".join(errors))


def _write_line(fd: int, line: str) -> None:
    os.write(fd, f"{line}\n".encode())
