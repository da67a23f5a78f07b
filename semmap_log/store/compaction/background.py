"""Compaction in the background: a thread that never delays an append and never stops the writer."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue

from semmap_log.errors import LogError
from semmap_log.store.bag_metadata import ClosedSegment
from semmap_log.store.compaction.compacting import compact_segment, install_over
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.segment import SegmentWriter

_log = logging.getLogger("semmap_log")

PAUSE_S = 0.0005
"""Waited between steps: an append that waits for the interpreter goes first."""


KeepUp = Callable[[Path, Callable[[], None]], None]
"""Updates what is kept next to a log: called with its folder, and with what to call between two
steps of the work, which may raise to end it."""


class _Abandoned(Exception):  # noqa: N818  # no error: the way out of the work under way
    """An immediate stop was requested."""


class BackgroundCompactor:
    """Compacts closed segments one after the other, in a thread that starts when it is needed.

    What goes wrong there (a full disk, damage) is logged as a warning of the logger `semmap_log`;
    the old segment stays and the next one is taken up. What was not done in the end is left to the
    next writer, or to `compact`.

    The thread is a daemon. A process that ends without `close` leaves at most a temporary file,
    which the next writer removes.
    """

    def __init__(
        self,
        folder: LogFolder,
        installed: Callable[[ClosedSegment], None],
        keep_up: KeepUp | None = None,
    ) -> None:
        """Prepare; no thread is started yet.

        Args:
            folder: The log's.
            installed: Called in the thread after a segment was replaced, with what metadata.yaml
                is to say of it. It must not wait for anybody who may be in `close`.
            keep_up: Called in the thread after each segment.
        """
        self._folder = folder
        self._installed = installed
        self._keep_up = keep_up
        self._waiting: SimpleQueue[str | None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self._closing = False
        self._abandoned = threading.Event()
        self.swapping = threading.Lock()
        """Held while a segment is replaced and reported: others wait until after that."""
        self._pid = os.getpid()

    def add(self, name: str) -> None:
        """Have a closed segment compacted some time; returns at once.

        Raises:
            LogError: In a forked child, or after `close`.
        """
        if os.getpid() != self._pid:
            raise LogError(
                f"{name}: compacted by process {self._pid}; a forked child cannot go on with that."
            )
        if self._closing:
            raise LogError(f"{name}: the compactor was closed; nothing can be added to it.")
        self._waiting.put(name)
        if self._thread is None:
            self._start()

    def close(self, *, wait: bool = True) -> None:
        """End: finish the segment under way, drop those that wait, and join the thread.

        Whatever interrupts it, no segment is replaced after it returns or raises.

        Args:
            wait: Finish the segment under way; if not, it is abandoned within about a chunk's
                time, its temporary file removed.
        """
        if os.getpid() != self._pid:
            return  # the thread, and the temporary file, are the parent's
        self._closing = True
        if not wait:
            self._abandoned.set()
        if self._thread is None:
            return
        self._waiting.put(None)
        try:
            self._ended.wait()  # not `join`: interrupted, it takes a thread that runs for ended
            self._thread.join()
        finally:
            if not self._ended.is_set():  # interrupted: stop at once, or after the swap
                self._abandoned.set()
                with self.swapping:
                    pass

    def _start(self) -> None:
        thread = threading.Thread(target=self._run, name="semmap_log compaction", daemon=True)
        try:
            thread.start()
        except RuntimeError as error:
            _log.warning("%s: segments stay as they are written.", error)
            return
        self._thread = thread

    def _run(self) -> None:
        try:
            self._work()
        finally:
            self._ended.set()

    def _work(self) -> None:
        while not self._closing:
            name = self._waiting.get()
            if name is None or self._closing:
                return
            try:
                compact_segment(self._folder, name, pause=self._pause, install=self._install)
            except _Abandoned:
                return
            except Exception as error:  # noqa: BLE001 - whatever it is, the writer goes on
                said = str(error) or type(error).__name__
                path = self._folder / name
                _log.warning("%s: not compacted, it stays as it is: %s", path, said)
            if self._keep_up is not None:
                try:
                    self._keep_up(self._folder.absolute, self._pause)
                except _Abandoned:
                    return
                except Exception as error:  # noqa: BLE001 - as above
                    _log.warning("%s: its index is not up to date: %s", self._folder.path, error)

    def _pause(self, done: int = 0) -> None:  # noqa: ARG002 - for progress bars
        if self._abandoned.wait(PAUSE_S):
            raise _Abandoned

    def _install(self, copy: SegmentWriter, replaced: Segment) -> None:
        with self.swapping:
            if self._abandoned.is_set():
                raise _Abandoned
            install_over(copy, replaced)
            try:
                self._installed(copy.closed_segment())
            except Exception as error:  # noqa: BLE001 - as above
                _log.warning("%s: compacted, but not listed: %s", copy.path, error)
