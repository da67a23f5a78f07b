"""shipped.json: which segments of a log are only in a store, since they were removed from the disk.

It is written, and synced, before the first of them is removed. A segment whose file exists is read
from it, whatever this list says: so a removal may be interrupted anywhere, and a segment that was
copied back counts. What a question about all of a log needs of a removed segment (its index, its
commands, its retractions) is kept in a small file next to it.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.store.byte_layout import KEPT_SUFFIX, MOST_LIST_BYTES, REMOVED_NAME
from semmap_log.store.closed_mark import sealed, unsealed
from semmap_log.store.folder import LogFolder

if TYPE_CHECKING:
    from semmap_log.store.manifest import Manifest, ShippedSegment

WITH_VARIABLE = "SEMMAP_LOG_WITH"
"""Names the URL at which segments are read that were removed from the disk."""
_FORMAT = 1
_PLACES_BYTES = 2**20


@dataclass(frozen=True, slots=True)
class RemovedSegment:
    """A segment whose file was removed."""

    file: str
    """Its name on this disk."""
    shipped: ShippedSegment
    kept_sha256: str
    """Of the file that keeps a part of it, in hexadecimal digits."""

    @property
    def kept_name(self) -> str:
        """Name of that file."""
        return kept_name(self.file)

    @property
    def most_kept_bytes(self) -> int:
        """More than that file has, packed or not: at most its segment, and where its parts lie."""
        return 2 * self.shipped.size + _PLACES_BYTES


@dataclass(frozen=True, slots=True)
class RemovedPart:
    """The beginning of a log, which lies in a store."""

    url: UrlPath
    manifest: Manifest
    """Of these segments alone."""
    files: tuple[tuple[str, str], ...]
    """Of each its name on this disk, and the SHA-256 of what is kept of it."""

    @property
    def segments(self) -> tuple[RemovedSegment, ...]:
        """Its segments, in order."""
        return tuple(
            RemovedSegment(file, shipped, kept)
            for (file, kept), shipped in zip(self.files, self.manifest.segments, strict=True)
        )

    def text(self) -> str:
        """Return the file's text."""
        entries = {
            "format": _FORMAT,
            "url": str(self.url),
            "files": [list(pair) for pair in self.files],
            "manifest": json.loads(self.manifest.text()),
        }
        return sealed(entries)


def kept_name(file: str) -> str:
    """Return the name of the file that keeps a part of a removed segment."""
    return file.removesuffix(".mcap") + KEPT_SUFFIX


def read_removed_part(folder: LogFolder) -> RemovedPart | None:
    """Return which segments of a log were removed; None: none was.

    Raises:
        CorruptLogError: What says so is not what was written.
    """
    from semmap_log.store.manifest import manifest_in

    try:
        data = folder.read_bytes(REMOVED_NAME, MOST_LIST_BYTES)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        problem = f"it cannot be read: {error.strerror or error}"
        raise CorruptLogError(folder / REMOVED_NAME, None, problem) from error
    try:
        entries = unsealed(json.loads(data))
        if entries["format"] != _FORMAT:
            raise ValueError(f"format {entries['format']!r}, expected {_FORMAT}")  # noqa: TRY301
        url = place_of(entries["url"])
        text = json.dumps(entries["manifest"]).encode()
        manifest = manifest_in(text, folder / REMOVED_NAME)
        files = tuple((str(file), str(kept)) for file, kept in entries["files"])
        if not isinstance(url, UrlPath) or len(files) != len(manifest.segments):
            raise ValueError("it names no URL, or not all files")  # noqa: TRY301
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, LogError) as error:
        problem = f"it is not what was written ({error})"
        raise CorruptLogError(folder / REMOVED_NAME, None, problem) from None
    return RemovedPart(url, manifest, files)


def write_removed_part(folder: LogFolder, part: RemovedPart) -> None:
    """Put the list in place of the one before; it survives a power cut.

    Raises:
        OSError: As the system says.
    """
    folder.write_atomic(REMOVED_NAME, [part.text().encode()])


def rest_of_environment() -> UrlPath | None:
    """Return where the environment says that removed segments are read."""
    named = os.environ.get(WITH_VARIABLE)
    place = place_of(named) if named else None
    return place if isinstance(place, UrlPath) else None
