"""A log brought back from a store: whole, compared with its manifest, and verified."""

from __future__ import annotations

import hashlib
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from semmap_log.errors import CorruptLogError, LogExistsError, NotALogError
from semmap_log.io.disk import sync_folder
from semmap_log.io.object_store import ObjectStatus, ObjectStore
from semmap_log.io.progress import Progress
from semmap_log.io.url_path import UrlPath
from semmap_log.replay.care import verify
from semmap_log.store.closed_mark import write_mark
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import segment_name
from semmap_log.store.log_objects import read_manifest
from semmap_log.store.manifest import MANIFEST_NAME, Manifest, ShippedSegment
from semmap_log.store.verification import Verification

PART_BYTES = 2**23
"""So much is in memory at once."""


@dataclass(frozen=True, slots=True)
class Fetched:
    """A log that was brought back."""

    manifest: Manifest
    bytes: int
    verified: Verification


def fetch(url: UrlPath, folder: Path, progress: Progress | None = None) -> Fetched:
    """Bring a shipped log to a disk; it has its name only once it is whole and verified.

    Args:
        url: Where it lies.
        folder: What is to be made; nothing may be there.
        progress: Told how many bytes have come.

    Raises:
        LogExistsError: There is something there.
        NotALogError: There is no shipped log at the URL.
        CorruptLogError: A segment is not what the manifest tells, or the log is not whole.
        LogAccessError: The store, or the disk, does not let us.
    """
    if folder.exists():
        raise LogExistsError(f"{folder}: exists; fetch into a new folder.")
    store = ObjectStore(url)
    kept = read_manifest(store)
    if kept is None:
        raise NotALogError(
            f"{url}: no {MANIFEST_NAME} there, so no log was shipped to it. What was copied there "
            "in another way can be read there, and copied back in that way."
        )
    manifest = kept.manifest
    part = folder.with_name(f"{folder.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    try:
        total = sum(segment.size for segment in manifest.segments)
        done = 0
        for segment in manifest.segments:
            target = part / segment_name(folder.name, segment.header.number)
            done = _bring(store, segment, target, (done, total), progress)
        write_mark(LogFolder(part), manifest.mark)
        verified = verify(part)
        _check_whole(url, verified)
        part.rename(folder)
        sync_folder(folder.parent)
    except BaseException:
        with suppress(OSError):
            shutil.rmtree(part)
        raise
    return Fetched(manifest, total, verified.moved(part, folder))


def _check_whole(url: UrlPath, verified: Verification) -> None:
    """Check that what came is a good log.

    Raises:
        CorruptLogError: It is not.
    """
    if verified.exit_code:
        first = next((finding.text for finding in verified.findings), "not whole")
        raise CorruptLogError(url, None, f"what came is no whole log: {first}")


def _bring(
    store: ObjectStore, segment: ShippedSegment, target: Path, done: tuple[int, int],
    progress: Progress | None,
) -> int:  # fmt: skip
    """Write a segment's bytes into a file, and return how many have come in all.

    Raises:
        CorruptLogError: They are not what the manifest tells.
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
                raise CorruptLogError(where, None, "the manifest names it; it is gone") from None
            digest.update(data)
            file.write(data)
            come += len(data)
            if progress is not None:
                progress(come, total)
    if digest.hexdigest() != segment.sha256:
        where = store.url / segment.name
        raise CorruptLogError(where, None, "it is not what was shipped (SHA-256)")
    return come
