"""A log verified against its signatures: is it what was signed, all of it, and by whom?

A statement says which commit ends where; the log is read byte for byte, as `verify` does, and must
have that commit there. Who removes the newest events together with their signatures leaves a log
that fits: that shows against statements that were kept elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import TypeGuard

from semmap_log.common.texts import command_line, counted
from semmap_log.io.progress import Progress
from semmap_log.replay.care import verify
from semmap_log.signing.head_statement import HeadStatement
from semmap_log.signing.public_keys import PublicKey, fingerprint
from semmap_log.signing.signature_folder import (
    FOLDER,
    BadSignature,
    SignedStatement,
    read_all,
    statement_files,
)
from semmap_log.store.verification.findings import Finding, Severity, Verification

_ATTEMPTS = 3
"""How often to begin anew when somebody signs meanwhile, and what is signed now is missing."""

_Read = Sequence[SignedStatement | BadSignature]


@dataclass(frozen=True, slots=True)
class SignedVerification:
    """What reading a log and its signatures has shown."""

    found: Verification
    """Of the log; its findings are also those about signatures."""
    statements: int
    """Statements that were read."""
    good: int
    """Those that a believed key has signed, and that the log holds."""
    signed_before: int
    """Events below this number are vouched for."""
    by: tuple[PublicKey, ...]
    """Whose signatures those are."""


def verify_signed(
    log: PurePath,
    keys: Mapping[bytes, PublicKey],
    *,
    elsewhere: Sequence[Path] = (),
    head: bytes | None = None,
    progress: Progress | None = None,
) -> SignedVerification:
    """Read all of a log and compare it with what was signed; nothing is written.

    Args:
        log: The log's folder; a zip or a URL of it has only the statements from elsewhere.
        keys: Whom to believe, by the bytes of their keys.
        elsewhere: Folders with statements, or single ones, that were kept outside of the log.
        head: As for `verify`.
        progress: As for `verify`.

    Raises:
        SigningError: What lies elsewhere cannot be read.
        LogError: As `verify`.
    """
    for attempt in range(_ATTEMPTS):
        files = _files(log, elsewhere)
        read = list(read_all(files))
        found = verify(log, head, progress, ends=_ends_of(read))
        checked = _Check(log, found, keys).run(read)
        is_behind = checked.signed_before < found.closed_before
        if not is_behind or attempt == _ATTEMPTS - 1 or _files(log, elsewhere) == files:
            break
    return checked


def _files(log: PurePath, elsewhere: Sequence[Path]) -> list[Path]:
    own = log / FOLDER
    places = [own] if isinstance(own, Path) and own.is_dir() else []
    return [file for place in (*places, *elsewhere) for file in statement_files(place)]


def _ends_of(read: _Read) -> set[int]:
    """Return the numbers before which statements say that a commit ends."""
    said = [one.statement for one in read if isinstance(one, SignedStatement)]
    return {number for one in said for number in (one.first_event, one.next_event)}


class _Check:
    """The statements, compared with one reading of the log."""

    def __init__(self, log: PurePath, found: Verification, keys: Mapping[bytes, PublicKey]) -> None:
        self._log = log
        self._found = found
        self._keys = keys
        self._findings: list[Finding] = []
        self._good: list[SignedStatement] = []

    def run(self, read: _Read) -> SignedVerification:
        """Return what follows."""
        if self._found.of(Severity.NOT_A_LOG):
            return SignedVerification(self._found, len(read), 0, 0, ())
        believed = [one for one in read if self._is_believed(one)]
        self._find_forks(believed)
        self._good = [one for one in believed if self._is_held(one)]
        signed = max((one.statement.next_event for one in self._good), default=0)
        self._find_unsigned(signed)
        by = {one.public_bytes: self._keys[one.public_bytes] for one in self._good}
        findings = sorted((*self._found.findings, *self._findings), key=lambda one: -one.severity)
        found = replace(self._found, findings=tuple(findings))
        return SignedVerification(found, len(read), len(self._good), signed, tuple(by.values()))

    def _is_believed(self, one: SignedStatement | BadSignature) -> TypeGuard[SignedStatement]:
        """Tell whether it is a statement about this log, by a key that is believed."""
        if isinstance(one, BadSignature):
            self._wrong(one.kind, one.path, one.problem)
        elif one.public_bytes not in self._keys:
            whose = fingerprint(one.public_bytes)
            self._wrong("signer", one.path, f"signed by a key that was not given, {whose}")
        elif one.statement.log_id != self._found.log_id:
            other = one.statement.log_id
            self._wrong(
                "statement", one.path,
                f"about another log: expected the log id {self._found.log_id}, got {other}",
            )  # fmt: skip
        else:
            return True
        return False

    def _find_forks(self, believed: Sequence[SignedStatement]) -> None:
        """Find what one key has said twice about the same event, and differently."""
        said: dict[tuple[bytes, int], SignedStatement] = {}
        for one in believed:
            other = said.setdefault((one.public_bytes, one.statement.next_event), one)
            if other.statement.head != one.statement.head:
                last = one.statement.next_event - 1
                whose = self._keys[one.public_bytes]
                self._wrong(
                    "fork", one.path,
                    f"{whose} has signed two heads at event {last}, here and in {other.path}: the "
                    "log was forked: two copies of it were written to, each in its own way",
                )  # fmt: skip

    def _is_held(self, one: SignedStatement) -> bool:
        """Tell whether the log holds what a statement says."""
        said, found = one.statement, self._found
        last = said.next_event - 1
        whose = self._keys[one.public_bytes]
        if said.next_event > found.next_event:
            self._wrong(
                "rollback", one.path,
                f"{whose} has signed events up to {last}, and the log ends with event "
                f"{found.next_event - 1}: it was rolled back to an earlier state, or cut",
                (found.next_event, last),
            )  # fmt: skip
            return False
        if said.next_event < found.first_event:
            text = "about a part of the log that was removed from here, and was not read now"
            self._findings.append(_finding("removed", Severity.NOTE, one.path, text))
            return False
        end = found.ends.get(said.next_event)
        if end is None or end.head.hex() != said.head:
            got = "no commit ends there" if end is None else f"its hash is {end.head.hex()[:16]}…"
            self._wrong(
                "rewritten", one.path,
                f"{whose} has signed the commit {said.head[:16]}… that ends with event {last}, and "
                f"here {got}: the log was rewritten since, or is another branch (a fork) of it",
                (said.first_event, last),
            )  # fmt: skip
            return False
        return self._agrees(one)

    def _agrees(self, one: SignedStatement) -> bool:
        """Tell whether all that a statement says besides the head is so, too."""
        said, found = one.statement, self._found
        start, end = found.ends.get(said.first_event), found.ends[said.next_event]
        if said.first_event < found.first_event or end.recorded_ns is None:
            return True  # the stretch begins in a part that was removed from here
        if start is not None:
            expected = HeadStatement.between(
                said.log_id, said.first_event, said.next_event, start=start, end=end
            )
            if said == expected:
                return True
        text = "its head is the log's, but what else it says of these events is not so"
        self._wrong("statement", one.path, text)
        return False

    def _find_unsigned(self, signed: int) -> None:
        """Find what nobody vouches for: closed segments should be signed, a live one cannot be."""
        closed, end = self._found.closed_before, self._found.next_event
        if closed > signed:
            line = command_line("sign", self._log, "--key", "KEY")
            self._wrong(
                "unsigned", self._log,
                f"{counted(closed - signed, 'event')} in closed segments, and no signature of a "
                f"key that was given vouches for them; whoever has the key can: {line}",
                (signed, closed - 1),
            )  # fmt: skip
        if end > max(closed, signed):
            text = "in the live segment, which is signed once it is closed"
            events = (max(closed, signed), end - 1)
            self._findings.append(_finding("unsigned", Severity.NOTE, self._log, text, events))

    def _wrong(
        self, kind: str, path: PurePath, text: str, events: tuple[int, int] | None = None
    ) -> None:
        self._findings.append(_finding(kind, Severity.NOT_AS_SIGNED, path, text, events))


def _finding(
    kind: str,
    severity: Severity,
    path: PurePath,
    text: str,
    events: tuple[int, int] | None = None,
) -> Finding:
    return Finding(kind, severity, path, None, events, text)
