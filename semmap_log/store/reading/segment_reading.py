"""Finds things in one segment: pages, the chunk of an event, the commit of an event.

Also finds who made a change and why: the commits of many events, with their notes, as columns.
Nothing is looked up before it is requested: most folds never do.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, distinct
from semmap_log.core.io.prefetch import ahead
from semmap_log.core.lazily import computed_once
from semmap_log.core.loops import compiled
from semmap_log.core.messages import CDR_HEADER, read_message, type_name
from semmap_log.core.model.commits import NO_TEXTS, Commit, NoteTexts
from semmap_log.core.texts import counted
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import CHUNK_BYTES, NOTE_CHANNEL, count_events
from semmap_log.store.chunks import StoredChunk
from semmap_log.store.pages import COMMIT_BIT, UNKNOWN_BIT, Page
from semmap_log.store.reading.chunk_table import ChunkTable
from semmap_log.store.reading.page_reading import read_page
from semmap_log.store.reading.segment_head import last_commit_in
from semmap_log.store.reading.segment_scan import Segment, numbers_of
from semmap_log.store.record_scan import ChunkDamage, gather

if TYPE_CHECKING:
    from semmap_log.store.bag_metadata import ClosedSegment


def pages_of(segment: Segment, first_chunk: int = 0) -> Iterator[Page]:
    """Yield a segment's records from a chunk on, chunks joined to pages of a few MiB.

    Raises:
        CorruptLogError: A chunk is not what was written.
    """
    for group in _groups(segment, segment.chunks[first_chunk:]):
        yield read_page(group, segment.header.first_event)


def page_at(segment: Segment, chunk: int) -> Page:
    """Return the records of one chunk.

    Raises:
        CorruptLogError: They are not what was written.
    """
    alone = segment.chunks[chunk : chunk + 1]
    segment.source.will_need(*alone.span())
    return read_page(alone, segment.header.first_event)


def read_chunk(segment: Segment, chunk: StoredChunk) -> bytes | memoryview:
    """Return a chunk's records, CRC checked.

    Raises:
        CorruptLogError: They are not what was written.
    """
    try:
        stored = segment.source.read(chunk.offset, chunk.offset + chunk.length)
        return chunk.records(stored, chunk.offset)
    except ChunkDamage as damage:
        raise CorruptLogError(segment.path, chunk.offset, str(damage)) from None


@dataclass(frozen=True, slots=True)
class PageAtHand:
    """The records of one chunk, which somebody has read a moment ago."""

    segment: Segment
    chunk: int
    page: Page

    def is_all_of(self, segment: Segment, chunks: NDArray[np.intp]) -> bool:
        """Return whether only these records are requested."""
        return segment is self.segment and chunks.tolist() == [self.chunk]


def batches_of(
    segment: Segment,
    chunks: NDArray[np.intp],
    *,
    doors: Collection[int] | None = None,
    at_hand: PageAtHand | None = None,
) -> Iterator[tuple[Page, EventBatch]]:
    """Yield the events of some chunks of a segment, with the pages they lie in.

    Args:
        segment: The segment.
        chunks: Places of its chunks, ascending.
        doors: Events about others may be left out: `Page.events`.
        at_hand: What need not be read again.

    Raises:
        CorruptLogError: They are not what was written, or not the events that must be there.
    """
    (firsts, ends), counts = numbers_of(segment), segment.spans["events"]
    wanted = segment.chunks.chosen(chunks)
    names = segment.newer.names if len(wanted.having(UNKNOWN_BIT)) else {}

    def with_batch(page: Page, mine: NDArray[np.intp]) -> tuple[Page, EventBatch]:
        sources = NoteSources(page, partial(commit_of, segment))
        batch = page.events(sources, names, doors=doors)
        numbers = batch.number if doors is None else page.event_numbers()
        if segment.header.trimmed is None:
            _check_numbers(page, numbers, firsts[mine], ends[mine])
        else:
            _check_left(page, numbers, firsts[mine], ends[mine], counts[mine])
        return page, batch

    if at_hand is not None and at_hand.is_all_of(segment, chunks):
        yield with_batch(at_hand.page, chunks)
        return
    _keep_freed_memory()
    is_sound = _is_sound(segment, wanted)

    def read(group: ChunkTable, mine: NDArray[np.intp]) -> tuple[Page, EventBatch]:
        first_event = segment.header.first_event
        return with_batch(read_page(group, first_event, in_place=True, is_sound=is_sound), mine)

    tasks = (partial(read, group, mine) for group, mine in _with_places(segment, wanted, chunks))
    sizes = wanted.rows["size"]
    is_worth_it = int(sizes.sum()) > FEW_BYTES and not wanted.are_small
    is_worth_it = is_worth_it and int(sizes.max()) <= MOST_AHEAD_BYTES
    yield from ahead(tasks) if is_worth_it else (task() for task in tasks)


def _with_places(
    segment: Segment, chunks: ChunkTable, places: NDArray[np.intp]
) -> Iterator[tuple[ChunkTable, NDArray[np.intp]]]:
    """Yield chunks in groups, with the places of each group's."""
    at = 0
    for group in _groups(segment, chunks):
        yield group, places[at : at + len(group)]
        at += len(group)


def _is_sound(segment: Segment, chunks: ChunkTable) -> bool:
    """Return whether the bytes of these chunks were checked; checks them if that is worth it."""
    is_worth_it = 2 * len(chunks) > len(segment.chunks) and len(chunks) >= MANY_CHUNKS
    may_trust = is_worth_it and chunks.are_small and segment.source.is_guarded
    return may_trust and segment.is_sound  # to know it, all is read


@cache
def _keep_freed_memory() -> None:
    """Have the C library keep a few MiB that were freed for the next page's arrays.

    glibc returns larger arrays to the kernel at once, until it has seen an even larger one freed
    (mallopt(3), M_MMAP_THRESHOLD). Every page of memory that the kernel clears and maps again
    costs as much as reading 20 events.
    """
    np.empty(_KEPT_BYTES, np.uint8)  # never touched, so it takes no memory


_KEPT_BYTES = 2**23

_PAGE_BYTES = 5 * CHUNK_BYTES // 2
"""So many chunks are read together: each page costs some 0.2 ms on top of its bytes. A keyframe is
followed by a whole chunk and a fifth of one: twice that is a page."""

MANY_CHUNKS = 32
"""Fewer are checked one by one sooner than all the data of their segment are."""

MOST_AHEAD_BYTES = 32 * CHUNK_BYTES
"""Where a chunk holds more, as one with a large floor map does, no two are in memory at a time."""

FEW_BYTES = 3 * CHUNK_BYTES
"""So few are read at once: to hand them to other threads would take longer."""


def _groups(segment: Segment, chunks: ChunkTable) -> Iterator[ChunkTable]:
    """Yield chunks in groups, each requested from the disk one group ahead."""
    before: ChunkTable | None = None
    for group in chunks.groups(_PAGE_BYTES):
        segment.source.will_need(*group.span())
        if before is not None:
            yield before
        before = group
    if before is not None:
        yield before


def _check_numbers(
    page: Page, numbers: NDArray[np.int64], firsts: NDArray[np.int64], ends: NDArray[np.int64]
) -> None:
    """Check that a page's events are those from each of `firsts` to before each of `ends`."""
    loops = compiled()
    if loops is not None and loops.are_numbered(numbers, firsts, ends):
        return
    if len(firsts) == 1:
        (first,), (end,) = firsts.tolist(), ends.tolist()
        if len(numbers) == end - first and (numbers == np.arange(first, end)).all():
            return
    counts = ends - firsts
    shift = firsts - np.cumsum(counts) + counts
    expected = np.arange(len(numbers)) + np.repeat(shift, counts)[: len(numbers)]
    if len(numbers) != counts.sum() or (numbers != expected).any():
        wanted = counted(int(counts.sum()), "event")
        problem = f"expected {wanted} from {int(firsts[0])} on, got others"
        raise CorruptLogError(page.path, page.offset, problem)


def _check_left(
    page: Page,
    numbers: NDArray[np.int64],
    firsts: NDArray[np.int64],
    ends: NDArray[np.int64],
    counts: NDArray[np.int64],
) -> None:
    """Check that the chunks of a trimmed segment hold as many events as its index states."""
    places = np.searchsorted(firsts, numbers, "right") - 1
    fits = len(numbers) == counts.sum() and (np.diff(numbers) > 0).all()
    if not fits or (places < 0).any() or (numbers >= ends[places]).any():
        wanted = counted(int(counts.sum()), "event")
        problem = f"expected {wanted} from {int(firsts[0])} on, got others"
        raise CorruptLogError(page.path, page.offset, problem)


def statistics_of(segment: Segment) -> ClosedSegment:
    """Return what metadata.yaml is to say of a closed segment: its own Statistics.

    Raises:
        CorruptLogError: Its summary is damaged.
    """
    from semmap_log.store.bag_metadata import ClosedSegment, may_hold_newer

    said = segment.statistics
    is_newer = may_hold_newer(segment.header, said.channel_message_counts)
    header = segment.full_header if is_newer else segment.header
    return ClosedSegment.of(segment.path, said, header)


def last_commit(segment: Segment) -> Commit | None:
    """Return a segment's last commit; None: it has none."""
    return last_commit_in(segment.chunks, segment.header)


def end_of(segment: Segment) -> int:
    """Return the number of the first event after a segment's whole commits.

    Raises:
        CorruptLogError: The summary of a closed segment is damaged.
    """
    if segment.live is not None:
        return segment.live.valid_place.committed
    if segment.header.trimmed is not None:
        return segment.header.trimmed.next_event
    assert segment.counts is not None, "a closed segment counts its messages"
    return segment.header.first_event + count_events(segment.counts)


def head_before(segments: Sequence[Segment], event: int) -> bytes | None:
    """Return the hash of the commit that ends right before an event; None: none ends there.

    Args:
        segments: All of a log, in order.
        event: Its number.

    Raises:
        CorruptLogError: The commit cannot be read.
    """
    for segment in reversed(segments):
        if event == segment.header.first_event:
            return segment.header.hash_so_far
        if event > segment.header.first_event:
            if event == end_of(segment):
                return segment.head
            commit = commit_of(segment, event - 1)
            return commit.hash if commit and commit.last_event == event - 1 else None
    return None


def chunk_of(segment: Segment, event: int) -> int | None:
    """Return the place of the chunk that holds an event; None: the segment does not hold it."""
    firsts, ends = numbers_of(segment)
    chunk = int(np.searchsorted(ends, event, "right"))
    return chunk if chunk < len(ends) and firsts[chunk] <= event else None


def commit_of(segment: Segment, event: int) -> Commit | None:
    """Return the commit that holds an event; None: the segment does not, or not any more."""
    chunk = chunk_of(segment, event)
    if chunk is None:
        return None
    places = segment.chunks.having(COMMIT_BIT)
    for place in places[places >= chunk].tolist():
        commit = page_at(segment, place).commit_holding(event)
        if commit is not None:
            return commit if commit.first_event <= event else None  # it was taken out
    return None


_SAID = len(CDR_HEADER) + 16
"""Where in a note's message the texts begin: before them is its salt, which differs in each."""


class NoteFinder:
    """Finds the commits of one batch's events after another's, looking first where these lie."""

    def __init__(
        self, find_commit: Callable[[int], Commit | None], *, with_notes: bool = True
    ) -> None:
        """Begin.

        Args:
            find_commit: Returns the commit that holds an event; called for those whose Commit is
                not on the page that was looked at.
            with_notes: False: the notes are not read, and are empty.
        """
        self._find_commit = find_commit
        self._with_notes = with_notes
        self._at_hand: CommitColumns | None = None
        self._last: Commit | None = None
        """The last one that was found elsewhere; an import's may span many pages."""

    def look_at(self, _: Segment, page: Page) -> None:
        """Take the commits of a page, which contains the events that are queried next.

        Raises:
            CorruptLogError: A note is not what its channel carries.
        """
        self._at_hand = commits_on(page, with_notes=self._with_notes)

    def take(self, commits: CommitColumns) -> None:
        """Take these commits instead."""
        self._at_hand = commits

    def note_texts_of(self, numbers: NDArray[np.int64]) -> Iterator[tuple[NoteTexts, bytes]]:
        """Yield who and why of each of these events, numbers ascending, and its command's id."""
        commits = self.commits_of(numbers)
        places = commits.places_of(numbers)
        ids = commits.command_id[places].tobytes()
        for at, note in enumerate(commits.notes[places].tolist()):
            yield commits.texts[note], ids[16 * at : 16 * at + 16]

    def commits_of(self, numbers: NDArray[np.int64]) -> CommitColumns:
        """Return commits such that each of these events, numbers ascending, finds its own there."""
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
        """Take a page, and what `NoteFinder` takes."""
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
    def _finder(self) -> NoteFinder:
        finder = NoteFinder(self._find_commit)
        finder.take(commits_on(self._page))
        return finder


class NotesByCommit:
    """Who and why of all the commits of some consecutive pages, as columns."""

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
    """Return the notes of the commits whose Commits are at these places, each text once."""
    has_note = (places > 0) & (page.heads["channel_id"][places - 1] == NOTE_CHANNEL)
    codes = np.zeros(len(places), np.intp)
    codes[has_note], texts = _note_texts(page, places[has_note] - 1)
    return codes, texts


def _note_texts(page: Page, notes: NDArray[np.intp]) -> tuple[NDArray[np.intp], list[NoteTexts]]:
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
