"""Cases: how long until a program that uses the package, or its command line, has its answer."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmark.case import Case, Peer, Work

ROUNDS = 10
PYTHON = "Python alone"
OFFICE = str(Path(__file__).parents[2] / "recordings" / "office")

REPLAY = "import sys, semmap_log as sl; sl.read(sys.argv[1]).replay()"
VERB = ("-m", "semmap_log")


def start_cases(rounds: int | None) -> Iterator[Case]:
    """Yield: from nothing to the end of a process that did next to nothing."""
    bare = Peer(PYTHON, partial(_run, "-c", "pass"), 0)
    for title, promise, arguments in (
        ("import semmap_log", "< 150 ms", ("-c", "import semmap_log")),
        ("semmap-log --help", "< 400 ms", (*VERB, "--help")),
        ("sl.read(office).replay()", "< 150 ms", ("-c", REPLAY, OFFICE)),
        ("semmap-log replay office", "< 350 ms", (*VERB, "replay", OFFICE)),
        ("semmap-log history office", "", (*VERB, "history", OFFICE)),
        ("semmap-log probabilities office", "", (*VERB, "probabilities", OFFICE)),
    ):
        ours = Peer("semmap-log", partial(_run, *arguments), 0, promise=promise)
        yield Case("start", title, "ms", (ours, bare), rounds or ROUNDS, has_memory=False)


def _run(*arguments: str) -> Work:
    """Return what starts such a process; the first one compiles the modules, and does not count."""
    compiled = TemporaryDirectory(prefix="starting_")
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": compiled.name}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    command = [sys.executable, *arguments]

    def once(_: object) -> int:
        assert compiled.name, "stays as long as the work does"
        done = subprocess.run(command, check=True, capture_output=True, env=environment)
        return done.returncode

    return Work(once)
