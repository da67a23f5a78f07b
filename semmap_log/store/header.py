"""What a segment says of itself: the Metadata records `semmap_log` and `semmap_index`.

`Unbound` collects what answers about a log rest on, but no hash of its commits binds. A Tombstone
vouches for what is left of its commits, but nothing in the log vouches for the Tombstone. A
keyframe in a trimmed segment, or at the head of the next, cannot be computed from the events that
are left. Nor is the content of segment heads in any commit. A statement signs the digest of all of
this: `taken`.
"""

from __future__ import annotations

import base64
import hashlib
import json
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntFlag
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.io.inflating import inflated
from semmap_log.core.model.moments import USUAL_HOLDS
from semmap_log.store.byte_layout import (
    DIGEST_KEY,
    FORMAT_MINOR,
    FORMAT_VERSION,
    INDEX_METADATA,
    LOG_METADATA,
    TRIMMED_VERSION,
)
from semmap_log.store.newer import NOTHING_NEWER, Newer

if TYPE_CHECKING:
    from mcap.records import Metadata


_ITEM = struct.Struct("<cQ")


class Unbound:
    """Takes the records of a log in file order; its digest is that of all up to the last commit.

    Each item is a letter, its length as u64, and its bytes: `i` a JSON list of timezone, building,
    robot and, if it is there, holds (a number), where a head says others than the one before; `s`
    a JSON list of what the head of a trimmed segment says (first event, next event, reasons,
    horizon); `t` the whole Message record of a Tombstone; `k` that of a keyframe that cannot be
    checked.
    """

    def __init__(self) -> None:
        self.keyframes = 0
        """How many cannot be checked by a replay."""
        self.before = 0
        """Number of the first event after all that was taken out, and after the horizon."""
        self._digest = hashlib.sha256(b"semmap-log taken 1\n")
        self._waiting: list[tuple[bytes, bytes]] = []
        """Items that no commit has followed yet."""
        self._info: LogInfo | None = None
        self._is_trimmed = False
        self._takes_next = False
        """Whether the next keyframe follows a trimmed segment, as the head of the next."""

    def begin_segment(self, header: SegmentHeader) -> None:
        """Take in what the head of the next segment says."""
        info, trimmed = header.info, header.trimmed
        if info != self._info:
            holds = () if info.holds == USUAL_HOLDS else (info.holds,)
            self._wait(b"i", _json(info.timezone, info.building, info.robot, *holds))
        self._takes_next = self._is_trimmed and trimmed is None
        self._info, self._is_trimmed = info, trimmed is not None
        if trimmed is not None:
            said = (header.first_event, trimmed.next_event, int(trimmed.reasons), trimmed.horizon)
            self._wait(b"s", _json(*said))
            self.before = max(self.before, trimmed.horizon)

    def add_keyframe(self, record: bytes | memoryview) -> None:
        """Take in a keyframe, if nothing else vouches for it."""
        if self._is_trimmed or self._takes_next:
            self.keyframes += 1
            self._wait(b"k", bytes(record))
            self._takes_next = False

    def add_tombstone(self, record: bytes | memoryview, next_event: int) -> None:
        """Take in a Tombstone, and the number after its last event."""
        self.settle()
        self._take(b"t", bytes(record))
        self.before = max(self.before, next_event)

    def settle(self) -> None:
        """A commit has followed: what was before it counts."""
        self._takes_next = False
        for letter, data in self._waiting:
            self._take(letter, data)
        self._waiting.clear()

    @property
    def digest(self) -> bytes:
        """SHA-256 of all that was before the end of the last commit."""
        return self._digest.digest()

    def _wait(self, letter: bytes, data: bytes) -> None:
        self._waiting.append((letter, data))

    def _take(self, letter: bytes, data: bytes) -> None:
        self._digest.update(_ITEM.pack(letter, len(data)) + data)


def _json(*values: str | int) -> bytes:
    return json.dumps(values, separators=(",", ":")).encode()


class OtherVersionError(ValueError):
    """A segment is of another major version of the format."""

    def __init__(self, version: str) -> None:
        self.is_newer = version not in ("", "1", "2")  # never released
        wanted = "a newer semmap-log" if self.is_newer else "the semmap-log that made it"
        super().__init__(
            f"format version {version!r}: this program reads the versions {FORMAT_VERSION} and "
            f"{TRIMMED_VERSION}; "
            f"install {wanted}"
        )


LATER_SETTINGS = ("holds",)
"""Entries that came to the heads of segments later: older programs keep them as `others`."""


@dataclass(frozen=True, slots=True)
class LogInfo:
    """What is fixed when a log is made."""

    log_id: str
    """32 hexadecimal digits, drawn at random."""
    timezone: str
    """IANA name; times without an offset are read and shown in it."""
    building: str = ""
    robot: str = ""
    holds: int = USUAL_HOLDS
    """A sighting of a door holds for this many median gaps between looks at it; 0: until the next
    report."""

    def entries(self) -> dict[str, str]:
        """Return what the head of a segment says of it; the usual `holds` is left out."""
        return {
            "log_id": self.log_id,
            "timezone": self.timezone,
            "building": self.building,
            "robot": self.robot,
            **({} if self.holds == USUAL_HOLDS else {"holds": str(self.holds)}),
        }

    @classmethod
    def taken_from(cls, entries: dict[str, Any]) -> LogInfo:
        """Take out of the entries of a head, or of a manifest, what `entries` put there.

        Raises:
            KeyError: Some is missing.
            ValueError: It is not what we write.
        """
        names = ("log_id", "timezone", "building", "robot")
        log_id, timezone, building, robot = (entries.pop(name) for name in names)
        holds = entries.pop("holds", str(USUAL_HOLDS))
        if not (isinstance(holds, str) and holds.isascii() and holds.isdigit() and len(holds) < 10):
            raise ValueError(f"holds is {holds!r}, expected a number of gaps")
        return cls(log_id, timezone, building, robot, int(holds))


class TrimReason(IntFlag):
    """Why records were taken out of a segment; the names are what its head says."""

    REDACTED = 1
    """They showed who was where, or what nobody shall read."""
    THINNED = 2
    """They repeated what others say."""
    EXPIRED = 4
    """They were older than the log is kept."""


@dataclass(frozen=True, slots=True)
class Trimmed:
    """What the head of a segment says from which records were taken out."""

    reasons: TrimReason
    next_event: int
    """Number of the first event after the segment: the remaining records do not count them all."""
    horizon: int = 0
    """Events below this number are gone because of their age; the Keyframe of the state there
    is in the segment, or at the head of the next."""


@dataclass(frozen=True, slots=True)
class SegmentHeader:
    """The Metadata `semmap_log` at the head of each segment."""

    info: LogInfo
    number: int
    first_event: int
    hash_so_far: bytes
    """Hash of the commit before this segment's first; zeros in the first segment."""
    last_number: int = -1
    """Of the segments that were merged into this one, the last; its own where none was."""
    minor: int = FORMAT_MINOR
    """Of the format's version."""
    others: tuple[tuple[str, str], ...] = ()
    """Entries that a later version has added."""
    newer: Newer = NOTHING_NEWER
    """What else it has put at the head. A segment that is being read has it once it is
    requested: `Segment.full_header`."""
    trimmed: Trimmed | None = None
    """None: all that was written is there."""

    def __post_init__(self) -> None:
        if self.last_number < 0:
            object.__setattr__(self, "last_number", self.number)

    def next(self, first_event: int, hash_so_far: bytes) -> SegmentHeader:
        """Return the header of the segment that follows."""
        number = self.last_number + 1
        return replace(
            self,
            number=number,
            last_number=number,
            first_event=first_event,
            hash_so_far=hash_so_far,
            trimmed=None,
        )

    def as_written(self) -> SegmentHeader:
        """Return the header of this program's copy of the segment: with all that it knows."""
        return replace(self, minor=max(self.minor, FORMAT_MINOR))

    @property
    def is_newer(self) -> bool:
        """Whether a later minor version has written it."""
        return self.minor > FORMAT_MINOR or bool(self.others or self.newer)

    def to_metadata(self) -> Metadata:
        """Return the MCAP record."""
        minor = {_MINOR_KEY: str(self.minor)} if self.minor else {}
        trimmed = self.trimmed
        version = FORMAT_VERSION if trimmed is None else TRIMMED_VERSION
        return _signed(
            LOG_METADATA,
            {
                "format_version": version,
                **self.info.entries(),
                "segment": str(self.number),
                "last_segment": str(self.last_number),
                "first_event": str(self.first_event),
                "hash_so_far": self.hash_so_far.hex(),
                **({} if trimmed is None else _trimmed_entries(trimmed)),
                **minor,
                **dict(self.others),
            },
        )

    @classmethod
    def from_metadata(cls, metadata: Metadata) -> SegmentHeader:
        """Read the MCAP record.

        Raises:
            OtherVersionError: It is of another major version.
            ValueError: It is damaged.
        """
        entries = _checked(metadata)
        version = entries.pop("format_version", "")
        if version not in (FORMAT_VERSION, TRIMMED_VERSION):
            raise OtherVersionError(version)
        try:
            info = LogInfo.taken_from(entries)
            number, first, last = (
                int(entries.pop(name)) for name in ("segment", "first_event", "last_segment")
            )
            head = bytes.fromhex(entries.pop("hash_so_far"))
            minor = int(entries.pop(_MINOR_KEY, "0"))
            trimmed = _trimmed_in(entries) if version == TRIMMED_VERSION else None
            others = tuple(entries.items())
            return cls(info, number, first, head, last, minor, others, trimmed=trimmed)
        except KeyError as error:
            raise ValueError(f"its entry {error} is missing") from None


_MINOR_KEY = "format_minor"
_REASONS_KEY, _NEXT_KEY, _HORIZON_KEY = "taken_out", "next_event", "horizon"


def _trimmed_entries(trimmed: Trimmed) -> dict[str, str]:
    names = [str(reason.name).lower() for reason in TrimReason if reason & trimmed.reasons]
    horizon = {_HORIZON_KEY: str(trimmed.horizon)} if trimmed.horizon else {}
    return {_REASONS_KEY: " ".join(names), _NEXT_KEY: str(trimmed.next_event), **horizon}


def _trimmed_in(entries: dict[str, str]) -> Trimmed:
    """Take out of the entries of a head what it says of being trimmed.

    Raises:
        ValueError: It is not what we write.
        KeyError: Some is missing.
    """
    reasons = TrimReason(0)
    for name in entries.pop(_REASONS_KEY).split():
        reasons |= TrimReason[name.upper()]
    return Trimmed(reasons, int(entries.pop(_NEXT_KEY)), int(entries.pop(_HORIZON_KEY, "0")))


def with_all_of(headers: Sequence[SegmentHeader]) -> SegmentHeader:
    """Return the first of some segments' headers with what later versions added to any of them."""
    return replace(
        headers[0],
        minor=max(header.minor for header in headers),
        others=tuple(dict(entry for header in headers for entry in header.others).items()),
        newer=Newer.all_of(header.newer for header in headers),
    )


def index_metadata(
    events: Sequence[int],
    least_ns: Sequence[int],
    greatest_ns: Sequence[int],
    head: bytes,
    next_events: Sequence[int] | None = None,
) -> Metadata:
    """Return the Metadata `semmap_index`: what the events of each chunk span, in file order.

    How many they are, and their least and greatest happened time; 0, -1, -1 where there are none.
    Values: base64 of zlib of little-endian int64s.

    Args:
        events: How many events each chunk has.
        least_ns: Their least happened time.
        greatest_ns: Their greatest.
        head: Hash of the segment's last commit; of the one before, if it has none.
        next_events: In a trimmed segment, the number of the first event after each chunk.
    """
    return _signed(
        INDEX_METADATA,
        {
            "events": _pack(events),
            "least_happened_ns": _pack(least_ns),
            "greatest_happened_ns": _pack(greatest_ns),
            "head": head.hex(),
            **({} if next_events is None else {_NEXT_KEY: _pack(next_events)}),
        },
    )


def read_index(
    metadata: Metadata, *, most: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return (events, least, greatest happened time) of each chunk from a `semmap_index` record.

    Args:
        metadata: The record.
        most: So many chunks the segment can have; of a longer index no more is unpacked.

    Raises:
        ValueError: It is damaged, or longer.
    """
    entries = _checked(metadata)
    names = ("events", "least_happened_ns", "greatest_happened_ns")
    events, least, greatest = (_unpack(entries[name], most) for name in names)
    return events, least, greatest


def next_events_in_index(metadata: Metadata, *, most: int) -> NDArray[np.int64] | None:
    """Return the number of the first event after each chunk; None: the segment is not trimmed.

    Args:
        metadata: The `semmap_index` record.
        most: As for `read_index`.

    Raises:
        ValueError: It is damaged, or longer.
    """
    text = _checked(metadata).get(_NEXT_KEY)
    return None if text is None else _unpack(text, most)


def head_in_index(metadata: Metadata) -> bytes | None:
    """Return the hash of the last commit from a `semmap_index` record; None: an older log's.

    Raises:
        ValueError: It is damaged.
    """
    text = _checked(metadata).get("head")
    return None if text is None else bytes.fromhex(text)


def _pack(values: Sequence[int]) -> str:
    return base64.b64encode(zlib.compress(np.array(values, "<i8").tobytes())).decode()


def _unpack(text: str, most: int) -> NDArray[np.int64]:
    try:
        return np.frombuffer(inflated(base64.b64decode(text, validate=True), 8 * most), "<i8")
    except ValueError as error:
        raise ValueError(f"its times of at most {most} chunks cannot be read: {error}") from error


def _digest(entries: Mapping[str, str]) -> str:
    lines = [f"{key}\0{entries[key]}\n" for key in sorted(entries)]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def _signed(name: str, entries: dict[str, str]) -> Metadata:
    from mcap.records import Metadata

    return Metadata(name=name, metadata={**entries, DIGEST_KEY: _digest(entries)})


def _checked(metadata: Metadata) -> dict[str, str]:
    entries = dict(metadata.metadata)
    if entries.pop(DIGEST_KEY, "") != _digest(entries):
        raise ValueError(f"Metadata {metadata.name}: its entries do not fit its {DIGEST_KEY}")
    return entries
