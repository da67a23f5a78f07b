"""closed-2-26.json: how far a log reached when a segment was closed; the last one counts.

A closed segment that was cut looks like a live one, and a log without its last file looks like a
shorter log: their bytes do not show it. So closing a segment also writes down, and syncs before
`close` returns, which segment it was, the number of the event after it, and the hash of its last
commit. A log that ends earlier, or that has another commit there, has changed. Compaction
and merges do not change this. A log without such a file (copied without it, or older than it) is
read as it is.

Each mark is a file of its own, named after what it states, and never changes under that name. So
`cp -r`, which lists the names first and then copies file by file, cannot copy a mark that is ahead
of its segments: the segment that a listed mark names was closed before the list was made. Earlier
marks stay for a while, so that a copy under way finds one that it has listed.

A mark is a JSON object that contains the SHA-256 of its other entries: a changed one is noticed.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import PurePath
from typing import Any

from semmap_log.core.texts import command_line
from semmap_log.errors import CorruptLogError
from semmap_log.store import byte_layout
from semmap_log.store.folder import LogFolder

MOST_BYTES = 4096
"""A mark has some 250."""
KEPT_S = 3600
"""So long a mark stays that another has followed: a copy of the folder may take as long."""
_ONE_IN_S = 600
"""Of the marks of so long a time the first stays: a thousand commands leave few files …"""
_LAST_KEPT = 20
"""… and of all these that are the last: so `cp` seldom says that one has gone."""
_MOST_LOOKS = 20
"""So often the folder is listed, if what was listed has gone: others have followed it."""


@dataclass(frozen=True, slots=True)
class ClosedMark:
    """What is known of the closed part of a log."""

    log_id: str
    segment: int
    """Number of the last closed segment."""
    next_event: int
    """Number of the first event after it."""
    head: str
    """Hash of its last commit, in hexadecimal digits."""

    @property
    def file(self) -> str:
        """Name of the file in which it is written."""
        return byte_layout.mark_name(self.segment, self.next_event)

    @property
    def place(self) -> tuple[int, int]:
        """What grows from mark to mark of a log."""
        return self.segment, self.next_event

    def text(self) -> str:
        """Return the file's text."""
        entries = {
            "log_id": self.log_id,
            "segment": self.segment,
            "next_event": self.next_event,
            "head": self.head,
        }
        return sealed(entries)


def write_mark(folder: LogFolder, mark: ClosedMark) -> None:
    """Add a mark after the earlier ones; it survives a power cut. Old ones are removed.

    Only for who holds the writer's lock.

    Raises:
        OSError: As the system says.
    """
    folder.write_atomic(mark.file, [mark.text().encode()])
    with suppress(OSError):  # they cost nothing but room
        for name in _superseded(folder, time.time()):
            folder.remove(name)


def _superseded(folder: LogFolder, now_s: float) -> list[str]:
    """Return the marks that no copy under way can need any more.

    Of the marks that a copy has listed, one must stay until the copy is made. Those that were
    followed by another within the hour are candidates: the first of every ten minutes stays.
    """
    names = _names(folder)
    written = {name: folder.status(name).st_mtime for name in names}
    gone: list[str] = []
    times: set[float] = set()
    for place, (name, follower) in enumerate(pairwise(names)):
        time_s = written[name] // _ONE_IN_S
        is_crowded = time_s in times and place < len(names) - _LAST_KEPT
        if now_s - written[follower] > KEPT_S or is_crowded:
            gone.append(name)
        else:
            times.add(time_s)
    return gone


def read_mark(folder: LogFolder) -> ClosedMark | None:
    """Return what a log's folder says of its closed part; None: nothing.

    Raises:
        CorruptLogError: It is not what was written.
        OSError: The folder cannot be listed.
    """
    for _ in range(_MOST_LOOKS):
        names = listed_marks(folder)
        found = last_mark(names, partial(read_named_mark, folder))
        if found is not None or not names:
            return found
    return None


def listed_marks(folder: LogFolder) -> list[str]:
    """Return the names of the marks that count: the last, and the one of older versions.

    Raises:
        OSError: The folder cannot be listed.
    """
    return those_that_count(_names(folder))


def those_that_count(names: Sequence[str]) -> list[str]:
    """Return of all marks, by name, the last one, and the one of older versions."""
    return [name for name in names if name in (names[-1], byte_layout.OLD_MARK_NAME)]


def last_mark(names: Sequence[str], read: Callable[[str], ClosedMark | None]) -> ClosedMark | None:
    """Return the last of some marks, or None if none exists any more.

    Args:
        names: Theirs.
        read: Returns one; None: it was removed meanwhile, as one that another has followed.

    Raises:
        CorruptLogError: It is not what was written.
    """
    found = [mark for name in names if (mark := read(name)) is not None]
    return max(found, key=lambda mark: mark.place, default=None)


def _names(folder: LogFolder) -> list[str]:
    try:
        return byte_layout.mark_names(folder.names())
    except (FileNotFoundError, NotADirectoryError):
        return []


def read_named_mark(folder: LogFolder, name: str) -> ClosedMark | None:
    """Return one mark, by its name; None: it is not there.

    Raises:
        CorruptLogError: It is not what was written.
    """
    try:
        data = folder.read_bytes(name, MOST_BYTES)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise _damaged(folder / name, f"it cannot be read: {error.strerror or error}") from error
    return mark_in(data, folder / name)


def mark_in(data: bytes, file: PurePath) -> ClosedMark:
    """Return the mark that a file's bytes are.

    Args:
        data: Its bytes.
        file: Where it lies, for messages.

    Raises:
        CorruptLogError: They are not what was written.
    """
    try:
        mark = ClosedMark(**unsealed(json.loads(data)))
        fits = len(bytes.fromhex(mark.head)) == byte_layout.HASH_BYTES and min(mark.place) >= 0
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        fits = False
    if not fits:
        raise _damaged(file, "it is not what was written")
    return mark


def _damaged(file: PurePath, problem: str) -> CorruptLogError:
    unknown = "it is unknown whether the log was cut"
    line = command_line("recover", file.parent)
    return CorruptLogError(file, None, f"{problem}: {unknown}. To accept it as it is: {line}")


def sealed(entries: Mapping[str, Any]) -> str:
    """Return the text of the entries, followed by their digest."""
    return json.dumps({**entries, byte_layout.DIGEST_KEY: _digest(entries)}) + "\n"


def unsealed(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of an object that was read, without the digest.

    Raises:
        ValueError: The digest does not fit them.
        KeyError: It has no digest.
    """
    entries = dict(found)
    if entries.pop(byte_layout.DIGEST_KEY) != _digest(entries):
        raise ValueError("its digest does not fit it")
    return entries


def _digest(entries: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()
