"""Which source each event of a page is from, as the notes of the commits say.

Nothing is looked up before somebody asks: most folds never do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.common.lazily import computed_once
from semmap_log.domain.commits import Commit
from semmap_log.errors import CorruptLogError
from semmap_log.messages import CDR_HEADER, read_message, type_name
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
        codes, texts = _notes_of(page, places)
        names = {NO_SOURCE: 0}
        of_texts = [names.setdefault(text[1], len(names)) for text in texts]
        all_codes = np.array(of_texts, np.intp)[codes]
        return firsts, firsts + rows["count"], all_codes, list(names)


NoteTexts = tuple[str, str, str, str]
"""Actor, source, reason, correlation; empty where nothing is said."""
NO_TEXTS: NoteTexts = ("", NO_SOURCE, "", "")


class SaidByCommits:
    """Who and why of all the commits of some pages that follow each other, as columns."""

    def __init__(self) -> None:
        self._parts: list[tuple[NDArray[Any], NDArray[np.intp]]] = []
        self._places: dict[NoteTexts, int] = {NO_TEXTS: 0}

    def take(self, page: Page) -> None:
        """Take in the commits whose Commit is on a page.

        Raises:
            CorruptLogError: A note is not what its channel carries.
        """
        places = page.commit_places()
        codes, texts = _notes_of(page, places)
        known = np.array([self._places.setdefault(t, len(self._places)) for t in texts], np.intp)
        rows = page.commit_rows(places)
        self._parts.append((rows[["first_event", "count", "command_id"]].copy(), known[codes]))

    def commits(self) -> CommitColumns:
        """Return what was taken in."""
        rows = np.concatenate([rows for rows, _ in self._parts])
        return CommitColumns(
            rows["first_event"].astype(np.int64),
            rows["count"].astype(np.int64),
            np.ascontiguousarray(rows["command_id"]),
            np.concatenate([notes for _, notes in self._parts]),
            list(self._places),
        )


@dataclass(frozen=True, slots=True)
class CommitColumns:
    """Commits as columns, in the order of their events."""

    first_event: NDArray[np.int64]
    count: NDArray[np.int64]
    command_id: NDArray[np.uint8]
    """(commits, 16)."""
    notes: NDArray[np.intp]
    """Of each the place of its note among the texts."""
    texts: Sequence[NoteTexts]

    def notes_of(self, numbers: NDArray[np.int64]) -> NDArray[np.intp]:
        """Return of each event, all of these commits, the place of its note among the texts."""
        return self.notes[np.searchsorted(self.first_event, numbers, "right") - 1]


def _notes_of(page: Page, places: NDArray[np.intp]) -> tuple[NDArray[np.intp], list[NoteTexts]]:
    """Return what is said of the commits whose Commits are at these places, each text once."""
    has_note = (places > 0) & (page.heads["channel_id"][places - 1] == NOTE_CHANNEL)
    codes = np.zeros(len(places), np.intp)
    codes[has_note], texts = _told_by(page, places[has_note] - 1)
    return codes, texts


def _told_by(page: Page, notes: NDArray[np.intp]) -> tuple[NDArray[np.intp], list[NoteTexts]]:
    """Return the texts of notes by their places among some; the first ones are empty.

    Notes that say the same are read once.
    """
    codes = np.zeros(len(notes), np.intp)
    texts = {NO_TEXTS: 0}
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
                known[said] = texts.setdefault(_texts_of(page, note), len(texts))
            codes[place] = known[said]
    return codes, list(texts)


def _texts_of(page: Page, note: bytes) -> NoteTexts:
    try:
        said = read_message(type_name("CommitNote"), note)
    except ValueError as error:
        raise CorruptLogError(page.path, page.offset, str(error)) from None
    return said["actor"], said["source"], said["reason"], said["correlation"]
