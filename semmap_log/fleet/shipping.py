"""A log sent to a store: closed segments once, named by their content, then a manifest of them.

Stopped at any request, the store holds the log as it was there before, or as it is now; begun
again, what is there is found. Two that ship at once do not harm each other: of two manifests one
takes the place of the one before, and the other begins anew.

The order (content first, then one pointer by compare-and-swap) is that of Delta Lake and Iceberg.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from semmap_log.common.texts import command_line
from semmap_log.errors import LogAccessError, LogError
from semmap_log.io.byte_source import blocks
from semmap_log.io.made_logs import refuse_made
from semmap_log.io.object_store import ObjectStore
from semmap_log.io.progress import Progress
from semmap_log.io.url_path import UrlPath
from semmap_log.store.folder import LogFolder
from semmap_log.store.log_objects import KeptManifest, read_manifest
from semmap_log.store.manifest import MANIFEST_NAME, Manifest, ShippedSegment
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of, head_before
from semmap_log.store.reading.segment_scan import Segment

_HASH_DIGITS = 16
"""Of a segment's SHA-256 in its object's name."""
_MOST_RIVALS = 20
"""Manifests of others that came in between, before this one gives up."""


@dataclass(slots=True)
class Shipped:
    """What a shipping has done."""

    url: UrlPath
    manifest: Manifest
    sent: int = 0
    """Segments that were sent."""
    sent_bytes: int = 0
    found: int = 0
    """Segments that were there already."""
    is_new: bool = False
    """Whether a new manifest was written; else there was nothing to say."""
    waits_events: int = 0
    """Events of the live segment, which is sent once it is closed."""


def ship(log: Path, place: UrlPath | ObjectStore, progress: Progress | None = None) -> Shipped:
    """Send a log's closed segments to a store; what is there already is not sent again.

    The log may be written meanwhile. Its live segment waits until it is closed.

    Args:
        log: The log's folder.
        place: Where it is to lie: `s3://bucket/logs/tug1`.
        progress: Told how many bytes of the segments are sent, or were there.

    Raises:
        LogError: Another log lies there; or one that has gone another way since; or the store does
            not honour conditional writes; or no segment is closed yet.
        LogAccessError: The store, or the disk, does not let us.
        CorruptLogError: The log, or what lies there, is damaged.
        MissingExtraError: A package for stores is not installed.
    """
    refuse_made(log)
    reader = LogReader(LogFolder(log))
    closed = [segment for segment in reader.segments if segment.closed]
    if not closed:
        raise LogError(
            f"{log}: nothing to ship: its only segment is being written. It is closed when its "
            "writer ends."
        )
    store = place if isinstance(place, ObjectStore) else ObjectStore(place)
    shipping = _Shipping(store, closed, progress)
    for _ in range(_MOST_RIVALS):
        done = shipping.try_once()
        if done is not None:
            live = reader.segments[-1]
            done.waits_events = 0 if live.closed else end_of(live) - live.header.first_event
            return done
    raise LogError(
        f"{store.url}: its manifest changes faster than this log can be sent; see who ships there."
    )


@dataclass(slots=True)
class _Shipping:
    """One log on its way."""

    store: ObjectStore
    closed: Sequence[Segment]
    progress: Progress | None
    sent: int = 0
    sent_bytes: int = 0
    is_probed: bool = False
    there: dict[str, ShippedSegment] = field(default_factory=dict)
    """Segments that are known to lie in the store, by what they are called on this disk."""

    def try_once(self) -> Shipped | None:
        """Send what is missing; None: somebody else's manifest came in between."""
        kept = read_manifest(self.store)
        if kept is not None:
            self._check_same_way(kept.manifest)
            self._find(kept.manifest)
        entries = tuple(self._entry(segment) for segment in self.closed)
        found = len(entries) - self.sent
        before = None if kept is None else kept.manifest
        if before is not None and before.segments == entries:
            return self._done(before, found, is_new=False)
        version = 1 if before is None else before.version + 1
        manifest = Manifest(version, self.closed[0].header.info, entries)
        return self._done(manifest, found, is_new=True) if self._put(manifest, kept) else None

    def _done(self, manifest: Manifest, found: int, *, is_new: bool) -> Shipped:
        return Shipped(self.store.url, manifest, self.sent, self.sent_bytes, found, is_new)

    def _check_same_way(self, there: Manifest) -> None:
        """Check that what lies there is this log, at an earlier time.

        Raises:
            LogError: It is another log, or has other commits.
        """
        ours = self.closed[0].header.info.log_id
        if there.info.log_id != ours:
            raise LogError(
                f"{self.store.url}: another log lies there (id {there.info.log_id}, this one's is "
                f"{ours}); ship this one elsewhere."
            )
        last = there.segments[-1]
        if head_before(self.closed, last.next_event) == last.head:
            return
        end = end_of(self.closed[-1])
        if end < last.next_event:
            problem = (
                f"its segments reach event {last.next_event - 1}, the closed ones here event "
                f"{end - 1}: this copy is older, or was put back"
            )
        else:
            problem = (
                f"its commit before event {last.next_event} is another: the log was continued on "
                "two machines"
            )
        fetch = command_line("fetch", self.store.url, "DIR")
        raise LogError(
            f"{self.store.url}: refused, and nothing there is changed: {problem}. To look at it: "
            f"{fetch}; to keep both: ship this one elsewhere."
        )

    def _find(self, there: Manifest) -> None:
        """Take note of the segments that were shipped before, so that nobody reads them again."""
        shipped = {(one.header.number, one.header.last_number): one for one in there.segments}
        for segment in self.closed:
            one = shipped.get((segment.header.number, segment.header.last_number))
            if one is not None and (one.size, one.head) == (segment.size, segment.head):
                self.there[segment.path.name] = one

    def _entry(self, segment: Segment) -> ShippedSegment:
        """Return a segment's entry, once it lies there."""
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
        data = b"".join(blocks(segment.source, 0, segment.size))
        sha256 = hashlib.sha256(data).hexdigest()
        name = f"{segment.header.number:06d}-{sha256[:_HASH_DIGITS]}.mcap"
        if self.store.create(name, data):
            self.sent += 1
            self.sent_bytes += len(data)
        elif self.store.status(name).size != len(data):
            raise LogError(
                f"{self.store.url / name}: an object of another size lies there; a store that cuts "
                "what it is given cannot hold a log. Remove it, and ship again."
            )
        return ShippedSegment(
            name, segment.size, sha256, segment.full_header, segment.head_end, end_of(segment),
            segment.head, dict(segment.counts or {}), segment.recorded, segment.span,
        )  # fmt: skip

    def _put(self, manifest: Manifest, before: KeptManifest | None) -> bool:
        data = manifest.text().encode()
        if before is None:
            return self.store.create(MANIFEST_NAME, data)
        return self.store.replace(MANIFEST_NAME, data, before.e_tag)


def check_conditions(store: ObjectStore) -> None:
    """Check that a store refuses to create what is there: some ignore the condition in silence.

    Raises:
        LogError: It overwrites it.
        LogAccessError: It does not let us write.
    """
    name = f".probe-{secrets.token_hex(8)}"
    store.create(name, b"1")
    try:
        honours = not store.create(name, b"2")
    finally:
        with suppress(LogAccessError):  # a robot needs no right to remove: a byte stays
            store.remove(name)
    if not honours:
        raise LogError(
            f"{store.url}: this store ignores the condition `If-None-Match: *`: two robots could "
            f"write over each other there. nothing was shipped."
        )
