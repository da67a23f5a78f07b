"""A log's segments, looked at again and again while a writer changes them."""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import PurePath

from semmap_log.errors import CorruptLogError, LogAccessError, LogError, NotALogError
from semmap_log.store.closed_mark import ClosedMark
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import BAG_METADATA_NAME, is_named_as_part
from semmap_log.store.reading.local_segments import list_segments
from semmap_log.store.reading.mapped_file import map_file
from semmap_log.store.reading.segment_scan import Segment, read_head, segment_in
from semmap_log.store.reading.segment_set import (
    SegmentSet,
    arrange,
    check_goes_on,
    check_listed,
    check_reaches,
)
from semmap_log.store.reading.segment_store import Listing, SegmentStore

_MOST_LISTINGS = 20
_LISTING_PAUSE_S = 0.002


class GoneError(LogAccessError):
    """A file that was listed is not there any more."""


class SegmentFolder:
    """What is known of a log's segments, wherever they lie; what is known is not read again.

    A closed segment never changes; its successor, if it is compacted, is another file (on a disk
    another inode, since the old one is held as long as it is mapped). A live segment only grows.
    """

    def __init__(self, store: SegmentStore) -> None:
        self.store = store
        self._known: dict[tuple[str, Hashable], Segment] = {}
        self._listing: Listing = []
        self._found = SegmentSet([], [])
        self._earlier: Sequence[Segment] = ()
        """The segments when they were last found to be all of the log."""
        self._reaches: tuple[ClosedMark | None, Segment] | None = None
        """The mark, and the last segment, for which it was found that the log reaches it."""

    def look(self) -> SegmentSet:
        """Return the segments of the log as they are now.

        A folder cannot be listed at one instant. Where a file has gone since, or the files do not
        fit together, it is listed again: a writer leaves a whole log at every instant.

        Raises:
            NotALogError: There is no log any more.
            CorruptLogError: A segment is damaged, missing, or from elsewhere.
            LogAccessError: A segment cannot be read.
        """
        seen: Listing = []
        for attempt in range(_MOST_LISTINGS):
            mark = self.store.mark()  # first: what is closed meanwhile is no concern of ours
            listing = self.store.segments()
            try:
                return self._checked(self._take_in(listing), mark)
            except (GoneError, CorruptLogError) as error:
                settled = listing == seen and not isinstance(error, GoneError)
                if settled or attempt == _MOST_LISTINGS - 1:
                    raise
                seen = listing
                time.sleep(attempt * _LISTING_PAUSE_S)
        raise AssertionError("unreachable")

    def _checked(self, found: SegmentSet, mark: ClosedMark | None) -> SegmentSet:
        """Return what was found, once it is known to be no less than it was."""
        seen = (mark, found.segments[-1])
        if seen == self._reaches:
            return found
        if mark is not None:
            check_reaches(mark, self.store.path / mark.file, found.segments)
        else:
            names = self.store.closed_names()
            check_listed(names, self.store.path / BAG_METADATA_NAME, found.segments)
        if self._earlier:
            check_goes_on(found.segments, self._earlier)
        self._reaches, self._earlier = seen, found.segments
        return found

    def _take_in(self, listing: Listing) -> SegmentSet:
        if listing == self._listing and (same := self._grown()) is not None:
            return same
        known, damaged = self._open(listing)
        found = arrange(self.store.path, list(known.values()))
        self._found = replace(found, leftovers=sorted([*found.leftovers, *damaged]))
        self._known, self._listing = known, listing
        return self._found

    def _grown(self) -> SegmentSet | None:
        """Return the same files as before, the last read on if it is live; None if it changed."""
        *older, last = self._found.segments
        name = (last.path.name, dict(self._listing)[last.path.name])
        grown = self._read_on(last.path, last)
        if grown.header != last.header:
            return None
        if grown is not last:
            self._known[name] = grown
            self._found = replace(self._found, segments=[*older, grown])
        return self._found

    def _open(self, listing: Listing) -> tuple[dict[tuple[str, Hashable], Segment], list[PurePath]]:
        """Return the segments that are listed, and damaged files that the log does not need."""
        found: dict[tuple[str, Hashable], Segment] = {}
        failed: list[tuple[PurePath, NotALogError | CorruptLogError]] = []
        for listed in listing:
            path = self.store.path / listed[0]
            try:
                found[listed] = self._read_on(path, self._known.get(listed))
            except (NotALogError, CorruptLogError) as error:
                failed.append((path, error))
        needed = [one for one in failed if not _is_in_another(one[0], found.values())]
        for path, reason in needed:
            if isinstance(reason, CorruptLogError) or not found:
                raise reason
            problem = "no segment of a semmap log, though it lies among them: its head is damaged"
            raise CorruptLogError(path, 0, f"{problem}, or it does not belong here ({reason})")
        return found, [path for path, _ in failed]

    def _read_on(self, path: PurePath, known: Segment | None) -> Segment:
        try:
            if known is not None and (known.closed or self.store.size_of(path.name) == known.size):
                return known
            told = self.store.told(path.name)
            source = self.store.open(path.name)
            if told is not None:
                return Segment(path, told.header, source, told.head_end, live=None, told=told)
            return segment_in(path, source, earlier=known)
        except LogError as error:
            if isinstance(error.__cause__, FileNotFoundError):
                raise GoneError(str(error)) from error.__cause__
            raise
        except OSError as error:
            gone = GoneError if isinstance(error, FileNotFoundError) else LogAccessError
            raise gone(f"{path}: cannot be read: {error.strerror}.") from error


def _is_in_another(path: PurePath, segments: Iterable[Segment]) -> bool:
    """Tell whether a file, which cannot be read, was merged into another: by its name."""
    heads = ((one.path.name, one.header) for one in segments)
    return any(
        is_named_as_part(path.name, name, head.number, head.last_number) for name, head in heads
    )


def check_is_log(folder: LogFolder) -> None:
    """Return if a segment of ours lies in a folder: then it is a log's, however damaged.

    Raises:
        NotALogError: There is none.
        CorruptLogError: All there are are damaged in their heads.
        LogAccessError: They cannot be read.
    """
    *others, last = (folder / name for name, _ in list_segments(folder))
    for path in others:
        with suppress(LogError):
            read_head(path, map_file(path, folder))
            return
    read_head(last, map_file(last, folder))
