"""A log's folder, looked at again and again while a writer changes it."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from semmap_log.errors import CorruptLogError, LogAccessError, LogError, NotALogError
from semmap_log.log.reading.mapping import map_file
from semmap_log.log.reading.scan import Segment, open_segment, read_head
from semmap_log.log.reading.segment_set import SegmentSet, arrange

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

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._known: dict[tuple[str, int], Segment] = {}
        self._listing: Listing = []
        self._found = SegmentSet([], [])

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
            listing = list_segments(self.folder)
            try:
                return self._take_in(listing)
            except (GoneError, CorruptLogError) as error:
                settled = listing == seen and not isinstance(error, GoneError)
                if settled or attempt == _MOST_LISTINGS - 1:
                    raise
                seen = listing
                time.sleep(attempt * _LISTING_PAUSE_S)
        raise AssertionError("unreachable")

    def _take_in(self, listing: Listing) -> SegmentSet:
        if listing == self._listing and (same := self._grown()) is not None:
            return same
        known = self._open(listing)
        self._found = arrange(self.folder, list(known.values()))
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
            if known is not None and (known.closed or path.stat().st_size == known.size):
                return known
            return open_segment(path, earlier=known)
        except LogError as error:
            if isinstance(error.__cause__, FileNotFoundError):
                raise GoneError(str(error)) from error.__cause__
            raise
        except OSError as error:
            gone = GoneError if isinstance(error, FileNotFoundError) else LogAccessError
            raise gone(f"{path}: cannot be read: {error.strerror}.") from error


def list_segments(folder: Path) -> Listing:
    """Return name and inode of the segment files of a log, by name.

    Raises:
        NotALogError: There is no folder, or no segment in it.
        LogAccessError: It cannot be read.
    """
    try:
        with os.scandir(folder) as entries:
            found = [(e.name, e.inode()) for e in entries if e.name.endswith(".mcap")]
    except FileNotFoundError:
        message = f"{folder}: no such log. To make one: semmap-log init {folder}"
        raise NotALogError(message) from None
    except NotADirectoryError:
        raise NotALogError(f"{folder}: a log is a folder, this is a file.") from None
    except OSError as error:
        raise LogAccessError(f"{folder}: cannot be read: {error.strerror}.") from error
    if not found:
        raise NotALogError(f"{folder}: a folder without segments (*.mcap), so not a log.")
    return sorted(found)


def check_is_log(folder: Path) -> None:
    """Return if a segment of ours lies in a folder: then it is a log's, however damaged.

    Raises:
        NotALogError: There is none.
        CorruptLogError: All there are are damaged in their heads.
        LogAccessError: They cannot be read.
    """
    *others, last = (folder / name for name, _ in list_segments(folder))
    for path in others:
        with suppress(LogError):
            read_head(path, map_file(path))
            return
    read_head(last, map_file(last))
