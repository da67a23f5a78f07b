"""Requests to a store whose answers may be hostile: they end, and they do not fill the memory.

obstore reads a listing, and the text of an error, whole before it returns: a server that sends
without end would fill the memory. So a request runs in a loop of its own, and the caller watches
the clock and the process's peak memory; past a limit the request is dropped, with all that it has
read. The bodies of objects are not read here: they are streamed, and counted, by who asks.
"""

from __future__ import annotations

import asyncio
import os
import sys
import threading
import time
from collections.abc import Awaitable, Callable
from concurrent.futures import wait
from functools import lru_cache
from typing import TypeVar

from semmap_log.errors import LogAccessError
from semmap_log.io.url_path import UrlPath

T = TypeVar("T")

MOST_GROWTH_BYTES = 2**27
"""The process may grow by so much during a request: some 700,000 listed objects."""
_LOOK_S = 0.02
"""Between two looks at the memory: a gigabyte a second is noticed within 20 MB."""


def answer_of(
    request: Callable[[], Awaitable[T]], *, within_s: float, most_bytes: int = MOST_GROWTH_BYTES
) -> T:
    """Return a request's answer.

    Args:
        request: Begins it, in the loop.
        within_s: It has so long, with all that is tried again.
        most_bytes: The process may grow by so much meanwhile.

    Raises:
        OSError: The answer takes longer, or more memory.
    """
    most, end_s = _peak_bytes() + most_bytes, time.monotonic() + within_s
    future = asyncio.run_coroutine_threadsafe(_awaited(request), _loop())
    try:
        while not wait([future], _LOOK_S).done:
            if time.monotonic() > end_s:
                raise OSError(f"its answer has no end within {within_s:g} s")
            if _peak_bytes() > most:
                raise OSError(f"its answer fills {most_bytes:,} bytes of memory, and has no end")
        return future.result()
    finally:
        future.cancel()


async def _awaited(request: Callable[[], Awaitable[T]]) -> T:
    return await request()


@lru_cache(maxsize=1)
def _loop() -> asyncio.AbstractEventLoop:
    """Return the loop that requests run in, in a thread of its own."""
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, name="semmap-log requests", daemon=True).start()
    return loop


def _peak_bytes() -> int:
    """Return the most memory that this process has held so far; 0 where none is told."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


_asked_in: list[int] = []
"""The process that has asked a store first."""


def check_not_forked(url: UrlPath) -> None:
    """Check that this process may ask a store: threads that ask do not come along by a fork.

    Raises:
        LogAccessError: The process that it was forked from has asked one before.
    """
    if not _asked_in:
        _asked_in.append(os.getpid())
    elif _asked_in[0] != os.getpid():
        raise LogAccessError(
            f"{url}: this process was forked from one that had asked a store, and would wait for "
            "ever; begin it another way: multiprocessing.get_context('spawn') or 'forkserver'."
        )
