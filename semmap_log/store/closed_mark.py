"""closed.json: how far a log reached when its last segment was closed.

A closed segment that was cut looks like a live one, and a log whose last file is gone like a
shorter log: their bytes do not tell. So whoever closes a segment writes down, and syncs before
`close` returns, which one it was, the number of the event behind it, and the hash of its last
commit. A log that ends before, or that has another commit there, is not what it was. Compaction
and merges change nothing of this; a log without the file (copied without it, or older than it) is
read as it is.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import PurePath

from semmap_log.common.late_dataclass import dataclass
from semmap_log.common.texts import command_line
from semmap_log.errors import CorruptLogError
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import CLOSED_MARK_NAME, HASH_BYTES
from semmap_log.store.sealed_json import sealed, unsealed

MOST_BYTES = 4096
"""A mark has some 250."""


@dataclass(frozen=True, slots=True)
class ClosedMark:
    """What is known of the closed part of a log."""

    log_id: str
    segment: int
    """Number of the last closed segment."""
    next_event: int
    """Number of the first event behind it."""
    head: str
    """Hash of its last commit, in hexadecimal digits."""

    def text(self) -> str:
        """Return the file's text."""
        return sealed(asdict(self))


def write_mark(folder: LogFolder, mark: ClosedMark) -> None:
    """Put a mark in place of the one before; it survives a power cut.

    Raises:
        OSError: As the system says.
    """
    folder.write_whole(CLOSED_MARK_NAME, [mark.text().encode()])


def read_mark(folder: LogFolder) -> ClosedMark | None:
    """Return what a log's folder says of its closed part; None: nothing.

    Raises:
        CorruptLogError: It is not what was written.
    """
    try:
        data = folder.read_bytes(CLOSED_MARK_NAME, MOST_BYTES)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise _damaged(folder.path, f"it cannot be read: {error.strerror or error}") from error
    return mark_in(data, folder.path)


def mark_in(data: bytes, log: PurePath) -> ClosedMark:
    """Return the mark that a file's bytes are.

    Args:
        data: Its bytes.
        log: Where the log lies, for messages.

    Raises:
        CorruptLogError: They are not what was written.
    """
    try:
        mark = ClosedMark(**unsealed(json.loads(data)))
        fits = len(bytes.fromhex(mark.head)) == HASH_BYTES
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        fits = False
    if not fits:
        raise _damaged(log, "it is not what was written")
    return mark


def _damaged(log: PurePath, problem: str) -> CorruptLogError:
    unknown = "whether the log is as long as it was cannot be told"
    problem = f"{problem}: {unknown}. To take it as it is: {command_line('recover', log)}"
    return CorruptLogError(log / CLOSED_MARK_NAME, None, problem)
