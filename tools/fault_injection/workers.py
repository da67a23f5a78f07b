"""Processes that try faults side by side, under the shim, and hand their outcomes back."""

from __future__ import annotations

import multiprocessing
import os
import queue
import traceback
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Any

from fault_injection import shim
from fault_injection.fault import Outcome, Plan

Work = Callable[[Plan, int, int], Iterator[Outcome]]
"""Given the plan, its own number, and how many share the work; a function of a module."""

_DONE, _FAILED = "done", "failed"


def shared(work: Work, plan: Plan) -> Generator[Outcome, None, None]:
    """Yield what so many processes as there are cores yield, each a share of the faults.

    Raises:
        CannotTryError: There is no C compiler.
        RuntimeError: The trying itself failed; says how.
    """
    library = shim.built(plan.folder)
    context = multiprocessing.get_context("spawn")
    outcomes: Queue[Any] = context.Queue(maxsize=1000)
    shares = len(os.sched_getaffinity(0))
    workers = [
        context.Process(target=_work, args=(work, plan, share, shares, outcomes), daemon=True)
        for share in range(shares)
    ]
    try:
        with _preloaded(library):
            for worker in workers:
                worker.start()
        working = shares
        while working:
            try:
                kind, outcome = outcomes.get(timeout=5)
            except queue.Empty:
                if not any(worker.is_alive() for worker in workers):
                    raise RuntimeError("a worker ended without a word") from None
                continue
            if kind == _FAILED:
                raise RuntimeError(outcome)
            if kind == _DONE:
                working -= 1
            else:
                yield outcome
    finally:
        for worker in workers:
            if worker.is_alive():
                worker.kill()
            if worker.pid:
                worker.join()


def _work(work: Work, plan: Plan, share: int, shares: int, outcomes: Queue[Any]) -> None:
    try:
        for outcome in work(plan, share, shares):
            outcomes.put(("outcome", outcome))
        outcomes.put((_DONE, None))
    except Exception:  # noqa: BLE001 - told to who waits for it
        outcomes.put((_FAILED, traceback.format_exc()))


@contextmanager
def _preloaded(library: Path) -> Iterator[None]:
    """Programs that are started within get the shim."""
    os.environ["LD_PRELOAD"] = str(library)
    try:
        yield
    finally:
        del os.environ["LD_PRELOAD"]
