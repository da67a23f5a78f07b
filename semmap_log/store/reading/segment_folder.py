"""The segments of a log in a folder on disk.

They are looked at again and again while a writer changes them. `store_at` returns the
`SegmentStore` of a place: a folder, a zip, or a URL.
"""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from semmap_log.core.io.byte_source import ByteSource
from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.core.io.virtual_logs import has_virtual_suffix
from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.core.texts import command_line
from semmap_log.errors import CorruptLogError, LogAccessError, LogError, NotALogError
from semmap_log.store import removed_part
from semmap_log.store.byte_layout import (
    MOST_LIST_BYTES,
    REMOVED_NAME,
    has_name_of_file,
    is_named_as_part,
)
from semmap_log.store.closed_mark import ClosedMark, listed_marks, read_mark
from semmap_log.store.folder import LogFolder, Version, not_a_folder
from semmap_log.store.reading.mapped_file import map_file
from semmap_log.store.reading.segment_scan import Segment, read_head, segment_in
from semmap_log.store.reading.segment_set import (
    Listing,
    SegmentSet,
    SegmentStore,
    arrange,
    check_continues,
    check_listed,
    check_reaches,
)

if TYPE_CHECKING:
    from semmap_log.core.io.object_cache import ObjectCache
    from semmap_log.store.manifest import ShippedSegment


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
            check_continues(found.segments, self._earlier)
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
    """Return whether a file that cannot be read was merged into another, judged by its name."""
    heads = ((one.path.name, one.header) for one in segments)
    return any(
        is_named_as_part(path.name, name, head.number, head.last_number) for name, head in heads
    )


def check_is_log(folder: LogFolder) -> None:
    """Check that a folder contains a segment of ours: then it is a log's, however damaged.

    Raises:
        NotALogError: It contains none.
        CorruptLogError: All of them are damaged in their heads.
        LogAccessError: They cannot be read.
    """
    *others, last = (folder / name for name, _ in list_segments(folder))
    for path in others:
        with suppress(LogError):
            read_head(path, map_file(path, folder))
            return
    read_head(last, map_file(last, folder))


def store_at(
    place: LogFolder | PurePath | SegmentStore,
    *,
    cache: ObjectCache | None = None,
    rest_at: UrlPath | None = None,
) -> SegmentStore:
    """Return where the segments of a log are read.

    Args:
        place: A folder, a zip, a URL, or what is one already.
        rest_at: Where segments are read that were removed from a folder.
        cache: Keeps on a disk what is fetched of a URL; default: as the environment says.

    Raises:
        NotALogError: It is a URL that leads to no log.
        MissingExtraError: A URL needs a package that is not installed.
    """
    if isinstance(place, LogFolder):
        return LocalSegments(place)
    if not isinstance(place, PurePath):
        return place
    found = place_of(place)
    if isinstance(found, UrlPath):
        from semmap_log.core.io.object_store import ObjectStore
        from semmap_log.store.reading.removed_source import ObjectSegments

        return ObjectSegments(ObjectStore(found), cache=cache)
    return LocalSegments(LogFolder(found), rest_at=rest_at)


class LocalSegments:
    """A `SegmentStore`: files of a folder, mapped."""

    def __init__(self, folder: LogFolder, *, rest_at: UrlPath | None = None) -> None:
        """Store the folder; nothing is read yet.

        Args:
            folder: The log's.
            rest_at: Where segments are read that were removed from the disk; default: as the
                environment says; else they are not read.
        """
        self.folder = folder
        self._rest_at = rest_at or removed_part.rest_of_environment()
        self._removed: tuple[Version | None, removed_part.RemovedPart | None] = None, None
        """What shipped.json stated, and what shows that it is still the same file."""
        self._elsewhere: dict[str, removed_part.RemovedSegment] = {}
        """Those whose files are not there, as listed last."""
        self._listed: Listing = []
        """The files that were there at the last look: while they are, none was removed."""
        self._mark: tuple[list[tuple[str, Version]], ClosedMark | None] = [], None
        """How far the log reaches, and what shows that its marks are still the same files."""

    @property
    def path(self) -> Path:
        """The folder, as it was given."""
        return self.folder.path

    @property
    def given(self) -> Path:
        """The folder's absolute path when it was opened."""
        return self.folder.given

    def segments(self) -> Listing:
        """Return name and inode of each; of a removed one its hash; as `SegmentStore.segments`."""
        listed = list_segments(self.folder)
        if listed == self._listed and not self._elsewhere:
            return listed
        part = self._removed_part()  # then: it is written before the first file goes
        self._listed = listed
        if part is None:
            self._elsewhere = {}
            return listed
        here = {name for name, _ in listed}
        self._elsewhere = {one.file: one for one in part.segments if one.file not in here}
        return sorted(
            [*listed, *((one.file, one.shipped.sha256) for one in self._elsewhere.values())],
            key=lambda named: named[0],
        )

    def open(self, name: str) -> ByteSource:
        """Return a file, mapped, or what stands for a removed one; as `SegmentStore.open`."""
        removed = self._elsewhere.get(name)
        if removed is not None:
            return self._removed_source(removed)
        return map_file(self.folder / name, self.folder)

    def told(self, name: str) -> ShippedSegment | None:
        """Return what is known of a removed segment; a file is opened, and says it itself."""
        removed = self._elsewhere.get(name)
        return None if removed is None else removed.shipped

    def _removed_source(self, removed: removed_part.RemovedSegment) -> ByteSource:
        if self._rest_at is None:
            part = self._removed[1]
            assert part is not None
            from semmap_log.store.reading.removed_source import RemovedSource

            return RemovedSource(self.folder, removed, part.url)
        from semmap_log.core.io.object_source import ObjectSource
        from semmap_log.core.io.object_store import ObjectStatus, ObjectStore

        shipped = removed.shipped
        status = ObjectStatus(shipped.name, shipped.size, "")
        return ObjectSource(ObjectStore(self._rest_at), status, sha256=shipped.sha256)

    def _removed_part(self) -> removed_part.RemovedPart | None:
        try:
            version = self.folder.version(REMOVED_NAME)
        except OSError:
            return None
        if version != self._removed[0]:
            self._removed = version, removed_part.read_removed_part(self.folder)
        return self._removed[1]

    def size_of(self, name: str) -> int:
        """Return a file's size, or that of what it links to; as `SegmentStore.size_of`."""
        removed = self._elsewhere.get(name)
        if removed is not None:
            return removed.shipped.size
        return self.folder.status(name, follows=True).st_size

    def mark(self) -> ClosedMark | None:
        """Return what the last mark says; it is read again where it is another file."""
        try:
            found = [(name, self.folder.version(name)) for name in listed_marks(self.folder)]
        except FileNotFoundError:  # one has gone since: another has followed it
            return read_mark(self.folder)
        except OSError as error:
            raise LogAccessError(
                f"{self.folder.path}: cannot be read: {error.strerror}."
            ) from error
        if found != self._mark[0]:
            self._mark = found, read_mark(self.folder) if found else None
        return self._mark[1]

    def closed_names(self) -> list[str]:
        """Return the closed segments that metadata.yaml lists: in a log without a mark."""
        from semmap_log.store.bag_metadata import listed_names

        try:
            data = self.folder.read_bytes(BAG_METADATA_NAME, MOST_LIST_BYTES)
        except OSError:
            return []  # it is a cache
        return listed_names(data.decode("utf-8", "replace"))


def list_segments(folder: LogFolder) -> Listing:
    """Return name and inode of the segment files of a log, by name.

    Raises:
        NotALogError: There is no folder, or no segment in it.
        LogAccessError: It cannot be read.
    """
    try:
        found: Listing = [(name, inode) for name, inode in folder.files() if name.endswith(".mcap")]
    except FileNotFoundError:
        raise NotALogError(_no_such_log(folder.path)) from None
    except NotADirectoryError:
        raise NotALogError(not_a_folder(folder.path)) from None
    except OSError as error:
        raise LogAccessError(f"{folder.path}: cannot be read: {error.strerror}.") from error
    if not found:
        raise NotALogError(f"{folder.path}: a folder without segments (*.mcap), so not a log.")
    return found


def _no_such_log(path: Path) -> str:
    if has_virtual_suffix(path):
        line = command_line("join", path, "LOG", "LOG")
        return f"{path}: no such file. To join logs in it: {line}"
    if has_name_of_file(path):
        return f"{path}: no such file; a log is a folder, or, to read, a zip of one."
    return f"{path}: no such log. To make one: {command_line('init', path)}"
