"""Old segments removed from a robot's disk, once they were shipped and read back.

At every instant the folder holds the log: what is kept of a segment is written and synced, then
the list of removed segments, then the files go. Stopped anywhere, what is there is read, and the
next removal goes on. Nobody may write meanwhile: a writer looks after its files.

What a shipping would do, and how the log lies in the store: nothing is sent.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from semmap_log.core.io.byte_source import BLOCK_BYTES, blocks
from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.io.progress import Progress
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import CorruptLogError, LogAccessError, LogError
from semmap_log.fleet import shipping
from semmap_log.log.transport import (
    LogFolder,
    LogReader,
    Manifest,
    RemovedPart,
    Segment,
    ShippedSegment,
    WriterLock,
    end_of,
    is_object_name,
    kept_bytes,
    kept_name,
    object_name,
    read_manifest,
    read_removed_part,
    statistics_of,
    write_bag_metadata,
    write_removed_part,
)

_READ_BYTES = 8 * BLOCK_BYTES


@dataclass(frozen=True, slots=True)
class RemovedHere:
    """What was removed from a disk."""

    segments: int
    bytes: int
    """Bytes freed, after what is kept of the segments."""


def remove_shipped(
    log: Path, store: ObjectStore, before_ns: int, progress: Progress | None = None
) -> RemovedHere:
    """Remove the first segments of a log, if they were shipped and nothing in them is younger.

    The last closed segment and the live one stay. Each object is read back whole, and compared
    with the file, before anything is removed.

    Args:
        log: The log's folder.
        store: Where it was shipped to.
        before_ns: Remove only segments whose events were all recorded before, nanoseconds UTC.
        progress: Called with the number of bytes read back.

    Raises:
        LogLockedError: Somebody is writing.
        LogError: Another log lies there, or other segments lie at another URL.
        CorruptLogError: An object differs from what was shipped; then nothing is removed.
        LogAccessError: The store, or the disk, denies access.
    """
    folder = LogFolder.held(log)
    part = read_removed_part(folder)
    if part is not None and part.url != store.url:
        raise LogError(
            f"{log}: its removed segments lie at {part.url}; expected that, got {store.url}."
        )
    old = _old(folder, store, before_ns)
    _read_back(store, old, progress)
    lock = WriterLock(folder)
    try:
        _check_unchanged(folder, old)
        return _remove(folder, store, part, old)
    except LogAccessError:
        raise
    except OSError as error:
        problem = f"{log}: could not be removed: {error.strerror or error}. The log is whole."
        raise LogAccessError(problem) from error
    finally:
        lock.release()


def shipped_to(log: Path) -> UrlPath | None:
    """Return where the segments are that were removed from a log's folder; None: none were."""
    part = read_removed_part(LogFolder(log))
    return None if part is None else part.url


def _old(
    folder: LogFolder, store: ObjectStore, before_ns: int
) -> list[tuple[Segment, ShippedSegment]]:
    """Return the segments to remove, each as it was shipped.

    Raises:
        LogError: No log, or another one, was shipped there.
    """
    segments = LogReader(folder).segments
    kept = read_manifest(store)
    if kept is None:
        raise LogError(f"{store.url}: no log lies there; nothing was removed.")
    shipping.check_same_way(store.url, segments, kept.manifest)
    closed = [segment for segment in segments if segment.closed][:-1]
    shipped = shipping.shipped_before(closed, kept.manifest)
    first = takewhile(lambda s: s.recorded[1] < before_ns and s.path.name in shipped, closed)
    return [(s, shipped[s.path.name]) for s in first if s.told is None]


def _read_back(
    store: ObjectStore,
    old: Sequence[tuple[Segment, ShippedSegment]],
    progress: Progress | None,
) -> None:
    """Compare every byte that lies in a store with the disk's.

    Raises:
        CorruptLogError: Some differ, or an object is gone.
    """
    done, total = 0, sum(segment.size for segment, _ in old)
    for segment, shipped in old:
        there, here = hashlib.sha256(), hashlib.sha256()
        status = ObjectStatus(shipped.name, shipped.size, "")
        for start in range(0, segment.size, _READ_BYTES):
            try:
                data = store.part(status, start, min(start + _READ_BYTES, segment.size))
            except FileNotFoundError:
                where = store.url / shipped.name
                raise CorruptLogError(where, None, "the manifest names it; it is gone") from None
            there.update(data)
            done += len(data)
            if progress is not None:
                progress(done, total)
        for block in blocks(segment.source, 0, segment.size):
            here.update(block)
        if {there.hexdigest(), here.hexdigest()} != {shipped.sha256}:
            where = store.url / shipped.name
            raise CorruptLogError(
                where, None, f"it is not what {segment.path} is; nothing was removed"
            )


def _check_unchanged(folder: LogFolder, old: Sequence[tuple[Segment, ShippedSegment]]) -> None:
    """Check, under the lock, that the files are still those that were compared.

    Raises:
        LogError: One was compacted, or removed, meanwhile.
    """
    for segment, _ in old:
        if not folder.has(segment.path.name) or (
            folder.identity(segment.path.name) != segment.source.identity
        ):
            raise LogError(f"{segment.path}: changed meanwhile; nothing was removed; try again.")


def _remove(
    folder: LogFolder,
    store: ObjectStore,
    part: RemovedPart | None,
    old: Sequence[tuple[Segment, ShippedSegment]],
) -> RemovedHere:
    """Write the kept parts, then the list, then remove the files.

    Raises:
        OSError: As the system says; the folder holds the log.
    """
    folder.remove_stale_files()
    if not old:
        return RemovedHere(0, 0)
    files = (
        {} if part is None else {one.file: (one.kept_sha256, one.shipped) for one in part.segments}
    )
    kept = 0
    for segment, shipped in old:
        data = kept_bytes(segment, shipped)
        folder.write_atomic(kept_name(segment.path.name), [data])
        files[segment.path.name] = hashlib.sha256(data).hexdigest(), shipped
        kept += len(data)
    in_order = sorted(files.items(), key=lambda item: item[1][1].header.number)
    shipped_ones = tuple(shipped for _, (_, shipped) in in_order)
    manifest = Manifest(1, shipped_ones[0].header.info, shipped_ones)
    pairs = tuple((file, digest) for file, (digest, _) in in_order)
    write_removed_part(folder, RemovedPart(store.url, manifest, pairs))
    gone = {segment.path.name for segment, _ in old}
    stay = [s for s in LogReader(folder).segments if s.closed and s.told is None]
    write_bag_metadata(folder, [statistics_of(s) for s in stay if s.path.name not in gone])
    for segment, _ in old:
        folder.remove(segment.path.name)
    folder.sync()
    return RemovedHere(len(old), sum(segment.size for segment, _ in old) - kept)


@dataclass(frozen=True, slots=True)
class ObjectCount:
    """Some objects of a store, or files to be sent."""

    number: int = 0
    bytes: int = 0

    @classmethod
    def of(cls, sizes: Sequence[int]) -> ObjectCount:
        """Return the count of objects of these sizes."""
        return cls(len(sizes), sum(sizes))


@dataclass(frozen=True, slots=True)
class ShippingCheck:
    """How a log lies in a store."""

    url: UrlPath
    manifest: Manifest | None
    """The manifest in the store; None: nothing was shipped yet."""
    to_send: ObjectCount
    """Closed segments that a shipment would send."""
    is_list_old: bool
    """Whether a shipment would write a new manifest, though perhaps no segment."""
    waits_events: int
    """Events of the live segment, which is sent once it is closed."""
    is_probed: bool
    """Whether the store was checked to honour conditions: only if there is something to send."""
    superseded: ObjectCount | None
    """Segments that lie there and that the manifest does not name; None: listing is impossible."""
    problems: tuple[str, ...]
    """Objects that the manifest names and that are missing, or have another size."""

    @property
    def exit_code(self) -> int:
        """0: every closed segment lies there; 1: some are to be sent; 4: something is gone."""
        if self.problems:
            return 4
        return 1 if self.to_send.number or self.is_list_old else 0


def check_shipping(log: Path, place: UrlPath | ObjectStore) -> ShippingCheck:
    """Return what a shipment of a log would send, and whether what was shipped is still there.

    Nothing is sent. If there is something to send, the check includes whether the store honours
    conditional writes, as a shipment does first: a byte is put twice, and removed.

    Args:
        log: The log's folder.
        place: Where it lies, or is to lie.

    Raises:
        LogError: Another log, or a fork of this one, lies there; or the store does not honour
            conditional writes.
        LogAccessError: The store, or the disk, denies access.
        CorruptLogError: The log, or the manifest there, is damaged.
        MissingExtraError: A package for stores is not installed.
    """
    segments = LogReader(LogFolder(log)).segments
    closed = shipping.closed_ones(segments)
    store = place if isinstance(place, ObjectStore) else ObjectStore(place)
    kept = read_manifest(store)
    there = None if kept is None else kept.manifest
    if there is not None:
        shipping.check_same_way(store.url, segments, there)
    missing = _missing(closed, there)
    found = _listed(store)
    sent = {} if found is None else _sent_unnamed(missing, found, there)
    to_send = [one.size for one in missing if one.path.name not in sent]
    if to_send:
        shipping.check_conditions(store)
    return ShippingCheck(
        store.url,
        there,
        ObjectCount.of(to_send),
        _is_list_old(closed, there),
        0 if segments[-1].closed else _waiting(segments, there),
        bool(to_send),
        None if found is None else _superseded(found, there, set(sent.values())),
        () if found is None or there is None else _not_as_named(store.url, found, there.segments),
    )


def _missing(closed: Sequence[Segment], there: Manifest | None) -> list[Segment]:
    """Return the closed segments that no manifest names."""
    if there is None:
        return list(closed)
    if shipping.is_ahead(there, closed):
        return []
    shipped = shipping.shipped_before(closed, there)
    return [segment for segment in closed if segment.path.name not in shipped]


def _is_list_old(closed: Sequence[Segment], there: Manifest | None) -> bool:
    if there is None:
        return bool(closed)
    if shipping.is_ahead(there, closed):
        return False
    named = [(one.header.number, one.size, one.head) for one in there.segments]
    return named != [(one.header.number, one.size, one.head) for one in closed]


def _waiting(segments: Sequence[Segment], there: Manifest | None) -> int:
    if there is not None:
        return shipping.waiting_events(segments, there)
    return end_of(segments[-1]) - segments[-1].header.first_event


def _listed(store: ObjectStore) -> dict[str, int] | None:
    """Return the objects in the store and their sizes; None: listing is not permitted."""
    try:
        return {status.name: status.size for status in store.list()}
    except LogAccessError:
        return None


def _sent_unnamed(
    missing: Sequence[Segment], found: dict[str, int], there: Manifest | None
) -> dict[str, str]:
    """Return segments in the store that no manifest names, after an interrupted shipment."""
    generation, named = 0 if there is None else there.generation, {}
    for segment in missing:
        digest = hashlib.sha256()
        for block in blocks(segment.source, 0, segment.size):
            digest.update(block)
        name = object_name(segment.header.number, digest.hexdigest(), generation)
        if found.get(name) == segment.size:
            named[segment.path.name] = name
    return named


def _superseded(found: dict[str, int], there: Manifest | None, others: set[str]) -> ObjectCount:
    known = others if there is None else others | {one.name for one in there.segments}
    return ObjectCount.of(
        [size for name, size in found.items() if is_object_name(name) and name not in known]
    )


def _not_as_named(
    url: UrlPath, found: dict[str, int], named: Sequence[ShippedSegment]
) -> tuple[str, ...]:
    """Return what is wrong with the objects that a manifest names."""
    problems = []
    for one in named:
        size = found.get(one.name)
        if size is None:
            problems.append(f"{url / one.name}: the manifest names it; it is gone")
        elif size != one.size:
            problems.append(f"{url / one.name}: expected {one.size:,} bytes, got {size:,}")
    return tuple(problems)
