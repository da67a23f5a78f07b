"""Where the files lie that a verification reads: on a disk, or another place that gives bytes."""

from __future__ import annotations

import os
import stat
from collections.abc import Hashable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path, PurePath
from typing import Protocol

from semmap_log.core.io.file_calls import open_plainly, read_into, read_page_into
from semmap_log.errors import LogAccessError
from semmap_log.store.closed_mark import ClosedMark, read_mark
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import BAG_METADATA_NAME, MOST_LIST_BYTES
from semmap_log.store.manifest import ShippedSegment
from semmap_log.store.removed_part import RemovedPart, read_removed_part


class OpenedFile(Protocol):
    """A file, as long as it is open."""

    @property
    def size(self) -> int:
        """Bytes in all, when it was opened."""

    @property
    def identity(self) -> Hashable:
        """What tells it from another file of its name."""

    @property
    def is_regular(self) -> bool:
        """Whether it is a file, no pipe or folder."""

    def read_into(self, target: memoryview, at: int) -> int:
        """Fill in some bytes from an offset on; return how many: 0 behind the file's end.

        Raises:
            OSError: Those at the offset cannot be had.
        """


class FilePlace(Protocol):
    """The files of one log: nothing of what they say is believed."""

    @property
    def path(self) -> PurePath:
        """Where they lie, for messages; of a single segment its own."""

    def is_folder(self) -> bool:
        """Tell whether it is a log's folder, and no single file."""

    def files(self) -> Sequence[PurePath]:
        """Return all that lies there, below `path`.

        Raises:
            OSError: It cannot be listed.
        """

    def opened(self, file: PurePath) -> AbstractContextManager[OpenedFile]:
        """Open a file.

        Raises:
            FileNotFoundError: It is gone.
            OSError: It cannot be opened.
        """

    def flaws(self) -> Sequence[tuple[PurePath, str]]:
        """Return which of the files are not what was put there, and why, before they are read."""

    def differences(self, found: Sequence[ShippedSegment]) -> Sequence[tuple[PurePath, str]]:
        """Return in what the files that were read differ from what was put there.

        Args:
            found: What the closed segments say themselves; their SHA-256 is left out.
        """

    def mark(self) -> ClosedMark | None:
        """Return what the last mark says; None: there is none.

        Raises:
            CorruptLogError: It is not what was written.
        """

    def removed(self) -> RemovedPart | None:
        """Return which segments were removed from this place once they were shipped; None: none.

        Raises:
            CorruptLogError: What says so is not what was written.
        """

    def bag_metadata(self) -> str | None:
        """Return the text of metadata.yaml; nothing where there is none; None: none belongs there.

        Raises:
            LogAccessError: It cannot be read.
        """


class DiskFile:
    """An `OpenedFile` by its descriptor."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        status = os.fstat(fd)
        self.size = status.st_size
        self.identity = (status.st_dev, status.st_ino)
        self.is_regular = stat.S_ISREG(status.st_mode)

    def read_into(self, target: memoryview, at: int) -> int:
        """Read as much as the disk gives; as `OpenedFile.read_into`."""
        try:
            return read_into(self._fd, target, at)
        except OSError:
            return read_page_into(self._fd, target, at)


class DiskPlace:
    """A `FilePlace`: a folder, or one file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def is_folder(self) -> bool:
        """Tell whether it is a folder now."""
        return self.path.is_dir()

    def files(self) -> list[PurePath]:
        """Return all that is in the folder."""
        return list(self.path.iterdir())

    @contextmanager
    def opened(self, file: PurePath) -> Iterator[OpenedFile]:
        """Open a file; as `FilePlace.opened`."""
        fd = open_plainly(Path(file))
        try:
            yield DiskFile(fd)
        finally:
            os.close(fd)

    def flaws(self) -> Sequence[tuple[PurePath, str]]:
        """Return none: a disk does not say what was put there."""
        return ()

    def differences(self, _found: Sequence[ShippedSegment]) -> Sequence[tuple[PurePath, str]]:
        """Return none, as `flaws`."""
        return ()

    def mark(self) -> ClosedMark | None:
        """Return what the last mark says; as `FilePlace.mark`."""
        return read_mark(LogFolder(self.path))

    def removed(self) -> RemovedPart | None:
        """Return what shipped.json says; as `FilePlace.removed`."""
        return read_removed_part(LogFolder(self.path))

    def bag_metadata(self) -> str:
        """Return the text of metadata.yaml; as `FilePlace.bag_metadata`."""
        try:
            data = LogFolder(self.path).read_bytes(BAG_METADATA_NAME, MOST_LIST_BYTES)
        except (FileNotFoundError, LogAccessError):  # or it is no regular file
            return ""
        except OSError as error:
            path = self.path / BAG_METADATA_NAME
            raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
        return data.decode(errors="replace")
