"""The product's threads, locks and calls of the system, given into a scheduler's hands."""

from __future__ import annotations

import os
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial, wraps
from typing import Any

from fault_injection.interleaving import primitives
from fault_injection.interleaving.scheduler import Scheduler

CALLS = (
    "write", "pwrite", "writev", "fsync", "fdatasync", "replace", "rename", "link", "unlink",
    "open", "ftruncate",
)  # fmt: skip
_LOCKS = (type(threading.Lock()), type(threading.RLock()))
LINES_OF = (
    "store/writing/",
    "store/segment.py",
    "store/compaction/background",
    "log/door_log/appender.py",
    "log/door_log/current_map.py",
)
"""Where threads share what is not theirs alone."""


@contextmanager
def controlled(
    scheduler: Scheduler, *, by_line: bool, synced: Callable[[int], None]
) -> Iterator[primitives.Trace | None]:
    """Let what is made and called within wait under a scheduler.

    For a process of its own: it is not taken back. Hands out what the main task must give to
    `sys.settrace`, as the threads that are made do themselves.

    Args:
        scheduler: Draws who runs.
        by_line: Whether threads can be switched before each line, too.
        synced: Told each descriptor that was synced, right behind the call.
    """
    trace = primitives.line_by_line(scheduler, LINES_OF) if by_line else None
    stand_in = primitives.controlled_threading(scheduler, trace)
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] == "semmap_log":
            _exchange(vars(module), scheduler, stand_in)
    _wrap_calls(scheduler, synced)
    yield trace


def _exchange(names: dict[str, Any], scheduler: Scheduler, stand_in: Any) -> None:
    for name, value in list(names.items()):
        if value is threading:
            names[name] = stand_in
        elif value is queue.SimpleQueue:
            names[name] = partial(primitives.SimpleQueue, scheduler)
        elif isinstance(value, _LOCKS[:1]):
            names[name] = primitives.Lock(scheduler)
        elif isinstance(value, _LOCKS[1:]):
            names[name] = primitives.RLock(scheduler)
        elif any(value is getattr(threading, n) for n in ("Lock", "RLock", "Event", "Thread")):
            names[name] = getattr(stand_in, value.__name__)


def _wrap_calls(scheduler: Scheduler, synced: Callable[[int], None]) -> None:
    def wrapped(call: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(call)
        def switching(*args: Any, **kwargs: Any) -> Any:
            scheduler.switch(call.__name__)
            result = call(*args, **kwargs)
            if call.__name__ in {"fsync", "fdatasync"}:
                synced(args[0])
            scheduler.switch(f"{call.__name__} done")
            return result

        return switching

    for name in CALLS:
        setattr(os, name, wrapped(getattr(os, name)))

    def sleep(seconds: float) -> None:
        if scheduler.me() is None:
            real_sleep(seconds)
        else:
            scheduler.wait(lambda: False, "sleep", timed=True)

    real_sleep, time.sleep = time.sleep, sleep
