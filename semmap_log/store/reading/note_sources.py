"""Who did it and why: the commits of many events, with their notes, as columns.

Nothing is looked up before somebody asks: most folds never do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.distinct import distinct
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.lazy.lazily import computed_once
from semmap_log.core.messages import CDR_HEADER, read_message, type_name
from semmap_log.core.model.commits import NO_TEXTS, Commit, NoteTexts
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.form import NOTE_CHANNEL
from semmap_log.store.pages import Page
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.record_scan import gather

_SAID = len(CDR_HEADER) + 16
"""Where in a note's message the texts begin: before them is its salt, which differs in each."""


class SaidFinder:
    """Finds the commits of one batch's events after another's, looking first where these lie."""

    def __init__(
        self, find_commit: Callable[[int], Commit | None], *, with_notes: bool = True
    ) -> None:
        """Begin.

        Args:
            find_commit: Returns the commit that holds an event; asked for those whose Commit is not
                on the page that was looked at.
            with_notes: False: the notes are not read, and say nothing.
        """
        self._find_commit = find_commit
        self._with_notes = with_notes
        self._at_hand: CommitColumns | None = None
        self._last: Commit | None = None
        """The last that was found elsewhere; an import's may go on over many pages."""

    def look_at(self, _: Segment, page: Page) -> None:
        """Take the commits of a page, in which the events lie that are asked about next.

        Raises:
            CorruptLogError: A note is not what its channel carries.
        """
        self._at_hand = commits_on(page, with_notes=self._with_notes)

    def take(self, commits: CommitColumns) -> None:
        """Take these commits instead."""
        self._at_hand = commits

    def said_of(self, numbers: NDArray[np.int64]) -> Iterator[tuple[NoteTexts, bytes]]:
        """Yield who and why of each of these events, numbers ascending, and its command's id."""
        commits = self.commits_of(numbers)
        places = commits.places_of(numbers)
        ids = commits.command_id[places].tobytes()
        for at, note in enumerate(commits.notes[places].tolist()):
            yield commits.texts[note], ids[16 * at : 16 * at + 16]

    def commits_of(self, numbers: NDArray[np.int64]) -> CommitColumns:
        """Return commits of which each of these events, numbers ascending, has its own."""
        commits = self._at_hand
        assert commits is not None, "somebody told where the events lie"
        lacking = numbers[commits.places_of(numbers) < 0]
        while len(lacking):
            first = int(lacking[0])
            if self._last is None or not self._last.first_event <= first <= self._last.last_event:
                self._last = self._find_commit(first)
            assert self._last is not None, "every event belongs to a commit"
            commits = commits.with_commit(self._last)
            lacking = lacking[lacking > self._last.last_event]
        return commits


class NoteSources:
    """Answers for the events of one page; see `EventBatch.sources_of`."""

    def __init__(self, page: Page, find_commit: Callable[[int], Commit | None]) -> None:
        """Take a page, and what `SaidFinder` takes."""
        self._page = page
        self._find_commit = find_commit

    def __call__(self, numbers: NDArray[np.int64]) -> tuple[NDArray[np.intp], Sequence[str]]:
        """Return for each of these events of the page the place of its source among some names.

        Raises:
            CorruptLogError: A note is not what its channel carries.
        """
        commits = self._finder.commits_of(numbers)
        names: dict[str, int] = {}
        of_texts = [names.setdefault(source, len(names)) for _, source, _, _ in commits.texts]
        return np.array(of_texts, np.intp)[commits.notes_of(numbers)], list(names)

    @computed_once
    def _finder(self) -> SaidFinder:
        finder = SaidFinder(self._find_commit)
        finder.take(commits_on(self._page))
        return finder


class SaidByCommits:
    """Who and why of all the commits of some pages that follow each other, as columns."""

    def __init__(self) -> None:
        self._parts: list[CommitColumns] = []
        self._places: dict[NoteTexts, int] = {NO_TEXTS: 0}

    def take(self, page: Page) -> None:
        """Take in the commits whose Commit is on a page.

        Raises:
            CorruptLogError: A note is not what its channel carries.
        """
        part = commits_on(page)
        known = [self._places.setdefault(text, len(self._places)) for text in part.texts]
        self._parts.append(replace(part, notes=np.array(known, np.intp)[part.notes]))

    def commits(self) -> CommitColumns:
        """Return what was taken in."""
        parts = self._parts
        return CommitColumns(
            np.concatenate([part.first_event for part in parts]),
            np.concatenate([part.count for part in parts]),
            np.concatenate([part.command_id for part in parts]),
            np.concatenate([part.notes for part in parts]),
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

    def places_of(self, numbers: NDArray[np.int64]) -> NDArray[np.intp]:
        """Return of each event, numbers ascending, the place of its commit; -1: it is not here."""
        begins = np.searchsorted(numbers, self.first_event)
        ends = np.searchsorted(numbers, self.first_event + self.count)
        places = np.full(len(numbers), -1, np.intp)
        if (begins[1:] == ends[:-1]).all() and len(begins):  # as on every page
            counts = ends - begins
            places[begins[0] : ends[-1]] = np.repeat(np.arange(len(counts)), counts)
            return places
        for place, (begin, end) in enumerate(zip(begins.tolist(), ends.tolist(), strict=True)):
            places[begin:end] = place
        return places

    def notes_of(self, numbers: NDArray[np.int64]) -> NDArray[np.intp]:
        """Return of each event, all of these commits, the place of its note among the texts."""
        return self.notes[self.places_of(numbers)]

    def with_commit(self, commit: Commit) -> CommitColumns:
        """Return these commits and another."""
        at = int(np.searchsorted(self.first_event, commit.first_event))
        note = commit.note
        command_id = np.frombuffer(commit.command_id, np.uint8)
        return CommitColumns(
            np.insert(self.first_event, at, commit.first_event),
            np.insert(self.count, at, commit.count),
            np.insert(self.command_id, at, command_id, axis=0),
            np.insert(self.notes, at, len(self.texts)),
            [*self.texts, (note.actor, note.source, note.reason, note.correlation)],
        )


def commits_on(page: Page, *, with_notes: bool = True) -> CommitColumns:
    """Return the commits whose Commit is on a page.

    Args:
        page: The page.
        with_notes: False: the notes are not read, and say nothing.

    Raises:
        CorruptLogError: A note is not what its channel carries.
    """
    places = page.commit_places()
    rows = page.commit_rows(places)
    notes, texts = (
        _notes_of(page, places) if with_notes else (np.zeros(len(rows), np.intp), [NO_TEXTS])
    )
    return CommitColumns(
        rows["first_event"].astype(np.int64),
        rows["count"].astype(np.int64),
        np.ascontiguousarray(rows["command_id"]),
        notes,
        texts,
    )


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
    for length in distinct(lengths).tolist():
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
