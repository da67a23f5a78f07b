"""A log's folder, looked at again and again while a writer changes it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from semmap_log.common.texts import command_line
from semmap_log.errors import CorruptLogError, LogAccessError, LogError, NotALogError
from semmap_log.store.bag_metadata import listed_names
from semmap_log.store.closed_mark import ClosedMark, read_mark
from semmap_log.store.folder import LogFolder, Version
from semmap_log.store.form import BAG_METADATA_NAME, CLOSED_MARK_NAME, has_name_of_file
from semmap_log.store.reading.mapped_file import map_file
from semmap_log.store.reading.segment_scan import Segment, open_segment, read_head
from semmap_log.store.reading.segment_set import (
    SegmentSet,
    arrange,
    check_goes_on,
    check_listed,
    check_reaches,
)

Listing = list[tuple[str, int]]
"""Name and inode of each segment file, by name."""

_MOST_LISTINGS = 20
_LISTING_PAUSE_S = 0.002


class GoneError(LogAccessError):
    """A file that was listed is not there any more."""


class SegmentFolder:
    """What is known of the segments in a folder; what is known is not read again.

    A closed segment never changes; its successor, if it is compacted, is another inode, since
    the old one is held as long as it is mapped. A live segment only grows.
    """

    def __init__(self, folder: LogFolder) -> None:
        self.folder = folder
        self._known: dict[tuple[str, int], Segment] = {}
        self._listing: Listing = []
        self._found = SegmentSet([], [])
        self._earlier: Sequence[Segment] = ()
        """The segments when they were last found to be all of the log."""
        self._mark: tuple[Version | None, ClosedMark | None] = None, None
        """What closed.json said, and what tells that it is still the same file."""
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
            mark = self._mark_now()  # first: what is closed meanwhile is no concern of ours
            listing = list_segments(self.folder)
            try:
                return self._checked(self._take_in(listing), mark)
            except (GoneError, CorruptLogError) as error:
                settled = listing == seen and not isinstance(error, GoneError)
                if settled or attempt == _MOST_LISTINGS - 1:
                    raise
                seen = listing
                time.sleep(attempt * _LISTING_PAUSE_S)
        raise AssertionError("unreachable")

    def _mark_now(self) -> ClosedMark | None:
        """Return what closed.json says; it is read again where it is another file."""
        try:
            version = self.folder.version(CLOSED_MARK_NAME)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise LogAccessError(
                f"{self.folder.path}: cannot be read: {error.strerror}."
            ) from error
        if version != self._mark[0]:
            self._mark = version, read_mark(self.folder)
        return self._mark[1]

    def _checked(self, found: SegmentSet, mark: ClosedMark | None) -> SegmentSet:
        """Return what was found, once it is known to be no less than it was."""
        seen = (mark, found.segments[-1])
        if seen == self._reaches:
            return found
        if mark is not None:
            check_reaches(mark, self.folder / CLOSED_MARK_NAME, found.segments)
        else:
            check_listed(self._listed(), self.folder / BAG_METADATA_NAME, found.segments)
        if self._earlier:
            check_goes_on(found.segments, self._earlier)
        self._reaches, self._earlier = seen, found.segments
        return found

    def _listed(self) -> list[str]:
        """Return the closed segments that metadata.yaml lists: in a log without closed.json."""
        try:
            return listed_names(
                self.folder.read_bytes(BAG_METADATA_NAME).decode("utf-8", "replace")
            )
        except OSError:
            return []  # it is a cache

    def _take_in(self, listing: Listing) -> SegmentSet:
        if listing == self._listing and (same := self._grown()) is not None:
            return same
        known = self._open(listing)
        self._found = arrange(self.folder.path, list(known.values()))
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

    def _open(self, listing: Listing) -> dict[tuple[str, int], Segment]:
        found: dict[tuple[str, int], Segment] = {}
        foreign: list[tuple[Path, NotALogError]] = []
        for name, inode in listing:
            path = self.folder / name
            try:
                found[name, inode] = self._read_on(path, self._known.get((name, inode)))
            except NotALogError as error:
                foreign.append((path, error))
        for path, reason in foreign:
            if not found:
                raise reason
            problem = "no segment of a semmap log, though it lies among them: its head is damaged"
            raise CorruptLogError(path, 0, f"{problem}, or it does not belong here ({reason})")
        return found

    def _read_on(self, path: Path, known: Segment | None) -> Segment:
        try:
            if known is not None and (known.closed or self._size(path) == known.size):
                return known
            return open_segment(path, earlier=known, folder=self.folder)
        except LogError as error:
            if isinstance(error.__cause__, FileNotFoundError):
                raise GoneError(str(error)) from error.__cause__
            raise
        except OSError as error:
            gone = GoneError if isinstance(error, FileNotFoundError) else LogAccessError
            raise gone(f"{path}: cannot be read: {error.strerror}.") from error

    def _size(self, path: Path) -> int:
        return self.folder.status(path.name, follows=True).st_size


def list_segments(folder: LogFolder) -> Listing:
    """Return name and inode of the segment files of a log, by name.

    Raises:
        NotALogError: There is no folder, or no segment in it.
        LogAccessError: It cannot be read.
    """
    try:
        found = [(name, inode) for name, inode in folder.files() if name.endswith(".mcap")]
    except FileNotFoundError:
        raise NotALogError(_no_such_log(folder.path)) from None
    except NotADirectoryError:
        raise NotALogError(f"{folder.path}: a log is a folder, this is a file.") from None
    except OSError as error:
        raise LogAccessError(f"{folder.path}: cannot be read: {error.strerror}.") from error
    if not found:
        raise NotALogError(f"{folder.path}: a folder without segments (*.mcap), so not a log.")
    return found


def _no_such_log(path: Path) -> str:
    if has_name_of_file(path):
        return f"{path}: no such file; a log is a folder, or, to read, a zip of one."
    return f"{path}: no such log. To make one: {command_line('init', path)}"


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
