"""Which keys are believed, and which of their statements: with successors and revocations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from semmap_log.log.signing.signature_folder import BadSignature, SignedRevocation, SignedStatement
from semmap_log.log.signing.statement import (
    NONE,
    REVOKING,
    PublicKey,
    Statement,
    fingerprint,
    key_in_words,
)

Read = Sequence[SignedStatement | SignedRevocation | BadSignature]
"""What lies in folders of signatures."""


@dataclass(frozen=True, slots=True)
class Distrust:
    """Why a file does not count."""

    kind: str
    """As of a Finding."""
    path: Path
    text: str


@dataclass(frozen=True, slots=True)
class _Revoked:
    """From where on a key is revoked."""

    by: SignedRevocation
    last: Statement | None
    """The last statement that counts; None: none does."""


class Trust:
    """Whom to believe about one log."""

    def __init__(self, log_id: str, keys: Mapping[bytes, PublicKey], read: Read) -> None:
        """Take what is known.

        Args:
            log_id: Of the log.
            keys: Whom the user believes.
            read: What lies there.
        """
        self.keys = dict(keys)
        """Those, and the keys that they have named as their successors."""
        self._log_id = log_id
        self._read = read
        self._given = dict(keys)
        self._retired: dict[bytes, int] = {}
        """Keys that have named a successor -> the number of the statement that does."""
        self._revoked: dict[bytes, _Revoked] = {}
        self._wrong: list[Distrust] = []
        for one in read:
            if isinstance(one, SignedRevocation):
                self._revoke(one)
        self._believe_successors()

    def distrusted(self) -> Iterator[Distrust]:
        """Yield what does not count, each with its reason."""
        yield from self._wrong
        for one in self._read:
            if isinstance(one, BadSignature):
                yield Distrust(one.kind, one.path, one.problem)
            elif isinstance(one, SignedStatement) and (why := self._why_not(one)):
                yield why

    def believed(self) -> list[SignedStatement]:
        """Return the statements about this log by keys that are believed for them."""
        signed = [one for one in self._read if isinstance(one, SignedStatement)]
        return [one for one in signed if not self._why_not(one)]

    def _why_not(self, one: SignedStatement) -> Distrust | None:
        if why := self._why_not_signer(one.path, one.public_bytes, one.namespace, self.keys):
            return why
        key, said = self.keys[one.public_bytes], one.statement
        if said.log_id != self._log_id:
            return self._other_log(one.path, said.log_id)
        if why := self._why_revoked(one):
            return why
        retired = self._retired.get(one.public_bytes)
        if isinstance(said, Statement) and retired is not None and said.number > retired:
            text = f"{key} signed it after it had named its successor"
            return Distrust("signer", one.path, text)
        return None

    @staticmethod
    def _why_not_signer(
        path: Path, public_bytes: bytes, namespace: str, keys: Mapping[bytes, PublicKey]
    ) -> Distrust | None:
        key = keys.get(public_bytes)
        if key is None:
            text = f"signed by a key that was not given, {fingerprint(public_bytes)}"
            return Distrust("signer", path, text)
        if namespace not in key.namespaces:
            return Distrust(
                "signer", path,
                f"{key} is not believed for {namespace}; if it shall be, give an "
                f'allowed_signers file with this line: NAME namespaces="{namespace}" '
                f"{key.line.strip()}",
            )  # fmt: skip
        return None

    def _other_log(self, path: Path, log_id: str) -> Distrust:
        text = f"about another log: expected the log id {self._log_id}, got {log_id}"
        return Distrust("statement", path, text)

    def _revoke(self, one: SignedRevocation) -> None:
        """Take up a revocation, if it is one by an owner; of several the lowest number counts."""
        said = one.revocation
        why = self._why_not_signer(one.path, one.public_bytes, REVOKING, self._given)
        if why is None and said.log_id != self._log_id:
            why = self._other_log(one.path, said.log_id)
        if why is not None:
            self._wrong.append(why)
            return
        key = key_in_words(said.key)
        last = None if said.revokes_all else self._statement_of(key, said.last)
        if last is None and not said.revokes_all:
            text = "the last statement that counts, of the key that it revokes, is missing"
            self._wrong.append(Distrust("statement", one.path, text))
        before = self._revoked.get(key)
        if before is None or said.first < before.by.revocation.first:
            self._revoked[key] = _Revoked(one, last)

    def _statement_of(self, key: bytes, digest: str) -> Statement | None:
        for one in self._read:
            if isinstance(one, SignedStatement) and (one.public_bytes, one.digest) == (key, digest):
                return one.statement if isinstance(one.statement, Statement) else None
        return None

    def _why_revoked(self, one: SignedStatement) -> Distrust | None:
        """Return why a statement of a revoked key does not count; None: it came before that."""
        revoked = self._revoked.get(one.public_bytes)
        if revoked is None:
            return None
        said, last, by = one.statement, revoked.last, revoked.by
        number = said.number if isinstance(said, Statement) else -1
        counts = last is not None and number <= last.number and said.next_event <= last.next_event
        if counts and number < by.revocation.first:
            return None
        return Distrust(
            "revoked", one.path,
            f"{self.keys[one.public_bytes]} was revoked by {self.keys[by.public_bytes]} from its "
            f"statement {by.revocation.first} on ({by.path.name}), and this is none of those "
            "before. Compare the log with a copy from elsewhere; then move this file out of "
            "the folder, and sign with another key",
        )  # fmt: skip

    def _believe_successors(self) -> None:
        """Believe also the keys that believed ones have named, each from then on in its place.

        The first that a key has named is its successor.
        """
        naming = [
            (one, one.statement) for one in self._read
            if isinstance(one, SignedStatement) and isinstance(one.statement, Statement)
            and one.statement.next_key != NONE
        ]  # fmt: skip
        naming.sort(key=lambda pair: pair[1].number)
        is_new = True
        while is_new:
            is_new = False
            for one, said in naming:
                if self._why_not(one):
                    continue
                key = self.keys[one.public_bytes]
                self._retired[one.public_bytes] = said.number
                with suppress(ValueError):
                    successor = key_in_words(said.next_key)
                    is_new |= successor not in self.keys
                    owner = f"the successor of {key.owner or key.fingerprint}"
                    self.keys.setdefault(successor, PublicKey(successor, owner, key.namespaces))
