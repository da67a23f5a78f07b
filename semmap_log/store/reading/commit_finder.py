"""Who did it and why: the commits of events, found where the events were read."""

from __future__ import annotations

from semmap_log.core.model.commits import Commit
from semmap_log.store.pages import Page
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_scan import Segment


class CommitFinder:
    """Finds the commit of one event after another; quick where they come in order."""

    def __init__(self, reader: LogReader) -> None:
        self._reader = reader
        self._page: Page | None = None
        self._last: Commit | None = None

    def look_at(self, _: Segment, page: Page) -> None:
        """Take note of the records in which the next events lie: their commits often do, too."""
        self._page = page

    def commit_at(self, number: int) -> Commit:
        """Return the commit that holds an event.

        Raises:
            LogError: There is no such event.
        """
        if self._last is None or not _holds(self._last, number):
            found = None if self._page is None else self._page.commit_holding(number)
            is_it = found is not None and _holds(found, number)
            self._last = found if is_it else self._reader.commit_at(number)
        assert self._last is not None
        return self._last


def _holds(commit: Commit, number: int) -> bool:
    return commit.first_event <= number <= commit.last_event
