"""Cases: how long until a program that uses the package, or its command line, is there."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from functools import partial

from benchmark.case import Case, Peer, Work

ROUNDS = 10
PYTHON = "Python alone"


def start_cases(rounds: int | None) -> Iterator[Case]:
    """Yield: from nothing to the end of a process that did next to nothing."""
    bare = Peer(PYTHON, partial(_run, "-c", "pass"), 0)
    for title, promise, arguments in (
        ("import semmap_log", "< 150 ms", ("-c", "import semmap_log")),
        ("semmap-log --help", "< 400 ms", ("-m", "semmap_log", "--help")),
    ):
        ours = Peer("semmap-log", partial(_run, *arguments), 0, promise=promise)
        yield Case("start", title, "ms", (ours, bare), rounds or ROUNDS, has_memory=False)


def _run(*arguments: str) -> Work:
    command = [sys.executable, *arguments]
    return Work(lambda _: subprocess.run(command, check=True, capture_output=True).returncode)
