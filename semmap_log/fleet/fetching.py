"""A log brought back from a store: whole, compared with its manifest, and verified."""

from __future__ import annotations

import hashlib
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from semmap_log import errors
from semmap_log.core.io.disk import atomic_folder
from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.io.progress import Progress
from semmap_log.core.io.url_path import UrlPath
from semmap_log.log import Verification, verify
from semmap_log.log.transport import (
    MANIFEST_NAME,
    LogFolder,
    LogReader,
    Manifest,
    ShippedSegment,
    read_manifest,
    segment_name,
    statistics_of,
    write_bag_metadata,
    write_mark,
)

PART_BYTES = 2**23
"""Bytes in memory at once."""


@dataclass(frozen=True, slots=True)
class Fetched:
    """A downloaded log."""

    manifest: Manifest
    bytes: int
    verified: Verification


def fetch(url: UrlPath, folder: Path, progress: Progress | None = None) -> Fetched:
    """Download a shipped log; it gets its name only once it is complete and verified.

    Args:
        url: Where the log lies.
        folder: The folder to create; nothing may be there.
        progress: Called with the number of bytes received.

    Raises:
        LogExistsError: The folder exists already.
        NotALogError: There is no shipped log at the URL.
        CorruptLogError: A segment differs from the manifest, or the log is incomplete.
        LogAccessError: The store denies access.
        OutputError: The disk cannot be written.
    """
    if os.path.lexists(folder):
        raise errors.LogExistsError(f"{folder}: exists; fetch into a new folder.")
    store = ObjectStore(url)
    kept = read_manifest(store)
    if kept is None:
        raise errors.NotALogError(
            f"{url}: no {MANIFEST_NAME} there, so no log was shipped to it. You can read a log "
            "that was copied there by other means, and copy it back by those."
        )
    manifest = kept.manifest
    total = sum(segment.size for segment in manifest.segments)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        _check_room(url, folder, total)
        with atomic_folder(folder) as part:
            part.mkdir()
            done = 0
            for segment in manifest.segments:
                target = part / segment_name(folder.name, segment.header.number)
                done = _bring(store, segment, target, (done, total), progress)
            _write_lists(LogFolder(part), manifest)
            verified = verify(part)
            _check_whole(url, verified)
    except errors.SemmapError:
        raise  # the store's errors are OSErrors, too
    except OSError as error:
        said = error.strerror or error
        raise errors.OutputError(
            f"{folder}: could not be written: {said}. Nothing is left."
        ) from error
    return Fetched(manifest, total, verified.moved(part, folder))


def _check_room(url: UrlPath, folder: Path, size: int) -> None:
    """Check that the disk has room for a log of this size.

    Raises:
        OutputError: It cannot.
    """
    free = shutil.disk_usage(folder.parent).free
    if size > free:
        raise errors.OutputError(
            f"{folder}: expected room for {size:,} bytes, as the manifest of {url} claims, got "
            f"{free:,} free; nothing was fetched."
        )


def _write_lists(folder: LogFolder, manifest: Manifest) -> None:
    """Write the files next to a log's segments: its mark, and metadata.yaml for other tools."""
    write_mark(folder, manifest.mark)
    write_bag_metadata(folder, map(statistics_of, LogReader(folder).segments))


def _check_whole(url: UrlPath, verified: Verification) -> None:
    """Check that the downloaded log is undamaged.

    Raises:
        CorruptLogError: It is not.
    """
    if verified.exit_code:
        first = next((finding.text for finding in verified.findings), "not whole")
        raise errors.CorruptLogError(url, None, f"what came is no whole log: {first}")


def _bring(
    store: ObjectStore, segment: ShippedSegment, target: Path, done: tuple[int, int],
    progress: Progress | None,
) -> int:  # fmt: skip
    """Write a segment's bytes into a file, and return the total number of bytes received.

    Raises:
        CorruptLogError: They differ from the manifest.
    """
    status = ObjectStatus(segment.name, segment.size, "")
    come, total = done
    digest = hashlib.sha256()
    with target.open("xb") as file:
        for start in range(0, segment.size, PART_BYTES):
            try:
                data = store.part(status, start, min(start + PART_BYTES, segment.size))
            except FileNotFoundError:
                where = store.url / segment.name
                raise errors.CorruptLogError(
                    where, None, "the manifest names it; it is gone"
                ) from None
            digest.update(data)
            file.write(data)
            come += len(data)
            if progress is not None:
                progress(come, total)
    if digest.hexdigest() != segment.sha256:
        where = store.url / segment.name
        raise errors.CorruptLogError(where, None, "it is not what was shipped (SHA-256)")
    return come
