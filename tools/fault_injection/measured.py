"""What a verb costs: seconds of a processor and memory of a child process of its own."""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from fault_injection.questions import TRACEBACK, Answer, ask_verb

ROOM_MIB = 1024
"""Address space beyond what there is: more is refused by the kernel."""
LONGEST_S = 12
"""Of work, in seconds of a processor; what takes longer is ended."""
DEADLINE_S = 120
"""So long may pass until then, on a machine that has other work, too: what hangs is ended."""


@dataclass(frozen=True, slots=True)
class Measured:
    """What a child process did, and took for it."""

    answer: Answer
    cpu_s: float
    mib: int
    """So much more memory it had at once than when it began."""


def measured(arguments: tuple[str, ...], room: Path) -> Measured:
    """Run a verb in a child process, with little room and time.

    Args:
        arguments: Of the command line.
        room: A folder for what it writes.
    """
    told, begun = room / "told.json", room / "begun"
    told.unlink(missing_ok=True)
    pid = os.fork()
    if pid == 0:
        _run(arguments, room, told)
    _, status, used = os.wait4(pid, 0)
    code = os.waitstatus_to_exitcode(status)
    answer = Answer(TRACEBACK, "", f"ended by {_end(code)}")
    if told.exists():
        answer = Answer(*json.loads(told.read_text()))
    at_first = int(begun.read_text())
    return Measured(answer, used.ru_utime + used.ru_stime, used.ru_maxrss // 1024 - at_first)


def _end(code: int) -> str:
    return f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"


def _run(arguments: tuple[str, ...], room: Path, told: Path) -> NoReturn:
    """For the child: it never returns."""
    code = 3
    try:
        (room / "begun").write_text(str(_mib(1)))
        _limit()
        answer = ask_verb(arguments, room, room / "out", last=10_000)
        partial = told.with_suffix(".part")
        partial.write_text(json.dumps([answer.code, answer.said, answer.error]))
        partial.rename(told)
        code = 0
    finally:
        os._exit(code)


def _mib(place: int) -> int:
    """Return how much memory this process has: 0: addresses, 1: what is there."""
    pages = int(Path("/proc/self/statm").read_text().split()[place])
    return pages * os.sysconf("SC_PAGE_SIZE") // 2**20


def _limit() -> None:
    most = (_mib(0) + ROOM_MIB) * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_S, LONGEST_S + 2))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(DEADLINE_S)


def load_what_it_loads(arguments: tuple[str, ...], room: Path) -> None:
    """Run a verb in a child process, and import here what it imported: it costs others nothing.

    Args:
        arguments: Of the command line.
        room: A folder for what it writes.
    """
    names = room / "names"
    pid = os.fork()
    if pid == 0:
        with suppress(BaseException):
            before = set(sys.modules)
            ask_verb(arguments, room, room / "out")
            names.write_text("\n".join(name for name in sys.modules if name not in before))
        os._exit(0)
    os.waitpid(pid, 0)
    for name in names.read_text().splitlines() if names.exists() else ():
        with suppress(Exception):
            import_module(name)
    names.unlink(missing_ok=True)
