"""What stands in a trimmed segment for records that are gone."""

from __future__ import annotations

import hashlib
from dataclasses import field
from pathlib import PurePath
from typing import Any

import numpy as np

from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.messages import read_message, type_name, write_message
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.form import HASH_BYTES, NO_HASH, TOMBSTONE_CHANNEL
from semmap_log.store.header import TrimReason


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
        """Number of the first event behind these commits."""
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
        """Return if something is gone, as far as this tells.

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
class TakenOut:
    """What the tombstones of a log tell, all together."""

    events: int = 0
    notes: int = 0
    commits: int = 0
    """Whole ones."""
    reasons: TrimReason = TrimReason(0)
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
