"""The segments of a log in a folder on a disk, or in a zip that was unpacked there."""

from __future__ import annotations

from pathlib import Path

from semmap_log.common.texts import command_line
from semmap_log.errors import LogAccessError, NotALogError
from semmap_log.io.made_logs import is_called_as_made
from semmap_log.store.bag_metadata import listed_names
from semmap_log.store.closed_mark import ClosedMark, read_mark
from semmap_log.store.folder import LogFolder, Version
from semmap_log.store.form import BAG_METADATA_NAME, CLOSED_MARK_NAME, has_name_of_file
from semmap_log.store.reading.mapped_file import MappedFile, map_file
from semmap_log.store.reading.segment_store import Listing


class LocalSegments:
    """A `SegmentStore`: files of a folder, mapped."""

    def __init__(self, folder: LogFolder) -> None:
        self.folder = folder
        self._mark: tuple[Version | None, ClosedMark | None] = None, None
        """What closed.json said, and what tells that it is still the same file."""

    @property
    def path(self) -> Path:
        """The folder, as it was given."""
        return self.folder.path

    @property
    def given(self) -> Path:
        """The folder's absolute path when it was opened."""
        return self.folder.given

    def segments(self) -> Listing:
        """Return name and inode of each; as `SegmentStore.segments`."""
        return list_segments(self.folder)

    def open(self, name: str) -> MappedFile:
        """Return a file, mapped; as `SegmentStore.open`."""
        return map_file(self.folder / name, self.folder)

    def told(self, _name: str) -> None:
        """Return nothing: a file is opened, and says it itself."""

    def size_of(self, name: str) -> int:
        """Return a file's size, or that of what it links to; as `SegmentStore.size_of`."""
        return self.folder.status(name, follows=True).st_size

    def mark(self) -> ClosedMark | None:
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

    def closed_names(self) -> list[str]:
        """Return the closed segments that metadata.yaml lists: in a log without closed.json."""
        try:
            text = self.folder.read_bytes(BAG_METADATA_NAME).decode("utf-8", "replace")
        except OSError:
            return []  # it is a cache
        return listed_names(text)


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
