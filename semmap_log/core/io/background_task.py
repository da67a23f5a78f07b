"""Background work of a writer: a thread that an append never waits for.

It looks for work again and again, and once more at the end. It shares no lock with the writer.
"""

from __future__ import annotations

import os
import threading
from typing import Protocol


class Look(Protocol):
    """Looks whether there is something to do, and does it."""

    def __call__(self, *, is_last: bool) -> None:
        """Do what must be done; `is_last`: there will be no further call."""
        ...


class AbandonedWork(Exception):  # noqa: N818  # no error: the way out of the work under way
    """Nobody waits any more."""


class BackgroundTask:
    """A thread that looks whether there is something to do, until it is closed."""

    def __init__(self, name: str, look: Look, *, pause_s: float, end_s: float) -> None:
        """Take what it does; no thread is started yet.

        Args:
            name: Of the thread.
            look: What it does again and again.
            pause_s: So long it waits between two looks.
            end_s: So long the end waits for what is being done.
        """
        self._name = name
        self._look = look
        self._pause_s = pause_s
        self._end_s = end_s
        self._ending = threading.Event()
        self._abandoned = threading.Event()
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self._pid = os.getpid()

    @property
    def is_ended(self) -> bool:
        """Whether it has looked for the last time."""
        return self._ended.is_set()

    def start(self) -> None:
        """Begin to look."""
        self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
        self._thread.start()

    def close(self, end_s: float | None = None) -> None:
        """Look for the last time, and end; in a child of the process that started it, do nothing.

        Args:
            end_s: Seconds to wait, instead of those given at first; then it gives up.
        """
        if self._thread is None or os.getpid() != self._pid:
            return
        try:
            self._ending.set()
            self._ended.wait(self._end_s if end_s is None else end_s)
        finally:
            self._abandoned.set()

    def proceed(self, wait_s: float = 0.0) -> None:
        """Let others go first for so long, from within the work.

        Raises:
            AbandonedWork: Nobody waits for it any more.
        """
        if self._abandoned.wait(wait_s):
            raise AbandonedWork

    def _run(self) -> None:
        try:
            while True:
                is_last = self._ending.is_set()  # first: what is closed by then is seen
                self._look(is_last=is_last)
                if is_last or self._abandoned.is_set():
                    return
                self._ending.wait(self._pause_s)
        finally:
            self._ended.set()
