"""What a key has signed last of each log, kept in KEY.state: outside of the logs' folders.

Who can write to a log can put back an older one, with its older statements: the signer knows
better. The state is written, and synced, before the statement: one that a crash has prevented is
made from it by the next signing.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from semmap_log.core.io.disk import output_errors, read_own, replace_file
from semmap_log.core.io.file_calls import PLAIN
from semmap_log.errors import OutputError, SigningError
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.statement import Statement, read_statement
from semmap_log.store.sealed_json import sealed, unsealed

STATE_SUFFIX = ".state"
_VERSION = 1
_MOST_BYTES = 2**24


@dataclass(frozen=True, slots=True)
class LastSigned:
    """The last statement of a key about a log."""

    text: str
    namespace: str
    file: str
    """Its name in LOG/signatures."""
    is_kept: bool
    """Whether the next statement leaves it there."""

    @property
    def statement(self) -> Statement:
        """What it states."""
        found = read_statement(self.text.encode())
        assert isinstance(found, Statement), "no other is made"
        return found


class SignerState:
    """The state of one key; nobody else changes it as long as it is `held`."""

    _in_memory: dict[bytes, dict[str, LastSigned]] = {}  # noqa: RUF012 - of keys without a file
    _memory_lock = threading.Lock()

    def __init__(self, key: SigningKey) -> None:
        self._key_file = key.path
        self._logs: dict[str, LastSigned] = {}
        if key.path is None:
            self._logs = self._in_memory.setdefault(key.public_bytes, {})

    @classmethod
    @contextmanager
    def held(cls, key: SigningKey) -> Iterator[SignerState]:
        """Hand out the state of a key, and let no other signing with it in meanwhile.

        Raises:
            SigningError: It cannot be read, or is not what was written.
        """
        state = cls(key)
        if key.path is None:
            with cls._memory_lock:
                yield state
            return
        import fcntl

        fd = _opened(key.path)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX)
            state._logs = _read(_file(key.path))
            yield state
        finally:
            os.close(fd)

    @property
    def ends(self) -> set[int]:
        """The numbers after the last events that were signed."""
        return {one.statement.next_event for one in self._logs.values()}

    def last(self, log_id: str) -> LastSigned | None:
        """Return the last statement about a log; None: this key has signed nothing of it."""
        return self._logs.get(log_id)

    def put(self, last: LastSigned) -> None:
        """Write down that this is signed now.

        Raises:
            SigningError: It cannot be written.
        """
        self._logs[last.statement.log_id] = last
        if self._key_file is None:
            return
        file = _file(self._key_file)
        logs = {log_id: asdict(one) for log_id, one in sorted(self._logs.items())}
        try:
            with output_errors(file):
                replace_file(file, sealed({"version": _VERSION, "logs": logs}).encode())
        except OutputError as error:
            raise SigningError(f"{error} Nothing is signed without it.") from None


def _file(key_file: Path) -> Path:
    return key_file.with_name(key_file.name + STATE_SUFFIX)


def _opened(key_file: Path) -> int:
    try:
        return os.open(key_file, os.O_RDONLY | PLAIN)
    except OSError as error:
        problem = f"the private key cannot be opened: {error.strerror}"
        raise SigningError(f"{key_file}: {problem}.") from None


def _read(file: Path) -> dict[str, LastSigned]:
    try:
        data = read_own(file, _MOST_BYTES)
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise SigningError(f"{file}: what was signed last cannot be read: {error}.") from None
    try:
        found: dict[str, Any] = unsealed(json.loads(data))
        logs = {log_id: LastSigned(**said) for log_id, said in found["logs"].items()}
        fits = found["version"] == _VERSION and all(
            one.statement.log_id == log_id for log_id, one in logs.items()
        )
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, AssertionError):
        fits = False
    if not fits:
        raise SigningError(
            f"{file}: what was signed last with this key is not as it was written; put a copy "
            "back, or remove it and sign with --adopt."
        )
    return logs
