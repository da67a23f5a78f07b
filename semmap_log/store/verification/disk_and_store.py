"""A log of which a part was removed from the disk, read whole: that part in the store."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePath

from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.store.closed_mark import ClosedMark
from semmap_log.store.folder import LogFolder
from semmap_log.store.manifest import ShippedSegment
from semmap_log.store.manifest_differences import differences
from semmap_log.store.removed_part import RemovedSegment, read_removed_part
from semmap_log.store.verification.file_place import DiskPlace, OpenedFile
from semmap_log.store.verification.object_place import ObjectFiles


class DiskAndStorePlace:
    """A `FilePlace`: a folder, and the objects that stand for what was removed from it."""

    def __init__(self, path: Path, store: ObjectStore) -> None:
        self.path = path
        self._disk = DiskPlace(path)
        self._store = store
        self._files = ObjectFiles(store)
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
        """Return what the last mark says; as `FilePlace.mark`."""
        return self._disk.mark()

    @contextmanager
    def opened(self, file: PurePath) -> Iterator[OpenedFile]:
        """Open a file, or an object; as `FilePlace.opened`."""
        removed = self._elsewhere.get(file.name)
        if removed is None:
            with self._disk.opened(file) as opened:
                yield opened
        else:
            with self._files.opened(_status_of(removed)) as fetched:
                yield fetched

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

    def differences(self, found: Sequence[ShippedSegment]) -> list[tuple[PurePath, str]]:
        """Return in what objects differ from what was shipped: in every field."""
        return [
            (self._store.url / removed.shipped.name, f"not as it was shipped: {text}")
            for one in found
            if (removed := self._elsewhere.get(one.name)) is not None
            for text in differences(
                removed.shipped, replace(one, sha256=self._files.sha256(_status_of(removed)))
            )
        ]

    def removed(self) -> None:
        """Return none: all of the log is read."""

    def bag_metadata(self) -> None:
        """Return none: metadata.yaml names what lies on the disk."""


def _status_of(removed: RemovedSegment) -> ObjectStatus:
    return ObjectStatus(removed.shipped.name, removed.shipped.size, "")
