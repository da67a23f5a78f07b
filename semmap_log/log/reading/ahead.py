"""Work that other threads do ahead, while its results are used in order.

Decompression, CRCs and numpy's loops let go of the interpreter, so that a second core is of use.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache
from itertools import islice
from typing import TypeVar

T = TypeVar("T")

MOST_THREADS = 4


def ahead(tasks: Iterable[Callable[[], T]]) -> Iterator[T]:
    """Yield what the tasks return, in their order; a few are worked at while one is used.

    On a machine with one core, or on one core of it, each is done when its result is wanted.

    Args:
        tasks: Called from other threads; what one raises is raised here, in its place.
    """
    threads = min(len(os.sched_getaffinity(0)), MOST_THREADS)
    if threads < 2:
        for task in tasks:
            yield task()
        return
    submit = _pool(os.getpid(), threads).submit
    coming = iter(tasks)
    running: deque[Future[T]] = deque(submit(task) for task in islice(coming, threads))
    try:
        while running:
            result = running.popleft().result()
            running.extend(submit(task) for task in islice(coming, 1))
            yield result
    finally:
        for future in running:
            future.cancel()


@lru_cache(maxsize=1)
def _pool(_: int, threads: int) -> ThreadPoolExecutor:
    """Return the threads of a process; a forked child, which inherits none, gets its own."""
    return ThreadPoolExecutor(threads, thread_name_prefix="semmap-log-reading")
