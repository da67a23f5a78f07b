r"""A fold's state and position in a file, to go on from later.

The file: a line `semmap-log checkpoint`, a line of JSON that says which log, which commit (by event
number and hash), which projection and version, then the state, then the sha256 of all of it. It
takes its name at once and synced, so that at any moment the last one that was saved is there.

It is a cache, and never used unless it fits:

- not a checkpoint, of another log, of another projection: an error, and the file is left alone;
- damaged, of another version, or of events that the log does not hold (a backup was put back, and
  went on differently): a `CheckpointWarning`, and the fold begins at the log's start;
- a retraction since then hides what it has taken in, or something was redacted since then, which
  the state may still tell: the same, without a warning.
"""

from __future__ import annotations

import hashlib
import json
import re
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

from semmap_log.core.folds.projection import Dumping, Projection, name_of, version_of
from semmap_log.core.io.disk import (
    left_by_killed,
    output_errors,
    read_own,
    refuse_own_folder,
    replace_file,
)
from semmap_log.errors import CheckpointError, CheckpointWarning, OutputError
from semmap_log.log.replay.plain_state import dump_plain, load_plain
from semmap_log.log.replay.position import Position, Retraction
from semmap_log.store.reading.reader import LogReader

S = TypeVar("S")

MAGIC = b"semmap-log checkpoint\n"
FORM = 1
"""Of the file; another's checkpoints are not used."""
DIGEST_BYTES = 32
START_BYTES = 256
"""Of a file: in them stands which log it is of."""


class Checkpoint(Generic[S]):
    """The file that keeps a projection's state in one log."""

    def __init__(self, path: Path, projection: Projection[S], reader: LogReader) -> None:
        """Name the file; nothing is read or written yet.

        Raises:
            OutputError: It cannot lie there.
        """
        folder = path.absolute().parent
        if not folder.is_dir():
            raise OutputError(f"{path}: there is no such folder; make it first.")
        refuse_own_folder(reader.folder, path)
        self.path = path
        self._projection = projection
        self._of = {
            "form": FORM,
            "log_id": reader.info.log_id,
            "projection": name_of(projection),
            "version": version_of(projection),
        }

    def load(self, reader: LogReader) -> tuple[Position, S] | None:
        """Return what was saved, if it is a state of the log as it is now.

        Raises:
            CheckpointError: The file is of something else, or cannot be read.
        """
        try:
            data = read_own(self.path)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise CheckpointError(f"{self.path}: cannot be read: {error.strerror}.") from error
        if not (data.startswith(MAGIC) or MAGIC.startswith(data)):
            raise CheckpointError(
                f"{self.path}: expected a checkpoint, got another file; it is left as it is. "
                "Choose another path."
            )
        try:
            head, stored = _taken_apart(data)
            if not self._fits(head):
                return None
            position, state = _position(head), self._load_state(stored)
        except (ValueError, LookupError, TypeError, MemoryError, RecursionError) as error:
            self._refuse(f"it is damaged: {error}")
            return None
        if position.is_before_redaction(reader):
            return None
        if not position.is_in(reader):
            self._refuse(
                f"the log does not hold the commit of event {position.event} that it goes on from: "
                "the log was put back, or exchanged"
            )
            return None
        return position, state

    def save(self, position: Position, state: S) -> None:
        """Put a state in the place of what was saved, whole or not at all; lasting on return.

        Raises:
            CheckpointError: The state cannot be stored.
            OutputError: The file cannot be written; the last one is whole.
        """
        head = self._of | {
            "event": position.event,
            "commit_hash": position.commit_hash.hex(),
            "latest_ns": position.latest_ns,
            "retractions": position.retractions,
        }
        whole = MAGIC + json.dumps(head).encode() + b"\n" + self._dump_state(state)
        with output_errors(self.path):
            for leftover in left_by_killed(self.path):
                leftover.unlink(missing_ok=True)
            replace_file(self.path, whole + hashlib.sha256(whole).digest())

    def _fits(self, head: Mapping[str, Any]) -> bool:
        """Tell whether a file is of this projection and log.

        Raises:
            CheckpointError: It is of others.
        """
        for key, what in (("log_id", "the log"), ("projection", "the projection")):
            if head[key] != self._of[key]:
                raise CheckpointError(
                    f"{self.path}: expected a checkpoint of {what} {self._of[key]}, got one of "
                    f"{head[key]}; choose another path."
                )
        for key in ("form", "version"):
            if head[key] != self._of[key]:
                self._refuse(f"it is of {key} {head[key]}, and {self._of[key]} is wanted")
                return False
        return True

    def _refuse(self, why: str) -> None:
        warnings.warn(
            f"{self.path}: the checkpoint is not used: {why}. The fold begins at the log's start.",
            CheckpointWarning,
            stacklevel=2,
        )

    def _dump_state(self, state: S) -> bytes:
        projection = self._projection
        return projection.dump(state) if isinstance(projection, Dumping) else dump_plain(state)

    def _load_state(self, data: bytes) -> S:
        projection = self._projection
        state: S = projection.load(data) if isinstance(projection, Dumping) else load_plain(data)
        return state


def log_id_of(start: bytes) -> str:
    """Return the id of the log that a file is a checkpoint of, by its first bytes; "": it is none.

    Args:
        start: The first `START_BYTES` of the file.
    """
    found = re.match(re.escape(MAGIC) + rb'\{"form": \d+, "log_id": "([0-9a-f]{32})"', start)
    return "" if found is None else found[1].decode()


def _taken_apart(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the head of a file, and the state in it.

    Raises:
        ValueError: It is not as it was written.
    """
    whole, digest = data[:-DIGEST_BYTES], data[-DIGEST_BYTES:]
    if not whole.startswith(MAGIC) or hashlib.sha256(whole).digest() != digest:
        raise ValueError("its sha256 is another")
    line, _, state = whole[len(MAGIC) :].partition(b"\n")
    head: dict[str, Any] = json.loads(line)
    return head, state


def _position(head: Mapping[str, Any]) -> Position:
    return Position(
        event=head["event"],
        commit_hash=bytes.fromhex(head["commit_hash"]),
        latest_ns=head["latest_ns"],
        retractions=tuple(Retraction(*one) for one in head["retractions"]),
    )
