"""What answers a repeated command once its events were taken out of the log.

A *seal* keeps, for a command, codes of what it requested, when it was recorded, and which events it
became. It is in the Tombstone, which stands in a trimmed segment for the records that are gone. The
codes are HMACs under the command's id, of which only a digest is kept where the whole commit is
gone: only a client that has the id can test contents against them. An id that a writer drew at
random is never sent again: nothing of it is kept.
"""

from __future__ import annotations

import hashlib
import hmac
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any

import numpy as np

from semmap_log.core.messages import (
    OBJECT_KINDS,
    decode,
    encode,
    fixed_layout,
    read_message,
    type_name,
    write_message,
)
from semmap_log.core.model.commits import (
    GIVEN_EVENTS,
    NO_CONTENT,
    NOTE_TEXTS,
    Commit,
    Durability,
    Note,
)
from semmap_log.core.model.events import DoorAnnotated, Event, FloorMap, RobotPose
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import COMMIT_CHANNEL, HASH_BYTES, NO_HASH, TOMBSTONE_CHANNEL
from semmap_log.store.header import TrimReason

_CODE_BYTES = 7
_SEAL = struct.Struct(f"<{_CODE_BYTES}s{_CODE_BYTES}sHQII")
_MOST_POSES = 2**16 - 1
_MOST_WAITING = 64
UNKNOWN = bytes(_CODE_BYTES)
"""The code of a command whose events were taken out by a version that kept none."""


@dataclass(frozen=True, slots=True)
class CommandSeal:
    """What is kept of a command."""

    timed: bytes
    """Code of its content with the times of its events …"""
    untimed: bytes
    """… and without: a command that gave none is the same whenever it is sent."""
    poses: int
    """How many poses stand before the other events of its commit."""
    recorded_ns: int
    first: int
    """The first event of its commit, counted from the first that the Tombstone is about."""
    count: int
    """How many events the commit had."""

    def packed(self) -> bytes:
        """Return its 32 bytes."""
        return _SEAL.pack(
            self.timed, self.untimed, self.poses, self.recorded_ns, self.first, self.count
        )

    @classmethod
    def unpacked(cls, data: bytes) -> CommandSeal | None:
        """Return the seal in 32 bytes; None: a version without seals wrote them."""
        return None if data == NO_HASH else cls(*_SEAL.unpack(data))

    def fits(self, command_id: bytes, content: bytes, note: Note, events: Sequence[Event]) -> bool:
        """Return whether the seal is that of a command.

        Args:
            command_id: The command's id.
            content: Digest of what it asks for; zeros: its events are compared.
            note: Who, with what, why.
            events: Its own, as they are given; without a time or a level where the log gives it.
        """
        if self.timed == UNKNOWN:
            return True
        told = Content()
        for event in events:
            told.add(event.kind, event.happened_ns or 0, encode(event, 0))
        timed, untimed = told.codes(command_id, content, note)
        is_timed = all(event.happened_ns is not None for event in events)
        return self.timed == timed if is_timed else self.untimed == untimed


@dataclass(frozen=True, slots=True)
class StoredCommand:
    """A command that the log has stored."""

    commit: Commit
    """What it became; what is still known of that."""
    seal: CommandSeal | None = None
    """None: all of its events, and its note, are there to be compared."""

    def has_content(self, content: bytes) -> bool:
        """Return whether the command requested the content that a digest stands for."""
        commit = self.commit
        if self.seal is None:
            return commit.content == content
        return self.seal.fits(commit.command_id, content, Note(), ())


class Content:
    """The events of a command, taken in one by one: what its codes are made of.

    Poses before the other events waited for the command, and are none of its own. Where there are
    poses only, the last one is compared.
    """

    def __init__(self) -> None:
        self._poses = self._count = 0
        """How many poses stand before the other events, and how many others there are."""
        self._waiting: list[tuple[int, int, bytes]] = []
        self._digests: tuple[Any, Any] | None = None
        self._pose: tuple[int, int, bytes] | None = None

    def add(self, kind: int, happened_ns: int, data: bytes) -> None:
        """Take in an event: its kind, when it happened, and its CDR bytes."""
        if kind == RobotPose.kind and not self._count:
            self._poses += 1
            self._pose = kind, happened_ns, data
            return
        self._count += 1
        self._waiting.append((kind, happened_ns, data))
        if len(self._waiting) >= _MOST_WAITING:
            self._digests = self._absorbed()

    def seal(self, command_id: bytes, content: bytes, note: Note, recorded_ns: int) -> CommandSeal:
        """Return the seal of the command."""
        codes = self.codes(command_id, content, note)
        poses = min(self._poses if self._count else 0, _MOST_POSES)
        return CommandSeal(*codes, poses, recorded_ns, 0, self._poses + self._count)

    def codes(self, command_id: bytes, content: bytes, note: Note) -> tuple[bytes, bytes]:
        """Return the codes with and without times."""
        if content not in (NO_CONTENT, GIVEN_EVENTS):
            code = _code(command_id, b"content" + content)
            return code, code
        if not self._count and self._pose is not None:
            self._waiting.append(self._pose)
        texts = "\0".join(getattr(note, name) for name in NOTE_TEXTS).encode()
        timed, untimed = (_code(command_id, d.digest() + texts) for d in self._absorbed())
        return timed, untimed

    def _absorbed(self) -> tuple[Any, Any]:
        timed, untimed = self._digests or (hashlib.sha256(), hashlib.sha256())
        for kind, happened_ns, data in self._waiting:
            said = struct.pack("<B", kind) + hashlib.sha256(_as_given(kind, data)).digest()
            timed.update(said + struct.pack("<q", happened_ns))
            untimed.update(said)
        self._waiting = []
        return timed, untimed


def _code(command_id: bytes, content: bytes) -> bytes:
    return hmac.digest(command_id, content, "sha256")[:_CODE_BYTES]


def _as_given(kind: int, data: bytes) -> bytes:
    """Return the CDR bytes of an event without what the log adds: salt, level, a map's stamp."""
    if kind == FloorMap.kind:
        event = decode(kind, data, 0)
        assert isinstance(event, FloorMap)
        numbers = (event.resolution, event.origin_x, event.origin_y)
        shape = struct.pack("<f2d2q", *numbers, *event.cells.shape)
        return shape + bytes(event.cells.tobytes())
    if kind == DoorAnnotated.kind:
        return data[20:]
    if kind not in OBJECT_KINDS:
        fields = fixed_layout(kind).dtype.fields
        if fields is not None and "level" in fields:
            dtype, at = fields["level"][:2]
            return data[:at] + bytes(dtype.itemsize) + data[at + dtype.itemsize :]
    return data


@dataclass(frozen=True, slots=True)
class GoneCommand:
    """A command of which only a digest of its id, and its seal, are left."""

    id_digest: bytes
    """SHA-256 of its id."""
    seal: CommandSeal
    first_event: int
    """Of its commit."""

    def as_commit(self, command_id: bytes) -> Commit:
        """Return what is still known of its commit."""
        seal = self.seal
        return Commit(
            first_event=self.first_event,
            count=seal.count,
            recorded_ns=seal.recorded_ns,
            closed_ns=seal.recorded_ns + seal.count,
            command_id=command_id,
            wall_clock_ns=seal.recorded_ns,
            monotonic_clock_ns=0,
            boot_id=bytes(16),
            previous_hash=NO_HASH,
            hash=NO_HASH,
            durability=Durability.EVENT,
            durable_before=self.first_event,
            content=NO_CONTENT,
            note=Note(),
        )


def part_of(command_id: bytes, seal: CommandSeal) -> LostPart:
    """Return what a Tombstone of whole commits keeps of a command."""
    return LostPart(COMMIT_CHANNEL, hashlib.sha256(command_id).digest(), seal.packed())


def commands_in(tombstone: Tombstone) -> Iterable[GoneCommand]:
    """Yield the commands that a Tombstone of whole commits keeps."""
    for part in tombstone.parts if tombstone.commits else ():
        seal = CommandSeal.unpacked(part.kept_digest)
        if part.channel == COMMIT_CHANNEL and seal is not None:
            yield GoneCommand(part.digest, seal, tombstone.first_event + seal.first)


def moved(parts: Iterable[LostPart], offset: int) -> tuple[LostPart, ...]:
    """Return parts of a Tombstone of whole commits for one that begins so many events earlier."""
    found = []
    for part in parts:
        seal = CommandSeal.unpacked(part.kept_digest)
        assert seal is not None, "each part of such a Tombstone has one"
        later = replace(seal, first=seal.first + offset)
        found.append(LostPart(part.channel, part.digest, later.packed()))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class LostPart:
    """A channel of a commit that lacks records."""

    channel: int
    digest: bytes
    """SHA-256 of all of its records in this commit, as they were written."""
    kept_digest: bytes
    """SHA-256 of those that are left; zeros if none is."""


@dataclass(frozen=True, slots=True)
class Tombstone:
    """Whole commits that are gone; or what the commit lacks whose Commit follows."""

    first_event: int
    """Number of the first event of these commits."""
    count: int
    """How many events they had."""
    commits: int
    """How many whole commits are gone; 0: it is about the one that follows."""
    events_gone: int
    notes_gone: int
    """That are gone, or blank."""
    reasons: TrimReason
    previous_hash: bytes = NO_HASH
    hash: bytes = NO_HASH
    """Of a commit that lacks records: the seal of its command (`gone_commands`)."""
    parts: tuple[LostPart, ...] = ()
    """Channel ids ascending; of whole commits: the commands that can be sent again."""

    @property
    def next_event(self) -> int:
        """Number of the first event after these commits."""
        return self.first_event + self.count

    def record(self, time_ns: int) -> bytes:
        """Return its Message record.

        Args:
            time_ns: Its log time: of the last record that is gone, or before it.
        """
        fields = {
            "first_event": self.first_event,
            "count": self.count,
            "commits": self.commits,
            "events_gone": self.events_gone,
            "notes_gone": self.notes_gone,
            "reasons": int(self.reasons),
            "previous_hash": self.previous_hash,
            "hash": self.hash,
            "channel": np.array([part.channel for part in self.parts], np.uint16),
            "digest": b"".join(part.digest for part in self.parts),
            "kept_digest": b"".join(part.kept_digest for part in self.parts),
        }
        data = write_message(type_name("Tombstone"), fields)
        return mcap.message(TOMBSTONE_CHANNEL, self.next_event - 1, time_ns, time_ns, data)

    @classmethod
    def in_record(cls, record: bytes | memoryview) -> Tombstone:
        """Return what a Message record holds; `check` whether that can be.

        Raises:
            ValueError: It is no tombstone.
        """
        said: dict[str, Any] = read_message(type_name("Tombstone"), record[mcap.MESSAGE.size :])
        channels = said.pop("channel").tolist()
        digests, kept = (_each(said.pop(name), len(channels)) for name in ("digest", "kept_digest"))
        reasons = TrimReason(said.pop("reasons"))
        previous_hash, its_hash = bytes(said.pop("previous_hash")), bytes(said.pop("hash"))
        parts = tuple(map(LostPart, channels, digests, kept))
        return cls(**said, reasons=reasons, previous_hash=previous_hash, hash=its_hash, parts=parts)

    def check(self) -> None:
        """Check that something is gone, as far as this Tombstone shows.

        Raises:
            ValueError: Nothing is, or more than there was: no trimming leaves such a Tombstone.
        """
        if self.events_gone > self.count:
            raise ValueError("a Tombstone of more events than there were")
        if not self.reasons:
            raise ValueError("a Tombstone without a reason")
        if self.commits:
            if self.events_gone != self.count or not self.count:
                raise ValueError("a Tombstone of whole commits, some of whose events are not gone")
        elif not (self.events_gone or self.notes_gone):
            raise ValueError("a Tombstone with nothing gone")
        elif self.parts and all(part.digest == part.kept_digest for part in self.parts):
            raise ValueError("a Tombstone of channels that lack nothing")


def read_tombstone(record: bytes | memoryview, path: PurePath) -> Tombstone:
    """Return what a Message record of a segment holds.

    Raises:
        CorruptLogError: It is no tombstone.
    """
    try:
        found = Tombstone.in_record(record)
        found.check()
    except ValueError as error:
        raise CorruptLogError(path, None, f"a Tombstone that cannot be: {error}") from None
    return found


@dataclass(slots=True)
class TombstoneSum:
    """The sum of what the tombstones of a log state."""

    events: int = 0
    notes: int = 0
    commits: int = 0
    """Whole ones."""
    reasons: TrimReason = TrimReason(0)  # noqa: RUF009 - a flag, which never changes
    digest: Any = field(default_factory=hashlib.sha256)
    """Of the data of all, in order."""

    def add(self, tombstone: Tombstone, record: bytes | memoryview) -> None:
        """Take in the next one, and its Message record."""
        self.events += tombstone.events_gone
        self.notes += tombstone.notes_gone
        self.commits += tombstone.commits
        self.reasons |= tombstone.reasons
        self.digest.update(record[mcap.MESSAGE.size :])


def _each(joined: Any, count: int) -> list[bytes]:
    data = bytes(joined)
    if len(data) != count * HASH_BYTES:
        raise ValueError(f"a Tombstone with {len(data)} bytes for {count} digests")
    return [data[at : at + HASH_BYTES] for at in range(0, len(data), HASH_BYTES)]
