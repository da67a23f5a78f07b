"""What a key has signed last of each log, kept in KEY.state: outside of the logs' folders.

Whoever can write to a log can put back an older one, with its older statements: the signer knows
better. The state is written, and synced, before the statement: a statement that a crash has
prevented is made from it by the next signing.

`Signer` signs a log: statement after statement, each after the last that the key's state knows.
"""

from __future__ import annotations

import hashlib
import json
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from semmap_log.core.io.disk import PLAIN, output_errors, read_own, replace_file
from semmap_log.errors import OutputError, SigningError
from semmap_log.log.signing import signature_folder
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.statement import (
    HEADS,
    NO_DIGEST,
    NONE,
    OldStatement,
    Statement,
    read_statement,
)
from semmap_log.store.closed_mark import sealed, unsealed


@dataclass(frozen=True, slots=True)
class Reach:
    """How far a log is to be signed, and what it holds up to there."""

    next_event: int
    head: bytes
    commits: int
    taken: bytes


class Signer:
    """A key, its state, which is held, and a log."""

    def __init__(self, log: Path, log_id: str, key: SigningKey, state: SignerState) -> None:
        self.log_id = log_id
        self._log = log
        self._key = key
        self._state = state
        own = [
            one
            for one in signature_folder.signed_in(log, log_id)
            if one.public_bytes == key.public_bytes
        ]
        self._old = [one for one in own if isinstance(one.statement, OldStatement)]
        self._own = [one for one in own if isinstance(one.statement, Statement)]

    @property
    def last(self) -> LastSigned | None:
        """What the state knows as signed last."""
        return self._state.last(self.log_id)

    @property
    def base(self) -> Statement | OldStatement | None:
        """What was signed last of this log; None: this key has signed nothing of it."""
        if self.last is not None:
            return self.last.statement
        own = self._own or self._old
        return max(own, key=_order).statement if own else None

    @property
    def is_lost(self) -> bool:
        """Whether statements of this key are there, and its state does not know the log."""
        return self.last is None and bool(self._own)

    def take_up(self) -> None:
        """Take the last statement that is there for what the state would have known."""
        if self.is_lost:
            found = max(self._own, key=_order)
            assert isinstance(found.statement, Statement)
            name = found.path.name
            self._state.put(LastSigned(found.statement.text, found.namespace, name, is_kept=True))

    def mend(self) -> list[Path]:
        """Write the last statement that is to be kept, if a crash has prevented that."""
        last = self.last
        if (
            last is None
            or not last.is_kept
            or (signature_folder.folder_of(self._log) / last.file).exists()
        ):
            return []
        return [
            signature_folder.write_signed(
                self._log, last.file, last.text, self._key, last.namespace
            )
        ]

    def put(
        self,
        reach: Reach,
        *,
        adopted: tuple[int, int] | None = None,
        namespace: str = HEADS,
        keep: bool = True,
        next_key: str = NONE,
    ) -> Path:
        """Sign the log up to there, and return the statement's file.

        Args:
            reach: How far, and what it holds.
            adopted: First and last event of those that were only found there.
            namespace: What the signature is good for.
            keep: Whether the next statement leaves this one there.
            next_key: The public key that goes on in the place of this one.

        Raises:
            SigningError: The state cannot be written; or this key has named its successor.
            OutputError: The disk does not take them.
        """
        self.mend()
        last = self.last
        if last is not None and last.statement.next_key != NONE:
            successor = last.statement.next_key
            raise SigningError(f"{self._log}: this key's successor signs it now: {successor}")
        number = 0 if last is None else last.statement.number + 1
        statement = Statement(
            self.log_id, number, reach.commits, reach.next_event, reach.head.hex(),
            reach.taken.hex(), adopted, self._before(last), next_key,
        )  # fmt: skip
        name = signature_folder.name_of(statement, self._key, namespace)
        self._state.put(LastSigned(statement.text, namespace, name, keep))
        path = signature_folder.write_signed(self._log, name, statement.text, self._key, namespace)
        if last is not None and not self._stays(last):
            signature_folder.remove_signed(self._log, last.file)
        return path

    def _stays(self, last: LastSigned) -> bool:
        """Return whether the last statement is kept: it was made for that, or has a time stamp."""
        return last.is_kept or signature_folder.is_stamped(self._log, last.file)

    def _before(self, last: LastSigned | None) -> str:
        """Return the digest of the last statement that is kept."""
        if last is None:
            return max(self._old, key=_order).digest if self._old else NO_DIGEST
        if self._stays(last):
            return hashlib.sha256(last.text.encode()).hexdigest()
        return last.statement.before


def _order(one: signature_folder.SignedStatement) -> tuple[int, int]:
    said = one.statement
    return (said.number if isinstance(said, Statement) else -1), said.next_event


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
