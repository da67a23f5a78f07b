"""The files of a log in a store, as a verification reads them: every byte, none of it believed."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from contextlib import contextmanager, suppress
from pathlib import PurePath

from semmap_log.errors import LogAccessError, LogError, ObjectChangedError
from semmap_log.io.object_store import ObjectStatus, ObjectStore
from semmap_log.io.url_path import UrlPath
from semmap_log.store.closed_mark import MOST_BYTES, ClosedMark, mark_in
from semmap_log.store.form import BAG_METADATA_NAME, CLOSED_MARK_NAME
from semmap_log.store.log_objects import KeptManifest, log_objects, read_manifest
from semmap_log.store.manifest import MANIFEST_NAME
from semmap_log.store.verification.file_bytes import Vanished


class ObjectFile:
    """An `OpenedFile`: an object as it was when it was listed."""

    is_regular = True

    def __init__(self, store: ObjectStore, status: ObjectStatus) -> None:
        self._store = store
        self._status = status
        self.size = status.size
        self.identity: Hashable = (status.name, status.e_tag)

    def read_into(self, target: memoryview, at: int) -> int:
        """Fetch what is asked for; as `OpenedFile.read_into`.

        Raises:
            Vanished: The object is gone, or another has its name.
            LogError: The store does not give it: that is no bad sector, which would be gone round.
        """
        end = min(at + len(target), self.size)
        if at >= end:
            return 0
        try:
            data = self._store.part(self._status, at, end)
        except (FileNotFoundError, ObjectChangedError):
            raise Vanished from None
        except LogAccessError as error:
            raise LogError(str(error)) from None
        target[: len(data)] = data
        return len(data)


class ObjectPlace:
    """A `FilePlace`: the objects below a URL."""

    def __init__(self, store: ObjectStore) -> None:
        self._store = store
        self._listed: dict[str, ObjectStatus] = {}
        self._manifest: KeptManifest | None = None

    @property
    def path(self) -> UrlPath:
        """The URL."""
        return self._store.url

    def is_folder(self) -> bool:
        """Tell whether anything lies below the URL."""
        return bool(self.files())

    def files(self) -> list[PurePath]:
        """Return all that lies there now; where a manifest is, what that names of it."""
        self._listed = {status.name: status for status in log_objects(self._store)}
        self._manifest = read_manifest(self._store, self._manifest)
        if self._manifest is not None:
            named = {one.name for one in self._manifest.manifest.segments}
            self._listed = {name: one for name, one in self._listed.items() if name in named}
        return [self.path / name for name in self._listed]

    def flaws(self) -> list[tuple[PurePath, str]]:
        """Return the segments that are gone, or longer or shorter than the manifest tells."""
        found: list[tuple[PurePath, str]] = []
        for one in self._manifest.manifest.segments if self._manifest is not None else ():
            status = self._listed.get(one.name)
            if status is None:
                found.append((self.path / one.name, f"{MANIFEST_NAME} names it; it is gone"))
            elif status.size != one.size:
                text = f"{MANIFEST_NAME} tells of {one.size} bytes; it has {status.size}"
                found.append((self.path / one.name, text))
        return found

    @contextmanager
    def opened(self, file: PurePath) -> Iterator[ObjectFile]:
        """Open an object as it was listed; as `FilePlace.opened`."""
        status = self._listed.get(file.name) or self._store.status(file.name)
        yield ObjectFile(self._store, status)

    def mark(self) -> ClosedMark | None:
        """Return what closed.json says; as `FilePlace.mark`."""
        self._manifest = read_manifest(self._store, self._manifest)
        if self._manifest is not None:
            return self._manifest.manifest.mark
        data = self._whole(CLOSED_MARK_NAME)
        return None if data is None else mark_in(data[:MOST_BYTES], self.path)

    def removed(self) -> None:
        """Return none: nothing is removed from a store by a list of ours."""

    def bag_metadata(self) -> str | None:
        """Return the text of metadata.yaml; a manifest stands in its place, where there is one."""
        if self._manifest is not None:
            return None
        return (self._whole(BAG_METADATA_NAME) or b"").decode(errors="replace")

    def _whole(self, name: str) -> bytes | None:
        with suppress(FileNotFoundError):
            found = self._store.whole(name)
            return None if found is None else found[0]
        return None
