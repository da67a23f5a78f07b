"""When what was appended is on the disk: syncs that threads share, and the timer of `batch`."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from semmap_log.core.model.commits import Durability
from semmap_log.errors import InvalidEventError, LogPoisonedError

MOST_BATCH_S = 3600
"""Longer is `flush`."""


@dataclass(frozen=True)
class DurabilityPolicy:
    """What a writer promises of each append."""

    level: Durability = Durability.EVENT
    batch_events: int = 64
    """`batch`: so many events at most are not yet synced when `append` returns."""
    batch_s: float = 0.05
    """`batch`: after so many seconds at most they are."""

    @classmethod
    def of(cls, level: Durability | str, batch_events: int, batch_s: float) -> DurabilityPolicy:
        """Return the promise of that name.

        Raises:
            InvalidEventError: There is no such promise, or a batch is negative.
        """
        if batch_events < 1:
            raise InvalidEventError("batch_events", "1 or more", batch_events)
        if not 0 <= batch_s <= MOST_BATCH_S:
            raise InvalidEventError("batch_s", f"seconds, 0..{MOST_BATCH_S}", batch_s)
        return cls(Durability.parse(level), batch_events, batch_s)


SYNC_FAILED = (
    "a sync failed or was interrupted; whether the events before it are stored is unknown. "
    "Open the log again: it keeps every commit that is whole."
)


class SharedSync:
    """Syncs for several threads at once.

    Whoever comes first syncs, and with it all that was written until then; who comes meanwhile
    waits, and then finds its commit synced, or syncs for all who wait with it.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        """Held while a sync is under way; take it to close the file that is synced."""
        self.durable_before = 0
        """Events below this number survive a power cut."""
        self.is_broken = False
        """A sync failed, or was interrupted and may have: none is tried again."""

    def make_durable(self, before: int, sync: Callable[[], int]) -> None:
        """Return once events below that number survive a power cut.

        Args:
            before: An event number.
            sync: Syncs, and returns the number below which events were written before it began.

        Raises:
            LogPoisonedError: `sync` failed, now or earlier; it is never tried again.
        """
        if self.durable_before >= before:
            return
        with self.lock:
            if self.durable_before >= before:
                return
            if self.is_broken:
                raise LogPoisonedError(SYNC_FAILED)
            try:
                self.durable_before = max(self.durable_before, sync())
            except BaseException:
                self.is_broken = True
                raise


class BatchTimer:
    """Makes sure that appended events are synced soon, even if no thread waits for it."""

    def __init__(self, sync: Callable[[], None], seconds: float) -> None:
        self._sync = sync
        self._seconds = seconds
        self._appended = threading.Event()
        self._closed = threading.Event()
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()

    def start(self) -> None:
        """Count from now, unless it is counting already."""
        if self._appended.is_set():
            return
        self._appended.set()
        with self._starting:
            if self._thread is None:
                name = "semmap-log sync"
                self._thread = threading.Thread(target=self._run, name=name, daemon=True)
                self._thread.start()

    def close(self) -> None:
        """Stop counting; what was appended is not synced by this."""
        self._closed.set()
        self._appended.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        while True:
            self._appended.wait()
            if self._closed.wait(self._seconds):
                return
            self._appended.clear()  # before the sync: what comes now wants one of its own
            if self._closed.is_set():  # since the wait; nothing would wake this thread again
                return
            try:
                self._sync()
            except LogPoisonedError:
                return  # the next append or wait raises
