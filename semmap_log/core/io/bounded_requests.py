"""Requests to a store whose answers may be hostile: they end, and they do not fill the memory.

obstore reads a listing, and the text of an error, whole before it returns: a server that sends
without end would fill the memory. So a request runs in a loop of its own, and the caller watches
the clock and the process's peak memory; past a limit the request is dropped, with all that it has
read.
"""

from __future__ import annotations

import atexit
import os
import sys
import threading
import time
from collections.abc import Awaitable, Callable
from functools import lru_cache
from typing import TYPE_CHECKING, TypeVar

from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import LogAccessError

if TYPE_CHECKING:
    import asyncio

T = TypeVar("T")

MOST_GROWTH_BYTES = 2**27
"""The process may grow by so much during a request: some 700,000 listed objects."""
_DROP_S, _END_S = 0.2, 2.0
"""So long the process's end waits for a request that was dropped, and for others at most."""
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
    import asyncio
    from concurrent.futures import wait

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
        if future.cancel():
            _has_dropped.set()


async def _awaited(request: Callable[[], Awaitable[T]]) -> T:
    return await request()


_has_dropped = threading.Event()
"""Set once a request was dropped."""


@lru_cache(maxsize=1)
def _loop() -> asyncio.AbstractEventLoop:
    """Return the loop that requests run in, in a thread of its own."""
    import asyncio

    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, name="semmap-log requests", daemon=True).start()
    atexit.register(_let_requests_end)
    return loop


def _let_requests_end() -> None:
    """Wait until no thread of obstore's runs Python code.

    After it has handed an answer over, such a thread takes the interpreter's lock once more. If the
    interpreter ends before, Python up to 3.13 ends the thread, and with it, as it is not Python's
    own, the process: by SIGABRT, after all is done.
    """
    end_s = time.monotonic() + _END_S
    if _has_dropped.is_set():  # what is dropped is let go of a moment later
        time.sleep(_DROP_S)
    while time.monotonic() < end_s:
        ours = {thread.ident for thread in threading.enumerate()}
        if sys._current_frames().keys() <= ours:  # noqa: SLF001  nothing else lists them
            return
        time.sleep(0.001)


def _peak_bytes() -> int:
    """Return the peak memory of this process so far; 0 where the system does not report it."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


_queried_in: list[int] = []
"""The process that first queried a store."""


def check_not_forked(url: UrlPath) -> None:
    """Check that this process may query a store: the threads for it do not survive a fork.

    Raises:
        LogAccessError: The process that it was forked from has queried one before.
    """
    if not _queried_in:
        _queried_in.append(os.getpid())
    elif _queried_in[0] != os.getpid():
        raise LogAccessError(
            f"{url}: this process was forked from one that had used a store, and would hang; "
            "start it another way: multiprocessing.get_context('spawn') or 'forkserver'."
        )
