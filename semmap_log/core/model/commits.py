"""The plain nouns of a commit: events that become visible together, and their note."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TypeAlias

from semmap_log.core.model.rules import text_expected
from semmap_log.errors import InvalidEventError


class Durability(IntEnum):
    """What a writer promises of a commit when `append` returns."""

    EVENT = 0
    """It survives a power cut: synced before `append` returns."""
    BATCH = 1
    """It survives a power cut soon: synced with others, after so many events or so long."""
    FLUSH = 2
    """It survives the end of the process, however it ends, but not a power cut."""
    NONE = 3
    """It waits in memory until there is much to write, or somebody calls `sync` or `close`."""

    @classmethod
    def parse(cls, text: str | Durability) -> Durability:
        """Return the level of that name.

        Raises:
            InvalidEventError: There is no such level.
        """
        if isinstance(text, cls):
            return text
        try:
            return cls[str(text).upper()]
        except KeyError:
            names = ", ".join(level.name.lower() for level in cls)
            raise InvalidEventError("durability", f"one of {names}", text) from None


NO_CONTENT = bytes(16)
"""Digest of a command whose id the writer drew, so that it will not come again."""
GIVEN_EVENTS = b"\1" + bytes(15)
"""In place of the digest of a command that came with an id, and is known by its events."""


NOTE_TEXTS = ("actor", "source", "reason", "correlation")
"""The texts of a note."""

NoteTexts: TypeAlias = tuple[str, str, str, str]
"""The texts of a note; empty where nothing was given."""
NO_TEXTS: NoteTexts = ("", "", "", "")

MOST_NOTE_CHARACTERS = 4 * 2**20
"""Of all of a note's texts together: at most 16 MiB."""


@dataclass(frozen=True, slots=True)
class Note:
    """Who did it, with what, why; empty texts say nothing."""

    actor: str = ""
    source: str = ""
    """Which sensor, robot or file."""
    reason: str = ""
    correlation: str = ""
    """What it belongs to: a goal, a ticket, a round."""
    salt: bytes = field(default=b"", repr=False, compare=False)
    """16 random bytes, so that a redacted note cannot be guessed from its digest."""

    def __post_init__(self) -> None:
        for name in NOTE_TEXTS:
            check_text(f"Note.{name}", getattr(self, name))

    def __bool__(self) -> bool:
        return bool(self.actor or self.source or self.reason or self.correlation)

    def check_length(self) -> None:
        """Check that a log takes a note of this length; notes already in a log are not checked.

        Raises:
            InvalidEventError: It is too long.
        """
        length = sum(len(getattr(self, name)) for name in NOTE_TEXTS)
        if length > MOST_NOTE_CHARACTERS:
            expected = f"at most {MOST_NOTE_CHARACTERS} characters in all of its texts"
            raise InvalidEventError("Note", expected, length)


def check_text(where: str, text: str) -> None:
    """Check that a text can be stored.

    Raises:
        InvalidEventError: It is no text, or one that UTF-8 or a ROS string cannot hold.
    """
    expected = text_expected(text)
    if expected:
        raise InvalidEventError(where, expected, text)


@dataclass(frozen=True, slots=True)
class Commit:
    """A commit as the log holds it."""

    first_event: int
    count: int
    recorded_ns: int
    """Log time of its first record: when it is known, by the log's strictly increasing time."""
    closed_ns: int
    """Log time of its Commit record, the last of it."""
    command_id: bytes
    wall_clock_ns: int
    monotonic_clock_ns: int
    boot_id: bytes
    previous_hash: bytes
    hash: bytes
    durability: Durability = Durability.EVENT
    durable_before: int = 0
    """Events below this number were known to be on the disk when this commit was written."""
    content: bytes = NO_CONTENT
    """Digest of what the command requested; zeros where its id was drawn for it."""
    note: Note = Note()

    @property
    def last_event(self) -> int:
        """Number of its last event."""
        return self.first_event + self.count - 1


def content_of(*words: object) -> bytes:
    """Return the digest of what a command asks for, 16 bytes.

    Args:
        *words: Values whose `repr` says all about them.
    """
    return hashlib.sha256(repr(words).encode()).digest()[: len(NO_CONTENT)]


POSES_WAIT_S = 1.0
"""Robot poses join the next commit; without one, they are written after this time."""
