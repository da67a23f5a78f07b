"""Verifies a log against its signatures: is it what was signed, all of it, and by whom?

A statement says which commit ends where, and what was taken out; the log is read byte for byte, as
`verify` does, and must contain that. Removing the newest events together with their signatures
leaves a log that fits: that shows against statements that were kept elsewhere. Also decides which
keys are believed, and which of their statements: with successors and revocations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path, PurePath

from semmap_log.core.io.progress import Progress
from semmap_log.core.texts import command_line, counted
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.signing import signature_folder
from semmap_log.log.signing.statement import (
    NO_DIGEST,
    NONE,
    REVOKING,
    TRIMMING,
    OldStatement,
    PublicKey,
    Statement,
    fingerprint,
    key_from_text,
)
from semmap_log.store.verification.findings import Finding, Severity, Verification

_ATTEMPTS = 3
"""How often to begin again when the log is signed meanwhile, and the new part is missing."""


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
    times: tuple[tuple[Path, str | None], ...] = ()
    """The good statements, each with the time of its time stamp, whose signature is not checked
    here; None: it has none."""


def verify_signed(
    log: PurePath,
    keys: Mapping[bytes, PublicKey],
    *,
    elsewhere: Sequence[Path] = (),
    head: bytes | None = None,
    allow_unsigned_end: bool = False,
    progress: Progress | None = None,
) -> SignedVerification:
    """Read all of a log and compare it with what was signed; nothing is written.

    Args:
        log: The log's folder; a zip or a URL of it has only the statements from elsewhere.
        keys: Whom to believe, by the bytes of their keys.
        elsewhere: Folders with statements, or single ones, that were kept outside of the log.
        head: As for `verify`.
        allow_unsigned_end: Whether events after all that is signed are no more than a note.
        progress: As for `verify`.

    Raises:
        SigningError: What lies elsewhere cannot be read.
        LogError: As `verify`.
    """
    for attempt in range(_ATTEMPTS):
        files = _files(log, elsewhere)
        read = list(signature_folder.read_all(files))
        found = verify(log, head, progress, ends=_ends_of(read))
        checked = _Check(log, found, keys, allow_unsigned_end=allow_unsigned_end).run(read)
        is_behind = checked.found.exit_code or checked.signed_before < found.next_event
        if not is_behind or attempt == _ATTEMPTS - 1 or _files(log, elsewhere) == files:
            break
    return checked


def _files(log: PurePath, elsewhere: Sequence[Path]) -> list[Path]:
    own = log / signature_folder.FOLDER
    places = [own] if isinstance(own, Path) and own.is_dir() else []
    return [
        file for place in (*places, *elsewhere) for file in signature_folder.statement_files(place)
    ]


def _ends_of(read: Read) -> set[int]:
    """Return the numbers before which statements say that a commit ends."""
    said = [one.statement for one in read if isinstance(one, signature_folder.SignedStatement)]
    starts = {one.first_event for one in said if isinstance(one, OldStatement)}
    return starts | {one.next_event for one in said}


class _Check:
    """The statements, compared with one reading of the log."""

    def __init__(
        self,
        log: PurePath,
        found: Verification,
        keys: Mapping[bytes, PublicKey],
        *,
        allow_unsigned_end: bool,
    ) -> None:
        self._log = log
        self._found = found
        self._keys = dict(keys)
        self._allow_unsigned_end = allow_unsigned_end
        self._findings: list[Finding] = []
        self._good: list[signature_folder.SignedStatement] = []

    def run(self, read: Read) -> SignedVerification:
        """Return what follows."""
        statements = sum(not isinstance(one, signature_folder.SignedRevocation) for one in read)
        if self._found.of(Severity.NOT_A_LOG):
            return SignedVerification(self._found, statements, 0, 0, ())
        trust = Trust(self._found.log_id, self._keys, read)
        self._keys = trust.keys
        for why in trust.distrusted():
            self._wrong(why.kind, why.path, why.text)
        believed = trust.believed()
        self._find_forks(believed)
        self._find_missing(believed)
        self._good = [one for one in believed if self._is_held(one)]
        signed = max((one.statement.next_event for one in self._good), default=0)
        self._find_taken_out()
        self._find_adopted()
        self._find_unsigned(signed)
        times = tuple((one.path, self._time_of(one)) for one in self._good)
        by = {one.public_bytes: self._keys[one.public_bytes] for one in self._good}
        # What a head alone does not bind was looked at above.
        own = [one for one in self._found.findings if one.kind != "taken-out"]
        findings = sorted((*own, *self._findings), key=lambda one: -one.severity)
        found = replace(self._found, findings=tuple(findings))
        good = len(self._good)
        return SignedVerification(found, statements, good, signed, tuple(by.values()), times)

    def _time_of(self, one: signature_folder.SignedStatement) -> str | None:
        """Return the time of a statement's time stamp, if it has one."""
        try:
            return signature_folder.time_of(one)
        except ValueError as error:
            self._wrong("timestamp", signature_folder.token_file(one.path), str(error))
            return None

    def _find_forks(self, believed: Sequence[signature_folder.SignedStatement]) -> None:
        """Find contradictions of one key: about one event, or under one number."""
        heads: dict[tuple[bytes, int], signature_folder.SignedStatement] = {}
        numbers: dict[tuple[bytes, int], signature_folder.SignedStatement] = {}
        for one in believed:
            said, whose = one.statement, self._keys[one.public_bytes]
            other = heads.setdefault((one.public_bytes, said.next_event), one)
            what = f"two heads at event {said.next_event - 1}"
            is_fork = other.statement.head != said.head
            if isinstance(said, Statement) and not is_fork:
                other = numbers.setdefault((one.public_bytes, said.number), one)
                what = f"two statements of number {said.number}"
                is_fork = other.digest != one.digest
            if is_fork:
                self._wrong(
                    "fork", one.path,
                    f"{whose} has signed {what}, here and in {other.path}: the log was forked: two "
                    "copies of it, or of the key, were used, each in its own way",
                )  # fmt: skip

    def _find_missing(self, believed: Sequence[signature_folder.SignedStatement]) -> None:
        """Find statements whose predecessor, by the same key, is not there."""
        known = {(one.public_bytes, one.digest) for one in believed}
        for one in believed:
            said = one.statement
            if not isinstance(said, Statement) or said.before == NO_DIGEST:
                continue
            if (one.public_bytes, said.before) not in known:
                text = "the statement that its key signed before this one is missing, or not good"
                self._wrong("statement", one.path, text)

    def _is_held(self, one: signature_folder.SignedStatement) -> bool:
        """Return whether the log contains what a statement says."""
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
        if said.next_event in found.ends_gone:
            text = f"about the commit that ended with event {last}, which was taken out since"
            self._findings.append(_finding("removed", Severity.NOTE, one.path, text))
            return False
        end = found.ends.get(said.next_event)
        if end is None or end.head.hex() != said.head:
            got = "no commit ends there" if end is None else f"its hash is {end.head.hex()[:16]}…"
            first = said.first_event if isinstance(said, OldStatement) else 0
            self._wrong(
                "rewritten", one.path,
                f"{whose} has signed the commit {said.head[:16]}… that ends with event {last}, and "
                f"here {got}: the log was rewritten since, or is another branch (a fork) of it",
                (first, last),
            )  # fmt: skip
            return False
        return self._agrees(one)

    def _agrees(self, one: signature_folder.SignedStatement) -> bool:
        """Return whether everything that a statement says besides the head is true, too."""
        said, found = one.statement, self._found
        end = found.ends[said.next_event]
        if isinstance(said, Statement):
            is_so = said.agrees(end, counts_all=not found.first_event)
        else:
            start = found.ends.get(said.first_event)
            was_read = said.first_event >= found.first_event and end.recorded_ns is not None
            if not was_read or said.first_event in found.ends_gone:
                return True  # the stretch begins in a part that was removed from here
            is_so = start is not None and said.agrees(start, end)
        if not is_so:
            text = "its head is the log's, but its other values for these events are wrong"
            self._wrong("statement", one.path, text)
        return is_so

    def _find_taken_out(self) -> None:
        """Find what was taken out, or put back, and no officer's statement vouches for."""
        found = self._found
        if found.first_event:  # what was taken out of the part that was removed was not read
            if found.taken_before:
                text = "not vouched for: what was taken out; fetch the whole log, and verify that"
                self._wrong("taken-out", self._log, text)
            return
        said = [one for one in self._good if isinstance(one.statement, Statement)]
        fits = [one for one in said if self._taken_at(one) == one.statement.taken]  # type: ignore[union-attr]
        newest = max(said, key=_order, default=None)
        if newest is not None and newest not in fits:
            self._wrong(
                "taken-out", newest.path,
                "what was taken out, the horizon, its keyframe, or what the heads say (time zone, "
                "building, robot) is not what was signed: something was taken out, put back or "
                "changed since without an officer's statement",
            )  # fmt: skip
        if not found.taken_before:
            return
        officers = [one for one in fits if one.namespace == TRIMMING]
        if any(one.statement.next_event >= found.taken_before for one in officers):
            return
        line = command_line("sign", self._log, "--key", "OFFICER_KEY", "--adopt")
        self._wrong(
            "taken-out", self._log,
            f"not vouched for: {counted(found.ends[found.next_event].unvouched, 'record')} that "
            f"{counted(found.events_gone, 'event')} and {counted(found.notes_gone, 'note')} taken "
            f"out have left unbound, and no officer's statement covers exactly these "
            f"removals; an officer can sign them: {line}",
        )  # fmt: skip

    def _taken_at(self, one: signature_folder.SignedStatement) -> str:
        return self._found.ends[one.statement.next_event].taken.hex()

    def _find_adopted(self) -> None:
        """Find events that a signer has only found there, and nobody else has signed since."""
        for one in self._good:
            said = one.statement
            if isinstance(said, OldStatement) or said.adopted is None:
                continue
            first, last = said.adopted
            if any(self._confirms(other, one) for other in self._good):
                continue
            text = (
                f"{self._keys[one.public_bytes]} has signed {counted(last + 1 - first, 'event')} "
                "as they were found there, not written with this key; another believed key that "
                "signs the log confirms them"
            )
            finding = _finding("adopted", Severity.UNSIGNED, one.path, text, (first, last))
            self._findings.append(finding)

    @staticmethod
    def _confirms(
        other: signature_folder.SignedStatement, one: signature_folder.SignedStatement
    ) -> bool:
        """Return whether a statement vouches for what another one has adopted."""
        said, adopted = other.statement, one.statement
        if other.public_bytes == one.public_bytes or isinstance(said, OldStatement):
            return False
        assert isinstance(adopted, Statement)
        assert adopted.adopted is not None
        first, last = adopted.adopted
        is_own = said.adopted is None or said.adopted[0] > last or said.adopted[1] < first
        return said.next_event > last and is_own

    def _find_unsigned(self, signed: int) -> None:
        """Find what nobody vouches for: all of the log, or its end."""
        found = self._found
        end = found.next_event
        if end <= signed:
            return
        line = command_line("sign", self._log, "--key", "KEY")
        if not signed:
            text = (
                f"{counted(end, 'event')}, and no signature of a given key covers "
                f"any; with the key, sign them: {line}"
            )
            self._wrong("unsigned", self._log, text, (0, end - 1))
            return
        if found.trimming_before > signed:
            text = "an event at the unsigned end records a removal"
            told = found.trimming_before - 1
            self._wrong("taken-out", self._log, text, (told, told))
        text = f"{counted(end - signed, 'event')} at the end without a signature; " + (
            "the live segment is signed once it is closed, or by a recorder that signs"
            if found.closed_before <= signed
            else f"with the key, sign them: {line}"
        )
        severity = Severity.NOTE if self._allow_unsigned_end else Severity.UNSIGNED
        finding = _finding("unsigned", severity, self._log, text, (signed, end - 1))
        self._findings.append(finding)

    def _wrong(
        self, kind: str, path: PurePath, text: str, events: tuple[int, int] | None = None
    ) -> None:
        self._findings.append(_finding(kind, Severity.NOT_AS_SIGNED, path, text, events))


def _order(one: signature_folder.SignedStatement) -> tuple[int, int]:
    said = one.statement
    return said.next_event, said.number if isinstance(said, Statement) else -1


def _finding(
    kind: str,
    severity: Severity,
    path: PurePath,
    text: str,
    events: tuple[int, int] | None = None,
) -> Finding:
    return Finding(kind, severity, path, None, events, text)


Read = Sequence[
    signature_folder.SignedStatement
    | signature_folder.SignedRevocation
    | signature_folder.BadSignature
]
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

    by: signature_folder.SignedRevocation
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
            if isinstance(one, signature_folder.SignedRevocation):
                self._revoke(one)
        self._believe_successors()

    def distrusted(self) -> Iterator[Distrust]:
        """Yield what does not count, each with its reason."""
        yield from self._wrong
        for one in self._read:
            if isinstance(one, signature_folder.BadSignature):
                yield Distrust(one.kind, one.path, one.problem)
            elif isinstance(one, signature_folder.SignedStatement) and (why := self._why_not(one)):
                yield why

    def believed(self) -> list[signature_folder.SignedStatement]:
        """Return the statements about this log by keys that are believed for them."""
        signed = [one for one in self._read if isinstance(one, signature_folder.SignedStatement)]
        return [one for one in signed if not self._why_not(one)]

    def _why_not(self, one: signature_folder.SignedStatement) -> Distrust | None:
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

    def _revoke(self, one: signature_folder.SignedRevocation) -> None:
        """Take up a revocation, if it is one by an owner; of several the lowest number counts."""
        said = one.revocation
        why = self._why_not_signer(one.path, one.public_bytes, REVOKING, self._given)
        if why is None and said.log_id != self._log_id:
            why = self._other_log(one.path, said.log_id)
        if why is not None:
            self._wrong.append(why)
            return
        key = key_from_text(said.key)
        last = None if said.revokes_all else self._statement_of(key, said.last)
        if last is None and not said.revokes_all:
            text = "the last statement that counts, of the key that it revokes, is missing"
            self._wrong.append(Distrust("statement", one.path, text))
        before = self._revoked.get(key)
        if before is None or said.first < before.by.revocation.first:
            self._revoked[key] = _Revoked(one, last)

    def _statement_of(self, key: bytes, digest: str) -> Statement | None:
        for one in self._read:
            if isinstance(one, signature_folder.SignedStatement) and (
                one.public_bytes,
                one.digest,
            ) == (key, digest):
                return one.statement if isinstance(one.statement, Statement) else None
        return None

    def _why_revoked(self, one: signature_folder.SignedStatement) -> Distrust | None:
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
            f"statement {by.revocation.first} on ({by.path.name}), and this one does not come "
            "before that. Compare the log with a copy from elsewhere; then move this file out of "
            "the folder, and sign with another key",
        )  # fmt: skip

    def _believe_successors(self) -> None:
        """Believe also the keys that believed ones have named, each from then on in its place.

        The first that a key has named is its successor.
        """
        naming = [
            (one, one.statement)
            for one in self._read
            if isinstance(one, signature_folder.SignedStatement)
            and isinstance(one.statement, Statement)
            and one.statement.next_key != NONE
        ]
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
                    successor = key_from_text(said.next_key)
                    is_new |= successor not in self.keys
                    owner = f"the successor of {key.owner or key.fingerprint}"
                    self.keys.setdefault(successor, PublicKey(successor, owner, key.namespaces))
