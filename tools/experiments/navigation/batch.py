"""Many runs, on several processes; what was done before is not done again."""

from __future__ import annotations

import multiprocessing
import shutil
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache
from pathlib import Path

from navigation.floors import Floor
from navigation.records import RunError
from navigation.running import RunTask, run


def run_all(tasks: Sequence[RunTask], out: Path, jobs: int) -> int:
    """Make the runs that are not there; return how many were made.

    Ctrl-C ends it; the runs that were not over leave nothing with their names, and are made the
    next time, byte for byte as they would have been.

    Args:
        tasks: What to run, the first first.
        out: Where runs lie.
        jobs: Processes.

    Raises:
        RunError: One of the processes was ended from outside.
    """
    missing = [task for task in tasks if not task.key.folder(out).exists()]
    if len(missing) < len(tasks):
        _say(f"{len(tasks) - len(missing)} of {len(tasks)} runs are there already")
    began = time.monotonic()
    for done, (task, seconds) in enumerate(_made(missing, out, jobs), start=1):
        left_s = (time.monotonic() - began) / done * (len(missing) - done)
        _say(f"{done}/{len(missing)} {task.key.building} {task.setup} {task.series}-{task.seed}: "
             f"{seconds:.1f} s; about {left_s / 60:.0f} min left")  # fmt: skip
    return len(missing)


def _made(tasks: Sequence[RunTask], out: Path, jobs: int) -> Iterator[tuple[RunTask, float]]:
    """Yield each run that is over, and how long it took."""
    if jobs == 1:
        yield from map(_make, ((task, out) for task in tasks))
        return
    context = multiprocessing.get_context("spawn")
    # Ctrl-C reaches this process, which ends the others.
    pool = ProcessPoolExecutor(jobs, context, signal.signal, (signal.SIGINT, signal.SIG_IGN))
    try:
        running = [pool.submit(_make, (task, out)) for task in tasks]
        for future in as_completed(running):
            yield future.result()
    except BrokenProcessPool as error:
        raise RunError(
            "a process of the experiment was ended from outside, perhaps for want of memory; "
            "the same command goes on where it was"
        ) from error
    except BaseException:
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        for task in tasks:
            shutil.rmtree(task.key.making(out), ignore_errors=True)


def _make(what: tuple[RunTask, Path]) -> tuple[RunTask, float]:
    task, out = what
    began = time.monotonic()
    run(task, _floor(task.building, task.level), out)
    return task, time.monotonic() - began


@lru_cache(4)
def _floor(building: Path, level: int) -> Floor:
    return Floor.read(building, level)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
