"""Processes that try faults side by side, each a share of them, and hand their outcomes back."""

from __future__ import annotations

import multiprocessing
import os
import queue
import tempfile
import traceback
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Any

from fault_injection import shim
from fault_injection.fault import CannotTryError, Outcome, Plan

Work = Callable[[Plan, int, int], Iterator[Outcome]]
"""Given the plan, its own number, and how many share the work; a function of a module."""

_DONE, _FAILED, _CANNOT = "done", "failed", "cannot"


def under_shim(work: Work, plan: Plan) -> Generator[Outcome, None, None]:
    """Yield what `side_by_side` does; the processes' system calls pass through the shim.

    Raises:
        CannotTryError: There is no C compiler.
        RuntimeError: The trying itself failed; says how.
    """
    yield from side_by_side(work, plan, preload=shim.built(plan.folder))


def side_by_side(
    work: Work, plan: Plan, *, shares: int = 0, preload: Path | None = None
) -> Generator[Outcome, None, None]:
    """Yield what so many processes as there are cores yield.

    Args:
        work: Given the plan, its own number, and how many share the work.
        plan: Says what is asked.
        shares: How many processes; 0: as many as there are cores.
        preload: A library that the processes load before all others.

    Raises:
        CannotTryError: As the work says.
        RuntimeError: The trying itself failed; says how.
    """
    context = multiprocessing.get_context("spawn")
    outcomes: Queue[Any] = context.Queue(maxsize=1000)
    shares = shares or len(os.sched_getaffinity(0))
    workers = [
        context.Process(target=_work, args=(work, plan, share, shares, outcomes), daemon=True)
        for share in range(shares)
    ]
    try:
        with _preloaded(preload):
            for worker in workers:
                worker.start()
        working = shares
        while working:
            try:
                word, said = outcomes.get(timeout=5)
            except queue.Empty:
                if not any(worker.is_alive() for worker in workers):
                    raise RuntimeError("a worker ended without a word") from None
                continue
            if word == _FAILED:
                raise RuntimeError(said)
            if word == _CANNOT:
                raise CannotTryError(said)
            if word == _DONE:
                working -= 1
            else:
                yield said
    finally:
        for worker in workers:
            if worker.is_alive():
                worker.kill()
            if worker.pid:
                worker.join()


def _work(work: Work, plan: Plan, share: int, shares: int, outcomes: Queue[Any]) -> None:
    _keep_apart(plan.folder / f"apart-{share}")
    try:
        for outcome in work(plan, share, shares):
            outcomes.put(("outcome", outcome))
        outcomes.put((_DONE, None))
    except CannotTryError as error:
        outcomes.put((_CANNOT, str(error)))
    except Exception:  # noqa: BLE001 - told to who waits for it
        outcomes.put((_FAILED, traceback.format_exc()))


def _keep_apart(folder: Path) -> None:
    """Have temporary files and caches of this process in a folder: it finds none of others."""
    folder.mkdir()
    os.environ["XDG_CACHE_HOME"] = str(folder)
    os.environ["TMPDIR"] = tempfile.tempdir = str(folder)


@contextmanager
def _preloaded(library: Path | None) -> Iterator[None]:
    """Programs that are started within load that library first."""
    if library is None:
        yield
        return
    os.environ["LD_PRELOAD"] = str(library)
    try:
        yield
    finally:
        del os.environ["LD_PRELOAD"]
