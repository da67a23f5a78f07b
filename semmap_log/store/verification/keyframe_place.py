"""How a verification checks keyframes: with a check that knows the state in them.

Also the files that a verification reads from a store: every byte, none of it believed; and a log of
which a part was removed from the disk, read whole, with that part in the store.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import Protocol

from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.errors import LogAccessError, LogError, ObjectChangedError
from semmap_log.store import closed_mark
from semmap_log.store.byte_layout import MANIFEST_NAME, MOST_LIST_BYTES, mark_names
from semmap_log.store.folder import LogFolder
from semmap_log.store.manifest import (
    KeptManifest,
    ShippedSegment,
    differences,
    log_objects,
    objects_named,
    read_manifest,
)
from semmap_log.store.removed_part import RemovedSegment, read_removed_part
from semmap_log.store.verification.file_place import WINDOW_BYTES, DiskPlace, OpenedFile, Vanished
from semmap_log.store.verification.hash_chain import Report
from semmap_log.store.verification.pieces import Piece


@dataclass(frozen=True, slots=True)
class KeyframePlace:
    """A chunk: the number of its segment's file in the walk, and its offset there."""

    file: int
    offset: int


Reread = Callable[[KeyframePlace], Iterator[Piece]]
"""Yields the chunks of the log from a place on."""


class KeyframeCheck(Protocol):
    """Takes all chunks of a log, and compares each keyframe with what the events say."""

    @property
    def compared(self) -> int:
        """How many keyframes were compared, and right."""

    def begin(self) -> None:
        """Begin at the log's first event, where the state is empty."""

    def forget(self) -> None:
        """Events are missing: no state is known until the next keyframe."""

    def give_up(self) -> None:
        """Stop comparing: events of unknown kinds may have changed the state."""

    def add(self, path: PurePath, piece: Piece, place: KeyframePlace, next_event: int) -> None:
        """Take the next chunk; `next_event` is its first event, or the next one after it."""

    def finish(self) -> None:
        """Read the events that wait: their payloads must be what their channels carry."""


NewKeyframeCheck = Callable[[Report, Reread], KeyframeCheck]
"""Makes the check of one reading: what is wrong is reported, and chunks are had once more."""


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
        """Return whether it is a folder now."""
        return self._disk.is_folder()

    def mark(self) -> closed_mark.ClosedMark | None:
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


WHOLE_BYTES = 2**23
"""An object of so many bytes comes by one request: some servers know no ranges."""


class ObjectFile:
    """An `OpenedFile`: an object as it was when it was listed."""

    is_regular = True

    def __init__(self, store: ObjectStore, status: ObjectStatus) -> None:
        self._store = store
        self._status = status
        self.size = status.size
        self.identity: Hashable = (status.name, status.e_tag)
        self._whole: bytes | None = None
        self._digest = hashlib.sha256()
        self._hashed = 0
        """So many of its first bytes are in the digest."""

    def read_into(self, target: memoryview, at: int) -> int:
        """Fetch the requested bytes; as `OpenedFile.read_into`.

        Raises:
            Vanished: The object is gone, or another has its name.
            LogError: The store does not return them: that is no bad sector, which would be skipped.
        """
        end = min(at + len(target), self.size)
        if at >= end:
            return 0
        try:
            data = self._part(at, end)
        except (FileNotFoundError, ObjectChangedError):
            raise Vanished from None
        except LogAccessError as error:
            raise LogError(str(error)) from None
        target[: len(data)] = data
        if at <= self._hashed < end:
            self._digest.update(data[self._hashed - at :])
            self._hashed = end
        return len(data)

    def _part(self, start: int, end: int) -> bytes:
        if self.size > WHOLE_BYTES:
            return self._store.part(self._status, start, end)
        if self._whole is None:
            self._whole = self._store.part(self._status, 0, self.size)
        return self._whole[start:end]

    @property
    def is_hashed(self) -> bool:
        """Whether all of it was read."""
        return self._hashed == self.size

    def sha256(self) -> str:
        """Return the SHA-256 of all its bytes, including those that were not requested.

        Raises:
            Vanished: As `read_into`.
            LogError: As `read_into`.
        """
        while self._hashed < self.size:
            self.read_into(
                memoryview(bytearray(min(WINDOW_BYTES, self.size - self._hashed))), self._hashed
            )
        return self._digest.hexdigest()


class ObjectFiles:
    """The objects below a URL, opened; for those that were read whole the SHA-256 is known."""

    def __init__(self, store: ObjectStore) -> None:
        self._store = store
        self._hashes: dict[ObjectStatus, str] = {}

    @contextmanager
    def opened(self, status: ObjectStatus) -> Iterator[ObjectFile]:
        """Open an object as it was listed."""
        file = ObjectFile(self._store, status)
        yield file
        if file.is_hashed:
            self._hashes[status] = file.sha256()

    def sha256(self, status: ObjectStatus) -> str:
        """Return that of all bytes of an object.

        Raises:
            Vanished: It is gone, or another has its name.
            LogError: The store does not give it.
        """
        return self._hashes.get(status) or ObjectFile(self._store, status).sha256()


class ObjectPlace:
    """A `FilePlace`: the objects below a URL."""

    def __init__(self, store: ObjectStore) -> None:
        self._store = store
        self._listed: dict[str, ObjectStatus] = {}
        self._manifest: KeptManifest | None = None
        self._files = ObjectFiles(store)

    @property
    def path(self) -> UrlPath:
        """The URL."""
        return self._store.url

    def is_folder(self) -> bool:
        """Return whether anything exists below the URL."""
        return bool(self.files())

    def files(self) -> list[PurePath]:
        """Return all objects there now; where a manifest is, those that it names."""
        self._manifest = read_manifest(self._store, self._manifest)
        if self._manifest is None:
            listed = log_objects(self._store)
        else:
            named = [one.name for one in self._manifest.manifest.segments]
            listed = objects_named(self._store, named)
        self._listed = {status.name: status for status in listed}
        return [self.path / name for name in self._listed]

    def flaws(self) -> list[tuple[PurePath, str]]:
        """Return the segments that are gone, or longer or shorter than the manifest states."""
        found: list[tuple[PurePath, str]] = []
        for one in self._manifest.manifest.segments if self._manifest is not None else ():
            status = self._listed.get(one.name)
            if status is None:
                found.append((self.path / one.name, f"{MANIFEST_NAME} names it; it is gone"))
            elif status.size != one.size:
                text = f"expected {one.size} bytes by {MANIFEST_NAME}, got {status.size}"
                found.append((self.path / one.name, text))
        return found

    def differences(self, found: Sequence[ShippedSegment]) -> list[tuple[PurePath, str]]:
        """Return where the segments differ from the manifest: in every field."""
        stated = () if self._manifest is None else self._manifest.manifest.segments
        told = {one.name: one for one in stated}
        return [
            (self.path / one.name, f"{MANIFEST_NAME}: {text}")
            for one in found
            if one.name in told
            for text in differences(told[one.name], self._with_sha256(one))
        ]

    def _with_sha256(self, one: ShippedSegment) -> ShippedSegment:
        return replace(one, sha256=self._files.sha256(self._listed[one.name]))

    @contextmanager
    def opened(self, file: PurePath) -> Iterator[ObjectFile]:
        """Open an object as it was listed; as `FilePlace.opened`."""
        status = self._listed.get(file.name) or self._store.status(file.name)
        with self._files.opened(status) as opened:
            yield opened

    def mark(self) -> closed_mark.ClosedMark | None:
        """Return what the last mark says; as `FilePlace.mark`."""
        self._manifest = read_manifest(self._store, self._manifest)
        if self._manifest is not None:
            return self._manifest.manifest.mark
        names = mark_names(status.name for status in log_objects(self._store))
        return closed_mark.last_mark(closed_mark.those_that_count(names), self._read_mark)

    def _read_mark(self, name: str) -> closed_mark.ClosedMark | None:
        data = self._whole(name, closed_mark.MOST_BYTES)
        return None if data is None else closed_mark.mark_in(data, self.path / name)

    def removed(self) -> None:
        """Return none: nothing is removed from a store by a list of ours."""

    def bag_metadata(self) -> str | None:
        """Return the text of metadata.yaml; a manifest stands in its place, where there is one."""
        if self._manifest is not None:
            return None
        text = self._whole(BAG_METADATA_NAME, MOST_LIST_BYTES) or b""
        return text.decode(errors="replace")

    def _whole(self, name: str, most_bytes: int) -> bytes | None:
        with suppress(FileNotFoundError):
            found = self._store.whole(name, most_bytes=most_bytes)
            return None if found is None else found[0]
        return None
