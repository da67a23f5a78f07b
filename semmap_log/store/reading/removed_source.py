"""The bytes of a segment that was removed from the disk: some are kept, the rest is in a store."""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Sequence

import numpy as np

from semmap_log.core.io.byte_source import ByteSource, Identity
from semmap_log.core.io.inflating import inflated
from semmap_log.core.io.url_path import UrlPath
from semmap_log.core.lazy.lazily import computed_once
from semmap_log.core.model.events import FloorMap, Retracted
from semmap_log.errors import CorruptLogError, ElsewhereError
from semmap_log.store.chunk_unpacking import most_unpacked
from semmap_log.store.folder import LogFolder
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.manifest import ShippedSegment
from semmap_log.store.reading.command_rows import rows_of
from semmap_log.store.reading.segment_reading import batches_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window
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
        """Return ranges one behind the other; as `read`."""
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


def kept_bytes(segment: Segment, shipped: ShippedSegment) -> bytes:
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
        chunks = Window(kinds=bits_of_kinds([kind])).chunks(copy)
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
    """A `ByteSource` that takes note of what is asked for."""

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
        """Return what was asked for, in order, without what overlaps."""
        found: list[tuple[int, int]] = []
        for start, end in sorted(self._noted):
            if found and start <= found[-1][1]:
                found[-1] = (found[-1][0], max(end, found[-1][1]))
            elif start < end:
                found.append((start, end))
        return found
