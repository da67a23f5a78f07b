"""Shipping in the background of a writer: a reader of the log's folder ships each closed segment.

It watches two files there. No error in it reaches the writer: it is reported once, and the shipment
is tried again.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from semmap_log.core.io.background_task import AbandonedWork, BackgroundTask
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import NotALogError
from semmap_log.fleet.shipping import Shipped, ship
from semmap_log.log.transport import LogFolder, Version, listed_marks

if TYPE_CHECKING:
    from typing_extensions import Self

END_S = 30.0
"""How long `close` waits for what is being sent."""


@dataclass(frozen=True, slots=True)
class ShippingIntervals:
    """How long the thread waits, in seconds."""

    look_s: float = 1.0
    """Between two looks at the folder."""
    settle_s: float = 10.0
    """After a segment was closed: it is compacted first, and then sent once, not twice."""
    first_retry_s: float = 5.0
    """After an error; each time twice as long, up to:"""
    longest_retry_s: float = 600.0


@dataclass(frozen=True, slots=True)
class ShippingStatus:
    """The state of shipping in the background."""

    shipped: Shipped | None = None
    """The result of the last successful shipment; None: there was none yet."""
    sent: int = 0
    """Segments sent in all."""
    problem: str = ""
    """What prevents shipping; empty: nothing."""
    is_all_sent: bool = False
    """Whether every closed segment is in the store."""


class BackgroundShipper:
    """Ships a log's closed segments while it is being written, and once more at the end.

    with BackgroundShipper("office", "s3://hospital/logs/office"), sl.append("office") as log:
        log.observe(door, "open")

    The order matters: the writer closes its last segment first, which is then sent.
    """

    def __init__(
        self,
        log: str | Path,
        place: str | UrlPath | ObjectStore,
        *,
        tell: Callable[[str], None] = lambda _: None,
        pauses: ShippingIntervals = ShippingIntervals(),
        end_s: float = END_S,
    ) -> None:
        """Take the log and the store, without a request or a thread yet.

        Args:
            log: The log's folder.
            place: Where it is to lie: `s3://bucket/logs/tug1`.
            tell: Called with a message once when shipping fails, and once when it works again.
            pauses: How long the thread waits.
            end_s: How long `close` waits for what is being sent.

        Raises:
            NotALogError: The place is no URL of a store.
            MissingExtraError: A package for stores is not installed.
        """
        self._folder = LogFolder(Path(log))
        self._store = place if isinstance(place, ObjectStore) else ObjectStore(_url(place))
        self._tell = tell
        self._pauses = pauses
        self._thread = BackgroundTask(
            "semmap_log shipping", self._look, pause_s=pauses.look_s, end_s=end_s
        )
        self._status = ShippingStatus()
        self._seen: _Closed = None
        """The closed segments at the last look at the folder."""
        self._has_looked = False
        """Whether there was a look before; segments of an earlier writer are sent at once."""
        self._done: _Closed = None
        """The closed segments when all of them were last shipped."""
        self._next_s = 0.0
        """When to ship next, on the monotonic clock, if there is anything."""
        self._retry_s = pauses.first_retry_s

    @property
    def url(self) -> UrlPath:
        """Where it ships to."""
        return self._store.url

    @property
    def status(self) -> ShippingStatus:
        """The present state."""
        return self._status

    def start(self) -> None:
        """Start watching the folder, in a thread of its own."""
        self._thread.start()

    def close(self, *, end_s: float | None = None) -> ShippingStatus:
        """Ship the segments closed last, and end; what is not sent by then waits for the next run.

        Args:
            end_s: How long to wait before giving up; default: as given at construction.

        Returns:
            The final state. Segments that were not sent are not lost: they are in the log.
        """
        self._thread.close(end_s)
        return self._status

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close(end_s=None if error is None else 0.0)

    def _look(self, *, is_last: bool) -> None:
        if self._is_due(is_last=is_last):
            self._try()

    def _is_due(self, *, is_last: bool) -> bool:
        """Look at the folder and return whether there is something to ship now."""
        closed, now_s = self._closed(), time.monotonic()
        if closed != self._seen:
            self._seen = closed
            if not self._status.problem:  # else it is tried again at its time
                self._next_s = now_s + (self._pauses.settle_s if self._has_looked else 0.0)
            self._status = _changed(self._status, is_all_sent=False)
        self._has_looked = True
        if closed is None or closed == self._done:
            return False
        return is_last or now_s >= self._next_s

    def _closed(self) -> _Closed:
        """Return a value that changes when a segment is closed or compacted; None: none is."""
        with suppress(OSError):
            marks = tuple(listed_marks(self._folder))
            if not marks:
                return None
            with suppress(OSError):
                return marks, self._folder.version(BAG_METADATA_NAME)
            return marks, None
        return None

    def _try(self) -> None:
        closed = self._seen
        try:
            done = ship(self._folder.absolute, self._store, lambda *_: self._thread.proceed())
        except AbandonedWork:
            return
        except Exception as error:  # noqa: BLE001 - whatever it is, the writer goes on
            self._failed(str(error) or type(error).__name__)
            return
        self._done, self._retry_s = closed, self._pauses.first_retry_s
        had_problem = bool(self._status.problem)
        self._status = ShippingStatus(done, self._status.sent + done.sent, "", is_all_sent=True)
        if had_problem:
            self._tell(
                f"{done.url}: shipping works again: {counted(done.sent, 'segment')} sent, up to "
                f"event {done.manifest.mark.next_event - 1}."
            )

    def _failed(self, problem: str) -> None:
        is_new = not self._status.problem
        self._status = _changed(self._status, problem=problem)
        self._next_s = time.monotonic() + self._retry_s
        self._retry_s = min(2 * self._retry_s, self._pauses.longest_retry_s)
        if is_new:
            line = command_line("ship", self._folder.path, self._store.url)
            self._tell(
                f"not shipped: {problem} Recording continues, and shipping is retried. The next "
                f"run sends the rest, or: {line}"
            )


_Closed = tuple[tuple[str, ...], Version | None] | None


def _changed(
    status: ShippingStatus, *, problem: str | None = None, is_all_sent: bool = False
) -> ShippingStatus:
    kept = status.problem if problem is None else problem
    return ShippingStatus(status.shipped, status.sent, kept, is_all_sent)


def _url(place: str | UrlPath) -> UrlPath:
    """Return the URL of a place.

    Raises:
        NotALogError: It is none.
    """
    found = place_of(place)
    if not isinstance(found, UrlPath):
        raise NotALogError(f"{place}: expected a URL of a store, such as s3://bucket/logs/office.")
    return found
