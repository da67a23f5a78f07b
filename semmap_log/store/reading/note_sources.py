"""Which source each event of a page is from, as the notes of the commits say.

Nothing is looked up before somebody asks: most folds never do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.common.lazily import computed_once
from semmap_log.domain.commits import Commit
from semmap_log.errors import CorruptLogError
from semmap_log.messages import CDR_HEADER, deserialize, type_name
from semmap_log.store import records as mcap
from semmap_log.store.form import NOTE_CHANNEL
from semmap_log.store.pages import Page
from semmap_log.store.record_scan import gather

NO_SOURCE = ""
_SAID = len(CDR_HEADER) + 16
"""Where in a note's message the texts begin: before them is its salt, which differs in each."""


class NoteSources:
    """Answers for the events of one page; see `EventBatch.sources_of`."""

    def __init__(self, page: Page, find_commit: Callable[[int], Commit | None]) -> None:
        """Take a page.

        Args:
            page: Where the events are.
            find_commit: Returns the commit that holds an event; asked for those whose Commit is not
                on the page.
        """
        self._page = page
        self._find_commit = find_commit

    def __call__(self, numbers: NDArray[np.int64]) -> tuple[NDArray[np.intp], Sequence[str]]:
        """Return for each of these events of the page the place of its source among some names.

        Raises:
            CorruptLogError: A note is not what its channel carries.
        """
        firsts, ends, sources, known = self._of_commits
        names = list(known)
        commits = np.searchsorted(ends, numbers, "right")
        is_here = np.append(firsts, np.iinfo(np.int64).max)[commits] <= numbers
        codes = np.append(sources, 0)[commits]
        while not is_here.all():
            commit = self._find_commit(int(numbers[np.argmin(is_here)]))
            assert commit is not None, "every event belongs to a commit"
            its = (numbers >= commit.first_event) & (numbers <= commit.last_event)
            codes[its], is_here[its] = len(names), True
            names.append(commit.note.source)
        return codes, names

    @computed_once
    def _of_commits(
        self,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.intp], Sequence[str]]:
        """Return of each commit its first event, the number behind its last, and its source."""
        page, places = self._page, self._page.commit_places()
        rows = page.commit_rows(places)
        firsts = rows["first_event"].astype(np.int64)
        channels = page.heads["channel_id"]
        has_note = (places > 0) & (channels[places - 1] == NOTE_CHANNEL)
        codes, names = _told_by(page, places[has_note] - 1)
        all_codes = np.zeros(len(places), np.intp)
        all_codes[has_note] = codes
        return firsts, firsts + rows["count"], all_codes, names


def _told_by(page: Page, notes: NDArray[np.intp]) -> tuple[NDArray[np.intp], list[str]]:
    """Return the sources of notes by their places among the names; the first name is empty.

    Notes that say the same are read once.
    """
    codes = np.zeros(len(notes), np.intp)
    names = {NO_SOURCE: 0}
    lengths = page.heads["length"][notes]
    for length in np.unique(lengths).tolist():
        mine = np.flatnonzero(lengths == length)
        size = length - mcap.MESSAGE_BODY_HEAD
        bodies = page.offsets[notes[mine]] + mcap.MESSAGE.size
        data = gather(page.records, bodies, np.dtype([("note", f"V{size}")])).tobytes()
        known: dict[bytes, int] = {}
        for at, place in enumerate(mine.tolist()):
            note = data[at * size : (at + 1) * size]
            said = note[_SAID:]
            if said not in known:
                known[said] = names.setdefault(_source_of(page, note), len(names))
            codes[place] = known[said]
    return codes, list(names)


def _source_of(page: Page, note: bytes) -> str:
    try:
        return str(deserialize(type_name("CommitNote"), note).source)
    except ValueError as error:
        raise CorruptLogError(page.path, page.offset, str(error)) from None
