"""The segments of a log in a folder on a disk, or in a zip that was unpacked there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from semmap_log.core.io.byte_source import ByteSource
from semmap_log.core.io.made_logs import is_called_as_made
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.texts import command_line
from semmap_log.errors import LogAccessError, NotALogError
from semmap_log.store.closed_mark import ClosedMark, listed_marks, read_mark
from semmap_log.store.folder import LogFolder, Version
from semmap_log.store.form import (
    BAG_METADATA_NAME,
    MOST_LIST_BYTES,
    REMOVED_NAME,
    has_name_of_file,
)
from semmap_log.store.reading.mapped_file import map_file
from semmap_log.store.reading.segment_store import Listing
from semmap_log.store.removed_part import (
    RemovedPart,
    RemovedSegment,
    read_removed_part,
    rest_of_environment,
)

if TYPE_CHECKING:
    from semmap_log.store.manifest import ShippedSegment


class LocalSegments:
    """A `SegmentStore`: files of a folder, mapped."""

    def __init__(self, folder: LogFolder, *, rest_at: UrlPath | None = None) -> None:
        """Take the folder; nothing is asked yet.

        Args:
            folder: The log's.
            rest_at: Where segments are read that were removed from the disk; default: as the
                environment says; else they are not read.
        """
        self.folder = folder
        self._rest_at = rest_at or rest_of_environment()
        self._removed: tuple[Version | None, RemovedPart | None] = None, None
        """What shipped.json said, and what tells that it is still the same file."""
        self._elsewhere: dict[str, RemovedSegment] = {}
        """Those whose files are not there, as listed last."""
        self._listed: Listing = []
        """The files that were there at the last look: while they are, none was removed."""
        self._mark: tuple[list[tuple[str, Version]], ClosedMark | None] = [], None
        """How far the log reaches, and what tells that its marks are still the same files."""

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

    def _removed_source(self, removed: RemovedSegment) -> ByteSource:
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

    def _removed_part(self) -> RemovedPart | None:
        try:
            version = self.folder.version(REMOVED_NAME)
        except OSError:
            return None
        if version != self._removed[0]:
            self._removed = version, read_removed_part(self.folder)
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
        raise NotALogError(f"{folder.path}: a log is a folder, this is a file.") from None
    except OSError as error:
        raise LogAccessError(f"{folder.path}: cannot be read: {error.strerror}.") from error
    if not found:
        raise NotALogError(f"{folder.path}: a folder without segments (*.mcap), so not a log.")
    return found


def _no_such_log(path: Path) -> str:
    if is_called_as_made(path):
        line = command_line("join", path, "LOG", "LOG")
        return f"{path}: no such file. To join logs in it: {line}"
    if has_name_of_file(path):
        return f"{path}: no such file; a log is a folder, or, to read, a zip of one."
    return f"{path}: no such log. To make one: {command_line('init', path)}"
