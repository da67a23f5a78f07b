"""Work that other threads do ahead, while its results are used in order.

Decompression, CRCs and numpy's loops release the interpreter's lock, so a second core helps.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

T = TypeVar("T")

MOST_THREADS = 4


def ahead(tasks: Iterable[Callable[[], T]]) -> Iterator[T]:
    """Yield what the tasks return, in their order; a few run while one result is used.

    A thread that would wait for the next result runs a task that has not begun instead: so each
    core has one thread, and what a thread has in its core's cache stays there.

    With only one core, each task runs when its result is wanted.

    Args:
        tasks: Called from other threads, too; what one raises is raised here, in its place.
    """
    threads = min(_cores(), MOST_THREADS)
    if threads < 2:
        for task in tasks:
            yield task()
        return
    coming = iter(tasks)
    running = deque(_Begun(task, threads - 1) for task in islice(coming, threads + 1))
    try:
        while running:
            while not running[0].is_done and any(begun.take() for begun in running):
                pass
            result = running.popleft().result()
            running.extend(_Begun(task, threads - 1) for task in islice(coming, 1))
            yield result
    finally:
        for begun in running:
            begun.cancel()


def _cores() -> int:
    """Return how many cores this process may use, as far as the system shows."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1  # macOS, Windows


class _Begun(Generic[T]):
    """A task that was given to another thread, if there can be one."""

    def __init__(self, task: Callable[[], T], threads: int) -> None:
        self._task = task
        self._pid = os.getpid()
        self._future: Future[T] | None = None
        # Where the interpreter is ending, or the machine has no more threads: done when wanted.
        with suppress(RuntimeError):
            self._future = _pool(self._pid, threads).submit(task)

    @property
    def is_done(self) -> bool:
        """Whether its result is there."""
        future = self._own_future()
        return future is not None and future.done()

    def take(self) -> bool:
        """Run the task here if it has not begun; return whether that was so."""
        from concurrent.futures import Future

        future = self._own_future()
        if future is None or not future.cancel():
            return False
        self._future = Future()
        try:
            self._future.set_result(self._task())
        except Exception as error:  # noqa: BLE001 - raised in its place: `result`
            self._future.set_exception(error)
        return True

    def result(self) -> T:
        """Return what the task returns; runs it now if no thread of this process does."""
        future = self._own_future()
        return self._task() if future is None else future.result()

    def cancel(self) -> None:
        """Spare the work if it was not begun."""
        future = self._own_future()
        if future is not None:
            future.cancel()

    def _own_future(self) -> Future[T] | None:
        """Return the future; None in a forked child, where no thread would ever complete it."""
        return self._future if os.getpid() == self._pid else None


@lru_cache(maxsize=1)
def _pool(_: int, threads: int) -> ThreadPoolExecutor:
    """Return the threads of a process; a forked child, which inherits none, gets its own."""
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(threads, thread_name_prefix="semmap-log-reading")
