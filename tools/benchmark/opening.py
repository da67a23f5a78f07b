"""Cases: programs started, and logs opened for reading or to go on after a crash."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from benchmark import mcap_fold
from benchmark.case import Case, Peer, Work
from benchmark.folding import commit_sizes
from benchmark.logs import DAILY_STATES, LIVE, ZSTD, Workshop, write_days
from benchmark.peers import OURS

if TYPE_CHECKING:
    import semmap_log as sl


START_ROUNDS = 10
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
        yield Case("start", title, "ms", (ours, bare), rounds or START_ROUNDS, has_memory=False)


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


YEARS_OF_DAYS = 1825
"""Five years, a segment a day."""
ROUNDS = 5
MCAP_OPENS = "mcap, all summaries"


def open_cases(shop: Workshop, count: int, rounds: int | None) -> Iterator[Case]:
    """Yield: a log opened for reading."""
    sizes = commit_sizes(count)
    for form, per_commit in ((LIVE, sizes[0]), (ZSTD, sizes[-1])):
        log = shop.log(count, per_commit, form)
        start = log.start()
        ours = Peer(OURS, partial(_open, log.path), sum(log.chunks))
        mcap = Peer(MCAP_OPENS, partial(_mcap_open, start.segments), sum(start.chunks),
                    start.count / count)  # fmt: skip
        title = f"Opening, {form}, {per_commit} a commit"
        yield Case("open", title, "ms", (ours, mcap), rounds or ROUNDS, events=count,
                   key=f"open, {form}")  # fmt: skip


def crash_case(shop: Workshop, rounds: int | None, *, tries_out: bool = False) -> Case:
    """Return: a log of five years opened to go on with, after a crash.

    Args:
        shop: Where it is made.
        rounds: Rounds that count; None: `ROUNDS`.
        tries_out: Only two months, to see whether everything works.
    """
    days = 60 if tries_out else YEARS_OF_DAYS
    path = shop.folder_for("years") / "log"
    shop.say(f"writing {days:,} segments")
    write_days(path, days)
    files = tuple(sorted(path.glob("*.mcap")))
    stored = 1 + (days - 1) * len(DAILY_STATES) - 1  # the last one is torn
    ours = Peer(OURS, partial(_append_after_crash, path), stored, promise="< 1000 ms")
    mcap = Peer("mcap, all but the torn one", partial(_mcap_open, files[:-1]),
                2 + (days - 2) * (1 + len(DAILY_STATES)))  # fmt: skip
    title = f"After a crash, {days:,} segments"
    return Case("open", title, "ms", (ours, mcap), rounds or ROUNDS)


def _open(path: Path) -> Work:
    import semmap_log as sl

    return Work(
        lambda _: sl.read(path),
        answer=lambda log: sum(len(segment.chunks) for segment in log._reader.segments),  # noqa: SLF001  # what was opened
    )


def _append_after_crash(path: Path) -> Work:
    import semmap_log as sl

    last = max(path.glob("*.mcap"))
    torn = last.read_bytes()
    opened: list[sl.DoorLogWriter] = []

    def crashed() -> Iterator[None]:
        """Put the torn segment back before each turn."""
        while True:
            while opened:
                opened.pop().close()
            last.unlink()
            last.write_bytes(torn)
            yield

    def once(_: None) -> None:
        opened.append(sl.append(path, compact=False))

    def answer(_: None) -> int:
        (log,) = opened
        return log.replay().event + 1

    return Work(once, crashed(), answer)


def _mcap_open(files: tuple[Path, ...]) -> Work:
    return Work(lambda _: mcap_fold.mcap_chunks(files))
