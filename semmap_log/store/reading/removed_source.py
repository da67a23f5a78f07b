"""The bytes of a segment that was removed from the disk: some are kept, the rest is in a store.

Also reads the segments of a log in a store where they are: see `SegmentStore`.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
import zlib
from collections.abc import Sequence

import numpy as np

from semmap_log.core.io.byte_source import ByteSource, Identity
from semmap_log.core.io.inflating import inflated
from semmap_log.core.io.object_cache import ObjectCache, cache_of_environment
from semmap_log.core.io.object_source import ObjectSource
from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.lazily import computed_once
from semmap_log.core.model.events import FloorMap, Retracted
from semmap_log.core.texts import counted
from semmap_log.errors import CorruptLogError, ElsewhereError, LogAccessError, NotALogError
from semmap_log.store import closed_mark, manifest
from semmap_log.store.bag_metadata import listed_names
from semmap_log.store.byte_layout import mark_names
from semmap_log.store.folder import LogFolder
from semmap_log.store.pages import kinds_mask
from semmap_log.store.reading.command_rows import rows_of
from semmap_log.store.reading.segment_reading import batches_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.segment_set import Listing
from semmap_log.store.reading.window import Window
from semmap_log.store.record_scan import most_unpacked
from semmap_log.store.removed_part import WITH_VARIABLE, RemovedSegment


class RemovedSource:
    """A `ByteSource` of a segment of which some ranges are kept on the disk."""

    is_guarded = True

    def __init__(self, folder: LogFolder, removed: RemovedSegment, url: UrlPath) -> None:
        self._folder = folder
        self._removed = removed
        self._url = url
        self.size = removed.shipped.size
        self.identity: Identity = ("removed", removed.shipped.sha256)

    def read(self, start: int, end: int) -> memoryview:
        """Return a range, if it is kept; as `ByteSource.read`.

        Raises:
            ElsewhereError: It is not; says where it lies.
            CorruptLogError: What is kept is not what was written.
        """
        end = min(end, self.size)
        if start >= end:
            return memoryview(b"")
        for first, data in self._kept:
            if first <= start and end <= first + len(data):
                return data[start - first : end - first]
        header, shipped = self._removed.shipped.header, self._removed.shipped
        raise ElsewhereError(
            f"{self._folder / self._removed.file}: removed from this disk once it was shipped: "
            f"events {header.first_event} to {shipped.next_event - 1} lie at {self._url}. To read "
            f"them there: --with {self._url}, or {WITH_VARIABLE} in the environment."
        )

    def read_ranges(self, ranges: Sequence[tuple[int, int]]) -> memoryview:
        """Return ranges, concatenated; as `read`."""
        return memoryview(b"".join(self.read(start, end) for start, end in ranges))

    def will_need(self, start: int, end: int) -> None:
        """Do nothing: what is kept is small."""

    def let_go(self, start: int, end: int) -> None:
        """Do nothing."""

    @computed_once
    def _kept(self) -> list[tuple[int, memoryview]]:
        path = self._folder / self._removed.kept_name
        try:
            data = self._folder.read_bytes(self._removed.kept_name, self._removed.most_kept_bytes)
        except FileNotFoundError:
            raise CorruptLogError(
                path, None, f"it is gone; the segment lies at {self._url}"
            ) from None
        if hashlib.sha256(data).hexdigest() != self._removed.kept_sha256:
            raise CorruptLogError(path, None, f"not what was written; see {self._url}")
        try:
            return _unpacked(inflated(data, most_unpacked(len(data))))
        except (ValueError, TypeError, RecursionError) as error:
            raise CorruptLogError(path, None, f"not what was written: {error}") from None


def kept_bytes(segment: Segment, shipped: manifest.ShippedSegment) -> bytes:
    """Return what is to be kept of a segment: its ends, its commands, what it takes back, floors.

    Args:
        segment: As it lies on the disk.
        shipped: The same as it lies in a store.

    Raises:
        CorruptLogError: It is damaged, or not what was shipped.
    """
    noted = _NotedSource(segment.source)
    copy = Segment(segment.path, shipped.header, noted, shipped.head_end, live=None, told=shipped)
    rows_of(copy)
    _ = copy.summary, copy.statistics, copy.spans, copy.newer
    for kind in (Retracted, FloorMap):
        chunks = Window(kinds=kinds_mask([kind])).chunks(copy)
        if len(chunks):
            for _page, _batch in batches_of(copy, np.asarray(chunks)):
                pass
    ranges = noted.ranges()
    parts = [bytes(segment.source.read(start, end)) for start, end in ranges]
    return zlib.compress(json.dumps(ranges).encode() + b"\n" + b"".join(parts))


def _unpacked(data: bytes) -> list[tuple[int, memoryview]]:
    line, _, rest = data.partition(b"\n")
    kept, at, view = [], 0, memoryview(rest)
    for start, end in json.loads(line):
        kept.append((start, view[at : at + end - start]))
        at += end - start
    return kept


class _NotedSource:
    """A `ByteSource` that records which ranges are requested."""

    is_guarded = True

    def __init__(self, source: ByteSource) -> None:
        self._source = source
        self._noted: list[tuple[int, int]] = []
        self.size = source.size
        self.identity = source.identity

    def read(self, start: int, end: int) -> memoryview:
        self._noted.append((start, min(end, self.size)))
        return self._source.read(start, end)

    def read_ranges(self, ranges: Sequence[tuple[int, int]]) -> memoryview:
        self._noted += [(start, min(end, self.size)) for start, end in ranges]
        return self._source.read_ranges(ranges)

    def will_need(self, start: int, end: int) -> None:
        """Do nothing."""

    def let_go(self, start: int, end: int) -> None:
        """Do nothing."""

    def ranges(self) -> list[tuple[int, int]]:
        """Return the requested ranges, in order and without overlaps."""
        found: list[tuple[int, int]] = []
        for start, end in sorted(self._noted):
            if found and start <= found[-1][1]:
                found[-1] = (found[-1][0], max(end, found[-1][1]))
            elif start < end:
                found.append((start, end))
        return found


LISTED_FOR_S = 1.0
"""Within this time a listing is not repeated: each costs a request, and money."""


class ObjectSegments:
    """A `SegmentStore`: objects below a URL, by its manifest.

    Of a log that was copied there without one, by what the store lists: see `log_objects`.
    """

    def __init__(
        self,
        store: ObjectStore,
        *,
        listed_for_s: float = LISTED_FOR_S,
        cache: ObjectCache | None = None,
    ) -> None:
        """Store the place; nothing is requested yet.

        Args:
            store: What lies below the URL.
            listed_for_s: How long a listing is used before it is repeated.
            cache: Keeps on a disk what is fetched; default: the one that the environment names.

        Raises:
            LogAccessError: The environment names one that cannot be used.
        """
        self._store = store
        self._cache = cache_of_environment() if cache is None else cache
        self._listed_for_s = listed_for_s
        self._listed_at = -math.inf
        self._manifest: manifest.KeptManifest | None = None
        self._told: dict[str, manifest.ShippedSegment] = {}
        self._listed: dict[str, ObjectStatus] = {}
        self._mark: tuple[list[ObjectStatus], closed_mark.ClosedMark | None] = [], None

    @property
    def path(self) -> UrlPath:
        """The URL."""
        return self._store.url

    @property
    def given(self) -> UrlPath:
        """The same."""
        return self._store.url

    def segments(self) -> Listing:
        """Return name, tag and size of each; as `SegmentStore.segments`."""
        listed = self._look()
        found: Listing = [
            (name, (status.e_tag, status.size))
            for name, status in listed.items()
            if name.endswith(".mcap") and not name.startswith(".")
        ]
        if not found:
            there = counted(len(listed), "other object") if listed else "nothing"
            raise NotALogError(
                f"{self.path}: expected a log's segments (*.mcap) right below it, got {there}."
            )
        return found

    def open(self, name: str) -> ObjectSource:
        """Return a segment's bytes; as `SegmentStore.open`."""
        told = self._told.get(name)
        sha256 = "" if told is None else told.sha256
        return ObjectSource(self._store, self._status(name), cache=self._cache, sha256=sha256)

    def told(self, name: str) -> manifest.ShippedSegment | None:
        """Return what the manifest says of a segment; as `SegmentStore.told`."""
        return self._told.get(name)

    def size_of(self, name: str) -> int:
        """Return how long a segment is, as it was last listed; as `SegmentStore.size_of`."""
        return self._status(name).size

    def mark(self) -> closed_mark.ClosedMark | None:
        """Return how far the log reaches, by the manifest, or by the last mark."""
        self._look()
        if self._manifest is not None:
            return self._manifest.manifest.mark
        names = closed_mark.those_that_count(mark_names(self._listed))
        found = [self._listed[name] for name in names]
        if found != self._mark[0]:
            self._mark = found, closed_mark.last_mark(names, self._read_mark)
        return self._mark[1]

    def closed_names(self) -> list[str]:
        """Return the closed segments that metadata.yaml lists: in a log without a mark."""
        return listed_names(manifest.metadata_text(self._store))

    def _status(self, name: str) -> ObjectStatus:
        status = self._look().get(name)
        if status is None:
            raise LogAccessError(
                f"{self.path / name}: cannot be read: it is gone."
            ) from FileNotFoundError(2, "no such object", str(self.path / name))
        return status

    def _look(self) -> dict[str, ObjectStatus]:
        """Return what is there, by name.

        Raises:
            CorruptLogError: The manifest is damaged.
            LogAccessError: The store does not let us.
        """
        now = time.monotonic()
        if now - self._listed_at >= self._listed_for_s:
            self._manifest = manifest.read_manifest(self._store, self._manifest)
            if self._manifest is None:
                self._told = {}
                self._listed = {status.name: status for status in manifest.log_objects(self._store)}
            else:
                self._told = {one.name: one for one in self._manifest.manifest.segments}
                self._listed = {
                    name: ObjectStatus(name, one.size, "") for name, one in self._told.items()
                }
            self._listed_at = now
        return self._listed

    def _read_mark(self, name: str) -> closed_mark.ClosedMark | None:
        status = self._listed[name]
        try:
            data = self._store.part(status, 0, min(status.size, closed_mark.MOST_BYTES))
        except FileNotFoundError:
            return None
        return closed_mark.mark_in(data, self.path / name)
