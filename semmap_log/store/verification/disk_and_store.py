"""A log of which a part was removed from the disk, read whole: that part in the store."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePath

from semmap_log.io.object_store import ObjectStatus, ObjectStore
from semmap_log.store.closed_mark import ClosedMark
from semmap_log.store.folder import LogFolder
from semmap_log.store.removed_part import RemovedSegment, read_removed_part
from semmap_log.store.verification.file_place import DiskPlace, OpenedFile
from semmap_log.store.verification.object_place import ObjectFile


class DiskAndStorePlace:
    """A `FilePlace`: a folder, and the objects that stand for what was removed from it."""

    def __init__(self, path: Path, store: ObjectStore) -> None:
        self.path = path
        self._disk = DiskPlace(path)
        self._store = store
        self._elsewhere: dict[str, RemovedSegment] = {}

    def files(self) -> list[PurePath]:
        """Return all that is in the folder, and each removed segment under the name that it had."""
        part, here = read_removed_part(LogFolder(self.path)), self._disk.files()
        names = {file.name for file in here}
        removed = () if part is None else part.segments
        self._elsewhere = {one.file: one for one in removed if one.file not in names}
        return [*here, *(self.path / name for name in self._elsewhere)]

    def is_folder(self) -> bool:
        """Tell whether it is a folder now."""
        return self._disk.is_folder()

    def mark(self) -> ClosedMark | None:
        """Return what closed.json says; as `FilePlace.mark`."""
        return self._disk.mark()

    @contextmanager
    def opened(self, file: PurePath) -> Iterator[OpenedFile]:
        """Open a file, or an object; as `FilePlace.opened`."""
        removed = self._elsewhere.get(file.name)
        if removed is None:
            with self._disk.opened(file) as opened:
                yield opened
        else:
            shipped = removed.shipped
            yield ObjectFile(self._store, ObjectStatus(shipped.name, shipped.size, ""))

    def flaws(self) -> list[tuple[PurePath, str]]:
        """Return the objects that are gone, or longer or shorter than they were."""
        found: list[tuple[PurePath, str]] = []
        for one in list(self._elsewhere.values()):
            try:
                size = self._store.status(one.shipped.name).size
            except FileNotFoundError:
                found.append((self._store.url / one.shipped.name, "it was shipped; it is gone"))
                continue
            if size != one.shipped.size:
                text = f"{one.shipped.size} bytes were shipped; it has {size}"
                found.append((self._store.url / one.shipped.name, text))
        return found

    def removed(self) -> None:
        """Return none: all of the log is read."""

    def bag_metadata(self) -> None:
        """Return none: metadata.yaml names what lies on the disk."""
