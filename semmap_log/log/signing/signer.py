"""Who signs a log: statement after statement, each after the last that the key's state knows."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from semmap_log.errors import SigningError
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.signature_folder import (
    SignedStatement,
    folder_of,
    name_of,
    remove_signed,
    signed_in,
    write_signed,
)
from semmap_log.log.signing.signer_state import LastSigned, SignerState
from semmap_log.log.signing.ssh_signature import HEADS
from semmap_log.log.signing.statement import NO_DIGEST, NONE, OldStatement, Statement


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
        own = [one for one in signed_in(log, log_id) if one.public_bytes == key.public_bytes]
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
        if last is None or not last.is_kept or (folder_of(self._log) / last.file).exists():
            return []
        return [write_signed(self._log, last.file, last.text, self._key, last.namespace)]

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
        name = name_of(statement, self._key, namespace)
        self._state.put(LastSigned(statement.text, namespace, name, keep))
        path = write_signed(self._log, name, statement.text, self._key, namespace)
        if last is not None and not last.is_kept:
            remove_signed(self._log, last.file)
        return path

    def _before(self, last: LastSigned | None) -> str:
        """Return the digest of the last statement that is kept."""
        if last is None:
            return max(self._old, key=_order).digest if self._old else NO_DIGEST
        if last.is_kept:
            return hashlib.sha256(last.text.encode()).hexdigest()
        return last.statement.before


def _order(one: SignedStatement) -> tuple[int, int]:
    said = one.statement
    return (said.number if isinstance(said, Statement) else -1), said.next_event
