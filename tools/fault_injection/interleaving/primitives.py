"""Locks, queues, threads and calls of the system that wait under a scheduler."""

from __future__ import annotations

import os
import queue
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial, wraps
from types import FrameType, ModuleType
from typing import Any

from fault_injection.interleaving.scheduler import LINE, Scheduler

Trace = Callable[[FrameType, str, Any], Any]


class Lock:
    """As `threading.Lock`; one thread may take it again if it is `reentrant`."""

    reentrant = False

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._owner: int | None = None
        self._count = 0

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:  # noqa: FBT001, FBT002
        """Take it."""
        me = threading.get_ident()
        self._scheduler.switch("acquire")
        if self.reentrant and self._owner == me:
            self._count += 1
            return True
        while self._count:
            timed = timeout >= 0
            if not blocking:
                return False
            is_free = self._scheduler.wait(lambda: not self._count, "acquire", timed=timed)
            if not is_free and timed:
                return False
        self._owner, self._count = me, 1
        return True

    def release(self) -> None:
        """Let it go."""
        if not self._count:
            raise RuntimeError("release unlocked lock")
        self._count -= 1
        if not self._count:
            self._owner = None
        self._scheduler.switch("release")

    def let_go(self) -> int:
        """Let it go, however often it was taken; return how often."""
        count, self._count, self._owner = self._count, 0, None
        return count

    def take_again(self, count: int) -> None:
        """Take it so many times."""
        self.acquire()
        self._count = count

    def locked(self) -> bool:
        """Tell whether somebody has it."""
        return bool(self._count)

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()


class RLock(Lock):
    """As `threading.RLock`."""

    reentrant = True


class Event:
    """As `threading.Event`."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._is_set = False

    def is_set(self) -> bool:
        """Tell whether it is set."""
        self._scheduler.switch("is_set")
        return self._is_set

    def set(self) -> None:
        """Set it."""
        self._is_set = True
        self._scheduler.switch("set")

    def clear(self) -> None:
        """Take it back."""
        self._scheduler.switch("clear")
        self._is_set = False

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is set."""
        timed = timeout is not None
        return self._scheduler.wait(lambda: self._is_set, "wait", timed=timed)


class Condition:
    """As `threading.Condition`."""

    def __init__(self, scheduler: Scheduler, lock: Lock | None = None) -> None:
        self._scheduler = scheduler
        self._lock = lock or RLock(scheduler)
        self._waiting: list[list[bool]] = []
        self.acquire, self.release = self._lock.acquire, self._lock.release

    def __enter__(self) -> bool:
        return self._lock.acquire()

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def wait(self, timeout: float | None = None) -> bool:
        """Let the lock go, wait to be told, and take it again."""
        told = [False]
        self._waiting.append(told)
        count = self._lock.let_go()
        timed = timeout is not None
        is_told = self._scheduler.wait(lambda: told[0], "condition", timed=timed)
        if told in self._waiting:
            self._waiting.remove(told)
        self._lock.take_again(count)
        return is_told

    def wait_for(self, predicate: Callable[[], bool], timeout: float | None = None) -> bool:
        """Wait until it is so."""
        while not predicate():
            if not self.wait(timeout):
                return predicate()
        return True

    def notify(self, n: int = 1) -> None:
        """Tell some of those that wait."""
        for told in self._waiting[:n]:
            told[0] = True
        del self._waiting[:n]

    def notify_all(self) -> None:
        """Tell all that wait."""
        self.notify(len(self._waiting))


class SimpleQueue:
    """As `queue.SimpleQueue`."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._waiting: deque[Any] = deque()

    def put(self, item: Any) -> None:
        """Add one."""
        self._waiting.append(item)
        self._scheduler.switch("put")

    def get(self) -> Any:
        """Take one, once there is one."""
        while not self._waiting:
            self._scheduler.wait(lambda: bool(self._waiting), "get")
        return self._waiting.popleft()

    def empty(self) -> bool:
        """Tell whether there is none."""
        return not self._waiting


class Thread(threading.Thread):
    """As `threading.Thread`; runs when the scheduler says so."""

    def __init__(
        self,
        scheduler: Scheduler,
        target: Callable[..., Any] | None = None,
        name: str | None = None,
        args: Sequence[Any] = (),
        kwargs: Mapping[str, Any] | None = None,
        *,
        daemon: bool | None = None,
        trace: Trace | None = None,
    ) -> None:
        super().__init__(None, target, name, args, kwargs, daemon=True)
        del daemon  # none must outlive the run
        self._scheduler = scheduler
        self._trace = trace
        self._task = scheduler.begin(name or getattr(target, "__name__", "thread"))
        self._task.is_over = True  # until it is started

    def start(self) -> None:
        """Make it one of those that can go on."""
        self._scheduler.attach(self._task, self)
        self._task.is_over = False
        super().start()
        self._scheduler.switch("start")

    def run(self) -> None:
        """Do what it is for, in its turns."""
        self._scheduler.enter(self._task)
        try:
            if self._trace is not None:
                sys.settrace(self._trace)
            self.work()
        finally:
            sys.settrace(None)
            self._scheduler.leave(self._task)

    def work(self) -> None:
        """Do what it is for."""
        super().run()

    def join(self, timeout: float | None = None) -> None:
        """Wait for its end."""
        timed = timeout is not None
        self._scheduler.wait(lambda: self._task.is_over, "join", timed=timed)

    def is_alive(self) -> bool:
        """Tell whether it is under way."""
        return not self._task.is_over


class Timer(Thread):
    """As `threading.Timer`."""

    def __init__(
        self,
        scheduler: Scheduler,
        interval: float,
        function: Callable[..., Any],
        args: Sequence[Any] = (),
        kwargs: Mapping[str, Any] | None = None,
        *,
        trace: Trace | None = None,
    ) -> None:
        super().__init__(scheduler, function, "timer", args, kwargs, trace=trace)
        self.interval = interval
        self.finished = Event(scheduler)

    def cancel(self) -> None:
        """Keep it from beginning, if it has not begun."""
        self.finished.set()

    def work(self) -> None:
        """Wait, then do what it is for."""
        if not self.finished.wait(self.interval):
            super().work()
        self.finished.set()


def controlled_threading(scheduler: Scheduler, trace: Trace | None) -> ModuleType:
    """Return what stands in for the module `threading`."""
    module = ModuleType("threading")
    vars(module).update({k: v for k, v in vars(threading).items() if not k.startswith("_")})
    made: dict[str, Any] = {
        "Lock": lambda: Lock(scheduler),
        "RLock": lambda: RLock(scheduler),
        "Event": lambda: Event(scheduler),
        "Condition": lambda lock=None: Condition(scheduler, lock),
        "Thread": lambda *a, **k: Thread(scheduler, *_without_group(a), trace=trace, **k),
        "Timer": lambda *a, **k: Timer(scheduler, *a, trace=trace, **k),
    }
    vars(module).update(made)
    return module


def _without_group(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    return arguments[1:]


def line_by_line(scheduler: Scheduler, parts: Sequence[str]) -> Trace:
    """Return a trace function by which threads can be switched before each line of some files.

    Args:
        scheduler: Draws.
        parts: A file whose name holds one of these is traced.
    """

    def trace(frame: FrameType, event: str, argument: Any) -> Trace | None:
        del argument
        if event == "call":
            name = frame.f_code.co_filename
            return trace if any(part in name for part in parts) else None
        if event == "line":
            scheduler.switch(LINE)
        return trace

    return trace


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
) -> Iterator[Trace | None]:
    """Let what is made and called within wait under a scheduler.

    For a process of its own: it is not taken back. Hands out what the main task must give to
    `sys.settrace`, as the threads that are made do themselves.

    Args:
        scheduler: Draws who runs.
        by_line: Whether threads can be switched before each line, too.
        synced: Told each descriptor that was synced, right behind the call.
    """
    trace = line_by_line(scheduler, LINES_OF) if by_line else None
    stand_in = controlled_threading(scheduler, trace)
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
            names[name] = partial(SimpleQueue, scheduler)
        elif isinstance(value, _LOCKS[:1]):
            names[name] = Lock(scheduler)
        elif isinstance(value, _LOCKS[1:]):
            names[name] = RLock(scheduler)
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
