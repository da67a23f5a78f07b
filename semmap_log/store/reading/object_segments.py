"""The segments of a log in a store, read where they lie: see `SegmentStore`."""

from __future__ import annotations

import math
import time

from semmap_log.core.io.object_cache import ObjectCache, cache_of_environment
from semmap_log.core.io.object_source import ObjectSource
from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.texts import counted
from semmap_log.errors import LogAccessError, NotALogError
from semmap_log.store.bag_metadata import listed_names
from semmap_log.store.closed_mark import (
    MOST_BYTES,
    ClosedMark,
    last_mark,
    mark_in,
    those_that_count,
)
from semmap_log.store.form import mark_names
from semmap_log.store.log_objects import KeptManifest, log_objects, metadata_text, read_manifest
from semmap_log.store.manifest import ShippedSegment
from semmap_log.store.reading.segment_store import Listing

LISTED_FOR_S = 1.0
"""Asked again sooner, a listing is the same: each costs a request, and money."""


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
        """Take the place; nothing is asked yet.

        Args:
            store: What lies below the URL.
            listed_for_s: Asked again sooner, a listing is the same.
            cache: Keeps on a disk what is fetched; default: the one that the environment names.

        Raises:
            LogAccessError: The environment names one that cannot be used.
        """
        self._store = store
        self._cache = cache_of_environment() if cache is None else cache
        self._listed_for_s = listed_for_s
        self._listed_at = -math.inf
        self._manifest: KeptManifest | None = None
        self._told: dict[str, ShippedSegment] = {}
        self._listed: dict[str, ObjectStatus] = {}
        self._mark: tuple[list[ObjectStatus], ClosedMark | None] = [], None

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

    def told(self, name: str) -> ShippedSegment | None:
        """Return what the manifest says of a segment; as `SegmentStore.told`."""
        return self._told.get(name)

    def size_of(self, name: str) -> int:
        """Return how long a segment is, as it was last listed; as `SegmentStore.size_of`."""
        return self._status(name).size

    def mark(self) -> ClosedMark | None:
        """Return how far the log reaches, by the manifest, or by the last mark."""
        self._look()
        if self._manifest is not None:
            return self._manifest.manifest.mark
        names = those_that_count(mark_names(self._listed))
        found = [self._listed[name] for name in names]
        if found != self._mark[0]:
            self._mark = found, last_mark(names, self._read_mark)
        return self._mark[1]

    def closed_names(self) -> list[str]:
        """Return the closed segments that metadata.yaml lists: in a log without a mark."""
        return listed_names(metadata_text(self._store))

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
            self._manifest = read_manifest(self._store, self._manifest)
            if self._manifest is None:
                self._told = {}
                self._listed = {status.name: status for status in log_objects(self._store)}
            else:
                self._told = {one.name: one for one in self._manifest.manifest.segments}
                self._listed = {
                    name: ObjectStatus(name, one.size, "") for name, one in self._told.items()
                }
            self._listed_at = now
        return self._listed

    def _read_mark(self, name: str) -> ClosedMark | None:
        status = self._listed[name]
        try:
            data = self._store.part(status, 0, min(status.size, MOST_BYTES))
        except FileNotFoundError:
            return None
        return mark_in(data, self.path / name)
