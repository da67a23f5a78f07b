"""What holds between the records of a log: numbers without gaps, rising times, the hash chain."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semmap_log.errors import CorruptLogError
from semmap_log.log import records as mcap
from semmap_log.log.chunks import gather
from semmap_log.log.form import COMMIT_CHANNEL, FLOOR_MAP_CHANNEL, LAST_EVENT_CHANNEL
from semmap_log.messages import layout

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semmap_log.log.header import SegmentHeader
    from semmap_log.log.pages import Page


class SequenceCheck:
    """Checks pages that follow each other, a few numpy steps each, in no memory of its own."""

    def __init__(self) -> None:
        self._header: SegmentHeader | None = None
        self._next_event = 0
        self._last_hash: NDArray[np.uint8]
        self._last_ns = -1

    def add(self, header: SegmentHeader, page: Page) -> None:
        """Check the next page, of the segment with that header.

        Raises:
            CorruptLogError: It does not follow the pages before.
        """
        if header is not self._header:
            self._begin(header, page)
        self._check_times(page)
        self._check_events(page)

    def _begin(self, header: SegmentHeader, page: Page) -> None:
        if self._header is None:
            self._next_event = header.first_event
            self._last_hash = np.frombuffer(header.hash_so_far, np.uint8)
        elif header.first_event != self._next_event:
            raise _corrupt(page, f"expected event {self._next_event}, got {header.first_event}")
        elif header.hash_so_far != self._last_hash.tobytes():
            raise _corrupt(page, "it does not follow the segment before: another hash so far")
        self._header = header

    def _check_times(self, page: Page) -> None:
        times = page.heads["log_time"]
        if times[0] <= self._last_ns or (np.diff(times) <= 0).any():
            raise _corrupt(page, "its log times do not rise")
        self._last_ns = int(times[-1])

    def _check_events(self, page: Page) -> None:
        channels = page.heads["channel_id"]
        is_event = (channels <= LAST_EVENT_CHANNEL) | (channels >= FLOOR_MAP_CHANNEL)
        numbers = self._next_event + np.cumsum(is_event)  # of the event that comes next
        found = page.heads["sequence"][is_event]
        if not np.array_equal(found, ((numbers - 1) & 0xFFFF_FFFF)[is_event]):
            raise _corrupt(page, f"its events do not count on from {self._next_event}")
        at = np.flatnonzero(channels == COMMIT_CHANNEL)
        if len(at):
            self._check_commits(page, at, numbers[at])
        self._next_event = int(numbers[-1])

    def _check_commits(
        self, page: Page, at: NDArray[np.intp], next_events: NDArray[np.int64]
    ) -> None:
        commit = layout("Commit")
        dtype = commit.behind(mcap.MESSAGE_DTYPE)
        if (page.heads["length"][at] != dtype.itemsize - mcap.FRAME.size).any():
            raise _corrupt(page, "a Commit of another size")
        commits = gather(page.records, page.offsets[at], dtype)
        if (commits["first_event"].astype(np.int64) + commits["count"] != next_events).any():
            raise _corrupt(page, "a Commit that does not end where its events do")
        before = np.vstack((self._last_hash[None], commits["hash"][:-1]))
        if not np.array_equal(commits["previous_hash"], before):
            raise _corrupt(page, "a commit does not follow the one before: another hash")
        self._last_hash = commits["hash"][-1]


def _corrupt(page: Page, problem: str) -> CorruptLogError:
    return CorruptLogError(page.path, page.offset, problem)
