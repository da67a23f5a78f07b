"""manifest.json: which segments of a log are in a store, and what is needed to query them.

Segments are uploaded first, each under a name that shows what it contains, and never overwritten;
then a new manifest replaces the previous one, unless someone else has replaced it. A reader uses
only what the manifest names. What it states about a segment is believed until the segment is read,
and compared then.

This module also finds where a segment differs from its entry in a manifest, and which objects below
a URL belong to a log.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import PurePath
from typing import Any

from semmap_log.core.io.object_store import ObjectStatus, ObjectStore
from semmap_log.core.lazily import late_pattern
from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.errors import CorruptLogError, NewerLogError
from semmap_log.store.bag_metadata import listed_names
from semmap_log.store.byte_layout import (
    HASH_BYTES,
    MANIFEST_NAME,
    MOST_LIST_BYTES,
    NO_HASH,
    OLD_MARK_NAME,
    count_events,
)
from semmap_log.store.closed_mark import ClosedMark, sealed, unsealed
from semmap_log.store.header import LATER_SETTINGS, LogInfo, SegmentHeader, Trimmed, TrimReason

_WORDS = {
    "size": "bytes",
    "sha256": "the SHA-256",
    "head_end": "the end of the head",
    "next_event": "the next event",
    "head": "the hash of the last commit",
    "counts": "the messages on each channel",
    "recorded": "the recorded times",
    "happened": "the times at which it happened",
    "number": "the number",
    "last_number": "the last number",
    "first_event": "the first event",
    "hash_so_far": "the hash of the commit before",
    "minor": "the minor version",
    "others": "other entries of the head",
    "info": "the log",
}
"""What fields of an entry, and of its header, are called in messages."""


def differences(told: ShippedSegment, found: ShippedSegment) -> Iterator[str]:
    """Yield in what a manifest's entry differs from a segment's own, in words."""
    yield from _differences(told.header, found.header)
    yield from _differences(told, found)


def _differences(told: Any, found: Any) -> Iterator[str]:
    for each in fields(found):
        if each.name not in _WORDS:
            continue
        said, is_so = getattr(told, each.name), getattr(found, each.name)
        if said != is_so:
            yield f"it gives {_shown(said)} as {_WORDS[each.name]}; the segment has {_shown(is_so)}"


def _shown(value: object) -> object:
    return value.hex() if isinstance(value, bytes) else value


def log_objects(store: ObjectStore) -> list[ObjectStatus]:
    """Return what lies right below a URL, by name.

    A web server that lists nothing is queried for what the log's metadata.yaml names: the closed
    segments, which show how far it reached. Only a list shows the names of marks, except those
    of older versions.

    Raises:
        LogAccessError: The store does not let us.
    """
    listed = store.list()
    if listed or not store.is_web_server:
        return listed
    return _statuses_of(store, (*listed_names(metadata_text(store)), OLD_MARK_NAME))


def objects_named(store: ObjectStore, names: Sequence[str]) -> list[ObjectStatus]:
    """Return those of some objects that are there, by name.

    Raises:
        LogAccessError: The store does not let us.
    """
    if store.is_web_server:
        return _statuses_of(store, names)
    wanted = set(names)
    return [status for status in store.list() if status.name in wanted]


def _statuses_of(store: ObjectStore, names: Sequence[str]) -> list[ObjectStatus]:
    found = []
    for name in names:
        with suppress(FileNotFoundError):
            found.append(store.status(name))
    return sorted(found, key=lambda status: status.name)


@dataclass(frozen=True, slots=True)
class KeptManifest:
    """A manifest, and what distinguishes it from the next one."""

    manifest: Manifest
    e_tag: str
    modified_ns: int
    """When it was put, by the store's clock, nanoseconds UTC."""


def read_manifest(store: ObjectStore, before: KeptManifest | None = None) -> KeptManifest | None:
    """Return a log's manifest as it is now, or None.

    Args:
        store: Where it lies.
        before: As it was; it is not fetched again while it is the same.

    Raises:
        CorruptLogError: It is damaged.
        LogAccessError: The store does not let us.
    """
    try:
        e_tag = "" if before is None else before.e_tag
        got = store.whole(MANIFEST_NAME, e_tag, most_bytes=MOST_LIST_BYTES)
    except FileNotFoundError:
        return None
    if got is None:
        return before
    data, status = got
    manifest = manifest_in(data, store.url / MANIFEST_NAME)
    return KeptManifest(manifest, status.e_tag, status.modified_ns)


def metadata_text(store: ObjectStore) -> str:
    """Return the text of metadata.yaml; nothing where there is none.

    Raises:
        CorruptLogError: It is too long.
        LogAccessError: The store does not let us.
    """
    with suppress(FileNotFoundError):
        got = store.whole(BAG_METADATA_NAME, most_bytes=MOST_LIST_BYTES)
        return "" if got is None else got[0].decode("utf-8", "replace")
    return ""


_FORMAT = 1
_NAME = late_pattern(r"[0-9A-Za-z_-][0-9A-Za-z._-]*\.mcap")
_SHA256 = late_pattern(r"[0-9a-f]{64}")
_UNLIKE_WRITTEN = (
    ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError,
)  # fmt: skip
"""What reading a malformed manifest raises."""


@dataclass(frozen=True, slots=True)
class ShippedSegment:
    """A closed segment in a store."""

    name: str
    """Of its object: number, and the first digits of its SHA-256."""
    size: int
    sha256: str
    """Of all its bytes, in hexadecimal digits."""
    header: SegmentHeader
    head_end: int
    """Where the records after the head's Metadata begin."""
    next_event: int
    """Number of the first event after it."""
    head: bytes
    """Hash of its last commit; of the commit before it, if it has none."""
    counts: Mapping[int, int]
    """Messages on each channel."""
    recorded: tuple[int, int]
    """The least and the greatest log time in it, nanoseconds UTC."""
    happened: tuple[int, int]
    """When its events happened, at the earliest and at the latest; (-1, -1) without any."""


@dataclass(frozen=True, slots=True)
class Superseded:
    """An object that a manifest named once: another segment holds its commits now."""

    name: str
    size: int
    since_ns: int | None
    """When a manifest came that did not name it, by the store's clock, nanoseconds UTC; None: this
    is the first such manifest, and the store shows when it came."""


@dataclass(frozen=True, slots=True)
class Manifest:
    """What lies in a store of one log."""

    version: int
    """How many manifests of the log there have been there."""
    info: LogInfo
    segments: tuple[ShippedSegment, ...]
    """In order, at least one."""
    superseded: tuple[Superseded, ...] = ()
    """What it does not name any more, and what still lies there, as far as is known."""
    generation: int = 0
    """How many times superseded objects were removed. In a later generation an object has another
    name: so nothing is ever sent under a name that is about to be removed."""

    @property
    def mark(self) -> ClosedMark:
        """How far the log reaches there."""
        last = self.segments[-1]
        return ClosedMark(
            self.info.log_id, last.header.last_number, last.next_event, last.head.hex()
        )

    def text(self) -> str:
        """Return the object's text."""
        entries = {
            "format": _FORMAT,
            "version": self.version,
            **self.info.entries(),
            "segments": [_entries_of(segment) for segment in self.segments],
            "superseded": [[one.name, one.size, one.since_ns] for one in self.superseded],
            "generation": self.generation,
        }
        return sealed(entries)


def manifest_in(data: bytes, where: PurePath) -> Manifest:
    """Return the manifest that an object's bytes are.

    Args:
        data: Its bytes.
        where: Its place, for messages.

    Raises:
        NewerLogError: A later version has written it.
        CorruptLogError: It is not what was written, or its segments do not follow each other.
    """
    try:
        entries = json.loads(data)
        if entries["format"] != _FORMAT:
            told = f"{where}: format {entries['format']!r}: this program reads {_FORMAT}"
            raise NewerLogError(f"{told}; install a newer semmap-log.")  # noqa: TRY301
        entries = unsealed(entries)
        for each in entries["segments"]:  # an older program wrote down what it did not know
            known = {str(key): str(value) for key, value in each["others"]}
            entries |= {key: known.pop(key) for key in LATER_SETTINGS if key in known}
            each["others"] = list(known.items())
        info = LogInfo.taken_from(entries)
        segments = tuple(_segment_of(each, info) for each in entries["segments"])
        superseded = tuple(_superseded_of(*each) for each in entries.get("superseded", ()))
        version, generation = (
            _number({"generation": 0, **entries}, name) for name in ("version", "generation")
        )
        manifest = Manifest(version, info, segments, superseded, generation)
        _check_chain(manifest)
    except NewerLogError:
        raise
    except _UNLIKE_WRITTEN as error:
        raise CorruptLogError(where, None, f"no manifest as it was written ({error})") from None
    return manifest


def _check_chain(manifest: Manifest) -> None:
    """Check that each segment follows the one before, from the log's first event on.

    Raises:
        ValueError: One does not.
    """
    first = manifest.segments[0] if manifest.segments else None
    if first is None or (first.header.number, first.header.first_event) != (0, 0):
        raise ValueError("it does not begin with segment 0")
    if first.header.hash_so_far != NO_HASH:
        raise ValueError("its first segment follows another")
    if len({segment.name for segment in manifest.segments}) < len(manifest.segments):
        raise ValueError("two segments have one name")
    for before, segment in pairwise(manifest.segments):
        header = segment.header
        told = (before.header.last_number + 1, before.next_event, before.head)
        if (header.number, header.first_event, header.hash_so_far) != told:
            raise ValueError(f"segment {header.number} does not follow the one before it")


def _entries_of(segment: ShippedSegment) -> dict[str, Any]:
    header = segment.header
    return {
        "name": segment.name,
        "bytes": segment.size,
        "sha256": segment.sha256,
        "segment": header.number,
        "last_segment": header.last_number,
        "first_event": header.first_event,
        "hash_so_far": header.hash_so_far.hex(),
        "format_minor": header.minor,
        "others": [list(pair) for pair in header.others],
        **({} if header.trimmed is None else _trimmed_entries(header.trimmed)),
        "head_end": segment.head_end,
        "next_event": segment.next_event,
        "head": segment.head.hex(),
        "counts": {str(channel): count for channel, count in sorted(segment.counts.items())},
        "recorded_ns": list(segment.recorded),
        "happened_ns": list(segment.happened),
    }


def _superseded_of(name: str, size: int, since_ns: int | None) -> Superseded:
    return Superseded(str(name), int(size), None if since_ns is None else int(since_ns))


def _segment_of(entries: dict[str, Any], info: LogInfo) -> ShippedSegment:
    head, so_far = (bytes.fromhex(entries[name]) for name in ("head", "hash_so_far"))
    if {len(head), len(so_far)} != {HASH_BYTES}:
        raise ValueError("a hash is cut")
    name = str(entries["name"])
    if not _NAME.fullmatch(name):
        raise ValueError(f"{name!r} is no name of a segment")
    sha256 = str(entries["sha256"])
    if not _SHA256.fullmatch(sha256):
        raise ValueError(f"{sha256!r} is no SHA-256")
    header = SegmentHeader(
        info,
        _number(entries, "segment"),
        _number(entries, "first_event"),
        so_far,
        _number(entries, "last_segment"),
        _number(entries, "format_minor"),
        tuple((str(key), str(value)) for key, value in entries["others"]),
        trimmed=_trimmed_of(entries),
    )
    (least, greatest), (earliest, latest) = entries["recorded_ns"], entries["happened_ns"]
    told = ShippedSegment(
        name,
        _number(entries, "bytes"),
        sha256,
        header,
        _number(entries, "head_end"),
        _number(entries, "next_event"),
        head,
        {int(channel): int(count) for channel, count in entries["counts"].items()},
        (int(least), int(greatest)),
        (int(earliest), int(latest)),
    )
    _check_possible(told)
    return told


def _trimmed_entries(trimmed: Trimmed) -> dict[str, Any]:
    return {"taken_out": int(trimmed.reasons), "horizon": trimmed.horizon}


def _trimmed_of(entries: dict[str, Any]) -> Trimmed | None:
    if "taken_out" not in entries:
        return None
    reasons = TrimReason(_number(entries, "taken_out"))
    return Trimmed(reasons, _number(entries, "next_event"), _number(entries, "horizon"))


def _number(entries: dict[str, Any], name: str) -> int:
    found = entries[name]
    if type(found) is not int or not 0 <= found < 2**63:
        raise ValueError(f"{name}: expected a whole number from 0 on, got {found!r:.40}")
    return found


def _is_counted(told: ShippedSegment) -> bool:
    """Return whether a segment has as many events as its numbers leave room for."""
    events = told.next_event - told.header.first_event
    counted = count_events(told.counts)
    return counted == events if told.header.trimmed is None else 0 <= counted <= events


def _check_possible(told: ShippedSegment) -> None:
    """Check that the entry of a segment is possible.

    Raises:
        ValueError: It is not.
    """
    header = told.header
    is_possible = {
        "last_segment": header.number <= header.last_number,
        "bytes": told.head_end <= told.size,
        "counts": min(told.counts.values(), default=0) >= 0,
        "next_event": _is_counted(told),
        "recorded_ns": 0 <= told.recorded[0] <= told.recorded[1] < 2**64,
        "happened_ns": -(2**63) <= told.happened[0] <= told.happened[1] < 2**63,
    }
    for name, holds in is_possible.items():
        if not holds:
            raise ValueError(f"segment {header.number}: {name} has an impossible value")
