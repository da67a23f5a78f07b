"""What a shipping would do, and how the log lies in the store: nothing is sent."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.io.byte_source import blocks
from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath
from semmap_log.errors import LogAccessError
from semmap_log.fleet.shipping import (
    check_conditions,
    check_same_way,
    closed_ones,
    is_ahead,
    shipped_before,
    waiting_events,
)
from semmap_log.store.folder import LogFolder
from semmap_log.store.log_objects import read_manifest
from semmap_log.store.manifest import Manifest, ShippedSegment
from semmap_log.store.object_names import is_object_name, object_name
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment


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
    """What lies there; None: nothing was shipped yet."""
    to_send: ObjectCount
    """Closed segments that a shipping would send."""
    is_list_old: bool
    """Whether a shipping would write a manifest anew, though perhaps no segment."""
    waits_events: int
    """Events of the live segment, which is sent once it is closed."""
    is_probed: bool
    """Whether it was found that the store honours conditions: only where there is what to send."""
    superseded: ObjectCount | None
    """Segments that lie there, and that the manifest does not name; None: it cannot be listed."""
    problems: tuple[str, ...]
    """What the manifest names and is not there, or is of another size."""

    @property
    def exit_code(self) -> int:
        """0: every closed segment lies there; 1: some are to be sent; 4: something is gone."""
        if self.problems:
            return 4
        return 1 if self.to_send.number or self.is_list_old else 0


def check_shipping(log: Path, place: UrlPath | ObjectStore) -> ShippingCheck:
    """Tell what a shipping of a log would send, and whether what was shipped is still there.

    Nothing is sent; where there is something to send, the store is asked whether it honours
    conditional writes, as a shipping does first: by a byte that is put twice, and removed.

    Args:
        log: The log's folder.
        place: Where it lies, or is to lie.

    Raises:
        LogError: Another log lies there, or one that has gone another way since; or the store does
            not honour conditional writes.
        LogAccessError: The store, or the disk, does not let us.
        CorruptLogError: The log, or the manifest there, is damaged.
        MissingExtraError: A package for stores is not installed.
    """
    segments = LogReader(LogFolder(log)).segments
    closed = closed_ones(segments)
    store = place if isinstance(place, ObjectStore) else ObjectStore(place)
    kept = read_manifest(store)
    there = None if kept is None else kept.manifest
    if there is not None:
        check_same_way(store.url, segments, there)
    missing = _missing(closed, there)
    found = _listed(store)
    sent = {} if found is None else _sent_unnamed(missing, found, there)
    to_send = [one.size for one in missing if one.path.name not in sent]
    if to_send:
        check_conditions(store)
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
    if is_ahead(there, closed):
        return []
    shipped = shipped_before(closed, there)
    return [segment for segment in closed if segment.path.name not in shipped]


def _is_list_old(closed: Sequence[Segment], there: Manifest | None) -> bool:
    if there is None:
        return bool(closed)
    if is_ahead(there, closed):
        return False
    named = [(one.header.number, one.size, one.head) for one in there.segments]
    return named != [(one.header.number, one.size, one.head) for one in closed]


def _waiting(segments: Sequence[Segment], there: Manifest | None) -> int:
    if there is not None:
        return waiting_events(segments, there)
    return end_of(segments[-1]) - segments[-1].header.first_event


def _listed(store: ObjectStore) -> dict[str, int] | None:
    """Return what lies there, and its size; None: who may put and get need not be let list."""
    try:
        return {status.name: status.size for status in store.list()}
    except LogAccessError:
        return None


def _sent_unnamed(
    missing: Sequence[Segment], found: dict[str, int], there: Manifest | None
) -> dict[str, str]:
    """Return which segments lie there though no manifest names them: a shipping was cut short."""
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
