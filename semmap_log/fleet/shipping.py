"""Ship a log to a store: each closed segment once, named by its content, then a manifest of them.

Interrupted at any request, the store holds the log as it was there before, or as it is now; the
next run finds what is already there. Two shipments at once do not harm each other: one manifest
replaces the previous one, and the other shipment begins again.

The order (content first, then one pointer by compare-and-swap) is that of Delta Lake and Iceberg.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.progress import Progress
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.io.virtual_logs import check_not_virtual
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import LogAccessError, LogError
from semmap_log.log.transport import (
    MANIFEST_NAME,
    MOST_LIST_BYTES,
    KeptManifest,
    LogFolder,
    LogReader,
    Manifest,
    Segment,
    ShippedSegment,
    Superseded,
    end_of,
    head_before,
    manifest_entry,
    object_name,
    read_manifest,
)

_PART_BYTES = 2**23
"""Bytes of an object that are compared at once."""
_MOST_RIVALS = 20
"""Conflicting manifests of others before this shipment gives up."""


MOST_SUPERSEDED = 2000
"""So many are listed, each in 60 bytes of a manifest that readers fetch; older ones stay."""


@dataclass(slots=True)
class Shipped:
    """The result of a shipment."""

    url: UrlPath
    manifest: Manifest
    sent: int = 0
    """Segments that were sent."""
    sent_bytes: int = 0
    found: int = 0
    """Segments that were there already."""
    is_new: bool = False
    """Whether a new manifest was written; otherwise nothing had changed."""
    waits_events: int = 0
    """Events of the live segment, which is sent once it is closed."""


def ship(log: Path, place: UrlPath | ObjectStore, progress: Progress | None = None) -> Shipped:
    """Send a log's closed segments to a store, except those already there.

    The log may be written meanwhile. Its live segment waits until it is closed.

    Args:
        log: The log's folder.
        place: Where it is to lie: `s3://bucket/logs/tug1`.
        progress: Called with the number of bytes of the segments that are sent, or were there.

    Raises:
        LogError: Another log, or a fork of this one, lies there; or the store does not honour
            conditional writes; or no segment is closed yet.
        LogAccessError: The store, or the disk, denies access.
        CorruptLogError: The log, or its copy in the store, is damaged.
        MissingExtraError: A package for stores is not installed.
    """
    check_not_virtual(log)
    reader = LogReader(LogFolder(log))
    store = place if isinstance(place, ObjectStore) else ObjectStore(place)
    shipping = _Shipping(store, reader.segments, progress)
    for _ in range(_MOST_RIVALS):
        done = shipping.try_once()
        if done is not None:
            done.waits_events = waiting_events(reader.segments, done.manifest)
            return done
    raise LogError(
        f"{store.url}: its manifest changes faster than this log can be sent; see who ships there."
    )


@dataclass(slots=True)
class _Shipping:
    """One log on its way."""

    store: ObjectStore
    segments: Sequence[Segment]
    """All of it; the last may be live."""
    progress: Progress | None
    sent: int = 0
    sent_bytes: int = 0
    is_probed: bool = False
    there: dict[str, ShippedSegment] = field(default_factory=dict)
    """Segments that are known to be in the store, by their names on this disk."""
    generation: int = 0
    """Of the manifest that was read last."""

    def try_once(self) -> Shipped | None:
        """Send the missing segments; None: another shipment's manifest came first."""
        kept = read_manifest(self.store)
        if kept is not None:
            check_same_way(self.store.url, self.segments, kept.manifest)
            if is_ahead(kept.manifest, self.closed):
                return self._done(kept.manifest, len(self.closed), is_new=False)
            self._take_generation(kept.manifest.generation)
            self.there |= shipped_before(self.closed, kept.manifest)
        elif not self.closed:
            raise LogError(
                f"{self.segments[0].path.parent}: nothing to ship: its only segment is being "
                "written. It is closed when its writer ends."
            )
        entries = tuple(self._entry(segment) for segment in self.closed)
        found = max(0, len(entries) - self.sent)
        before = None if kept is None else kept.manifest
        if before is not None and before.segments == entries:
            return self._done(before, found, is_new=False)
        version = 1 if before is None else before.version + 1
        info, superseded = self.closed[0].header.info, superseded_by(entries, kept)
        manifest = Manifest(version, info, entries, superseded, self.generation)
        return self._done(manifest, found, is_new=True) if self._put(manifest, kept) else None

    def _done(self, manifest: Manifest, found: int, *, is_new: bool) -> Shipped:
        return Shipped(self.store.url, manifest, self.sent, self.sent_bytes, found, is_new)

    @property
    def closed(self) -> list[Segment]:
        """Those that can be sent."""
        return closed_ones(self.segments)

    def _take_generation(self, generation: int) -> None:
        """Forget the objects found, if another process removes objects: they may be among these."""
        if generation != self.generation:
            self.generation = generation
            self.there.clear()

    def _entry(self, segment: Segment) -> ShippedSegment:
        """Return a segment's entry, once it is in the store."""
        known = self.there.get(segment.path.name)
        if known is None:
            known = self.there[segment.path.name] = self._send(segment)
        if self.progress is not None:
            done = sum(one.size for one in self.there.values())
            self.progress(done, sum(each.size for each in self.closed))
        return known

    def _send(self, segment: Segment) -> ShippedSegment:
        """Put a segment into the store, if it is not there.

        Raises:
            LogError: The store does not honour conditional writes, or has another object there.
        """
        if not self.is_probed:
            check_conditions(self.store)
            self.is_probed = True
        data = segment.source.read(0, segment.size)  # once: a condition needs it in one request
        sha256 = hashlib.sha256(data).hexdigest()
        name = object_name(segment.header.number, sha256, self.generation)
        if self.store.create(name, data):
            self.sent += 1
            self.sent_bytes += len(data)
        elif not self._holds(name, segment.size, sha256):
            raise LogError(
                f"{self.store.url / name}: expected a copy of {segment.path.name}, got an object "
                "with other bytes. Remove it, and ship again."
            )
        return manifest_entry(segment, name, sha256)

    def _holds(self, name: str, size: int, sha256: str) -> bool:
        """Return whether the object in the store has these bytes, by reading it."""
        status = self.store.status(name)
        if status.size != size:
            return False
        digest = hashlib.sha256()
        for start in range(0, size, _PART_BYTES):
            digest.update(self.store.part(status, start, min(start + _PART_BYTES, size)))
        return digest.hexdigest() == sha256

    def _put(self, manifest: Manifest, before: KeptManifest | None) -> bool:
        data = manifest.text().encode()
        if len(data) > MOST_LIST_BYTES:
            where = self.store.url / MANIFEST_NAME
            raise LogError(
                f"{where}: expected at most {MOST_LIST_BYTES:,} bytes, got {len(data):,} for "
                f"{counted(len(manifest.segments), 'segment')}; nothing there is changed. "
                f"To make fewer of them: {command_line('compact', self.segments[0].path.parent)}"
            )
        if before is None:
            return self.store.create(MANIFEST_NAME, data)
        return self.store.replace(MANIFEST_NAME, data, before.e_tag)


def closed_ones(segments: Sequence[Segment]) -> list[Segment]:
    """Return those of a log's segments that can be sent."""
    return [segment for segment in segments if segment.closed]


def superseded_by(
    entries: Sequence[ShippedSegment], kept: KeptManifest | None
) -> tuple[Superseded, ...]:
    """Return the objects that earlier manifests named and a new one does not.

    Args:
        entries: The entries of the new one.
        kept: The previous one.
    """
    if kept is None:
        return ()
    named = {one.name for one in entries}
    dropped = tuple(Superseded(one.name, one.size, None) for one in kept.manifest.segments)
    found = tuple(one for one in (*since_when(kept), *dropped) if one.name not in named)
    return found[-MOST_SUPERSEDED:]


def since_when(kept: KeptManifest) -> tuple[Superseded, ...]:
    """Return the objects that a manifest no longer names, each with the time since when."""
    return tuple(
        replace(one, since_ns=kept.modified_ns) if one.since_ns is None else one
        for one in kept.manifest.superseded
    )


def is_ahead(there: Manifest, closed: Sequence[Segment]) -> bool:
    """Return whether the store holds more than is closed here: the last segment was reopened."""
    return not closed or end_of(closed[-1]) < there.mark.next_event


def waiting_events(segments: Sequence[Segment], there: Manifest) -> int:
    """Return how many events of the live segment wait until it is closed; 0: none is live."""
    live = segments[-1]
    first = max(live.header.first_event, there.mark.next_event)
    return 0 if live.closed else end_of(live) - first


def check_same_way(url: UrlPath, segments: Sequence[Segment], there: Manifest) -> None:
    """Check that what lies in a store is this log, at an earlier time.

    Args:
        url: Where, for messages.
        segments: All of this log, a live one included: a writer that reopens the log continues a
            small closed segment, and what was shipped of it is then in the live one.
        there: What lies there.

    Raises:
        LogError: It is another log, or has other commits.
    """
    ours = segments[0].header.info.log_id
    if there.info.log_id != ours:
        raise LogError(
            f"{url}: expected this log (id {ours}), got another one (id "
            f"{there.info.log_id}); ship this log elsewhere."
        )
    last = there.segments[-1]
    if head_before(segments, last.next_event) == last.head:
        return
    end = end_of(segments[-1])
    if end < last.next_event:
        problem = (
            f"its segments reach event {last.next_event - 1}, those here event "
            f"{end - 1}: this copy is older, or was put back"
        )
    else:
        problem = (
            f"its commit before event {last.next_event} is another: the log was continued on "
            "two machines"
        )
    fetch = command_line("fetch", url, "DIR")
    raise LogError(
        f"{url}: refused, and nothing there is changed: {problem}. To look at it: "
        f"{fetch}; to keep both: ship this one elsewhere."
    )


def shipped_before(closed: Sequence[Segment], there: Manifest) -> dict[str, ShippedSegment]:
    """Return the shipped segments by their names on this disk, without reading any."""
    shipped = {(one.header.number, one.header.last_number): one for one in there.segments}
    found = {}
    for segment in closed:
        one = shipped.get((segment.header.number, segment.header.last_number))
        if one is not None and _is_copy(one, segment):
            found[segment.path.name] = one
    return found


def _is_copy(one: ShippedSegment, segment: Segment) -> bool:
    """Return whether an object copies a segment: same content, with the same parts missing."""
    theirs = (one.size, one.head, one.header.trimmed)
    return theirs == (segment.size, segment.head, segment.header.trimmed)


def check_conditions(store: ObjectStore) -> None:
    """Check that a store honours conditional writes, which some silently ignore.

    It must refuse to create an object that exists, and to replace one that has changed.

    Raises:
        LogError: It overwrites it.
        LogAccessError: It denies writing.
    """
    name = f".probe-{secrets.token_hex(8)}"
    ignored = ""
    try:
        if not store.create(name, b"1"):
            ignored = "refuses to create what is not there"
        elif store.create(name, b"2"):
            ignored = "ignores the condition `If-None-Match: *`"
        elif store.replace(name, b"3", '"0123456789abcdef0123456789abcdef"'):
            ignored = "ignores the condition `If-Match`"
    finally:
        with suppress(LogAccessError, FileNotFoundError):
            store.remove(name)  # a robot needs no right to remove: a byte stays
    if ignored:
        raise LogError(
            f"{store.url}: this store {ignored}: two robots could write over each other there. "
            "Nothing was shipped."
        )
