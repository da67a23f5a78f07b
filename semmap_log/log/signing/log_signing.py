"""Signs a log: it is read and checked, byte for byte, and compared with what the key signed last.

The signer is a private key of OpenSSH, read or made. It lies outside of every log.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from semmap_log.core.io.disk import NO_LINK, PLAIN, check_outside_log, sync_folder, write_all
from semmap_log.core.io.progress import Progress
from semmap_log.core.io.virtual_logs import check_not_virtual
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import NotALogError, OutputError, PassphraseError, SigningError
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.signing import signature_folder, statement
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.signer_state import Reach, Signer, SignerState
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.verification.findings import CommitEnd, Severity, Verification

_NOWHERE = CommitEnd(b"", 0)


@dataclass(slots=True)
class Signed:
    """What a signing has done."""

    made: list[Path] = field(default_factory=list)
    """Statements that were signed now."""
    next_event: int = 0
    """Events below this number are signed by this key."""
    is_live: bool = False
    """Whether a segment is live: it is signed once it is closed."""
    adopted: tuple[int, int] | None = None
    """First and last event of those that were signed as they were found."""
    unvouched_events: int = 0
    """How many events were taken out that no officer's statement vouches for."""


def sign(
    log: Path,
    key: SigningKey,
    *,
    adopt: bool = False,
    trimmed: bool = False,
    next_key: statement.PublicKey | None = None,
    progress: Progress | None = None,
) -> Signed:
    """Sign what is closed of a log and not signed by this key yet; nothing else of it changes.

    All of the log is read first, as `verify` reads it. It must continue from what the key's state
    says was signed last. If stopped at any moment, it leaves whole signatures or none. Others may
    write, compact or sign meanwhile.

    Args:
        log: The log's folder.
        key: The signing key.
        adopt: Sign also what does not continue from there, and say so in the statement; and vouch
            for what was taken out without an officer's statement.
        trimmed: Vouch for what was taken out just now.
        next_key: Name the key that replaces this one, which signs no more of it.
        progress: Called with the number of bytes read.

    Raises:
        SigningError: It is damaged, or not what the key has signed before.
        OutputError: The disk does not take the signatures.
        LogError: It cannot be read, or is no log.
    """
    check_not_virtual(log)
    with SignerState.held(key) as state:
        found = read_for_signing(log, state, progress)
        signing = LogSigning(log, found, Signer(log, found.log_id, key, state))
        successor = statement.NONE if next_key is None else next_key.words
        return signing.run(adopt=adopt, trimmed=trimmed, next_key=successor)


def check_before_trimming(log: Path, key: SigningKey, progress: Progress | None = None) -> None:
    """Check that a key can vouch for what is taken out of a log next, and for all before that.

    Raises:
        SigningError: The log is not what it has signed; or something was taken out already without
            a statement that vouches for it.
        LogError: It cannot be read, or is no log.
    """
    check_not_virtual(log)
    with SignerState.held(key) as state:
        found = read_for_signing(log, state, progress)
        signing = LogSigning(log, found, Signer(log, found.log_id, key, state))
        signing.check()
        if signing.unvouched:
            raise signing.refused(
                f"{counted(found.events_gone, 'event')} were taken out before, and no officer's "
                "statement vouches for that",
                adopt=True,
            )


def revoke(log: Path, owner: SigningKey, revoked: statement.PublicKey, *, first: int) -> Path:
    """Revoke a key for a log, from the statement of a number on; return the revocation's file.

    The statements before that number which lie in the log's folder are taken for its own: compare
    them with copies from elsewhere. The log itself is not read.

    Args:
        log: The log's folder.
        owner: Who signs that; `verify` must believe it for semmap-log-revoke.
        revoked: Which key.
        first: The number of the first statement that does not count; 0: none counts.

    Raises:
        SigningError: It would revoke itself; the statements cannot be read, or none of the key's
            has a lower number.
        OutputError: The disk does not take it.
        LogError: It is no log.
    """
    check_not_virtual(log)
    if owner.public_bytes == revoked.public_bytes:
        raise SigningError(f"{log}: expected an owner's key to revoke {revoked}, got that one.")
    log_id = LogReader(log).info.log_id
    own = [
        (one.statement.number, one.digest)
        for one in signature_folder.signed_in(log, log_id)
        if one.public_bytes == revoked.public_bytes
        and isinstance(one.statement, statement.Statement)
    ]
    before = [one for one in own if one[0] < first]
    if first and not before:
        raise SigningError(
            f"{log}: expected a statement of {revoked} with a number below {first}, got none; put "
            "copies back into LOG/signatures, or revoke all that it has signed (--from 0)."
        )
    last = max(before)[1] if before else statement.NO_DIGEST
    said = signature_folder.Revocation(log_id, revoked.words, first, last)
    return signature_folder.write_signed(
        log, signature_folder.name_of_revocation(said), said.text, owner, statement.REVOKING
    )


def read_for_signing(
    log: Path, state: SignerState, progress: Progress | None = None, *, at: int | None = None
) -> Verification:
    """Read all of a log, and return what it holds at each place that was signed.

    Args:
        log: Its folder.
        state: Of the key.
        progress: Called with the number of bytes read.
        at: Also before this event.

    Raises:
        SigningError: It is damaged.
        LogError: It cannot be read, or is no log.
    """
    ends = state.ends | {one.statement.next_event for one in signature_folder.signed_in(log)}
    found = verify(log, None, progress, ends=ends if at is None else ends | {at})
    for one in found.findings:
        if one.severity is Severity.NOT_A_LOG:
            raise NotALogError(f"{one.path}: {one.text}.")
        if one.severity is Severity.DAMAGE:
            raise _refused(log, f"{one.path.name}: {one.text}")
    return found


def reach_at(found: Verification, next_event: int, base: statement.Statement | None) -> Reach:
    """Return what a log holds up to an event.

    Args:
        found: What was read of it.
        next_event: Up to which: one of its ends.
        base: What was signed last of it.

    Raises:
        ValueError: Its beginning lies elsewhere, and is not known from what was signed.
    """
    end = found.ends[next_event]
    if not found.first_event:
        return Reach(next_event, end.head, end.commits, end.taken)
    start = None if base is None else found.ends.get(base.next_event)
    if base is None or start is None or found.taken_before:
        raise ValueError
    commits = base.commits + end.commits - start.commits
    return Reach(next_event, end.head, commits, bytes.fromhex(base.taken))


class LogSigning:
    """One log that was read, and who signs it."""

    def __init__(self, log: Path, found: Verification, signer: Signer) -> None:
        self._log = log
        self._found = found
        self._signer = signer
        base = signer.base
        self._signed = 0 if base is None else base.next_event
        """Events below this number were signed before."""
        self._last = base if isinstance(base, statement.Statement) else None

    def run(self, *, adopt: bool, trimmed: bool, next_key: str = statement.NONE) -> Signed:
        """Sign what is closed and new; as `sign` says."""
        found, signer = self._found, self._signer
        done = Signed(is_live=len(found.segment_ends) < found.segments)
        start = found.next_event
        try:
            self.check()
        except SigningError:
            if not adopt:
                raise
            start = self._adopted_from()
        signer.take_up()
        done.made += signer.mend()
        is_officer = trimmed or (adopt and self.unvouched)
        ends = sorted({end for end in found.segment_ends if end > self._signed})
        if ends and (start < ends[-1] or is_officer):
            ends = ends[-1:]  # one that says what was adopted, or taken out
        is_due = is_officer or start < found.closed_before or next_key != statement.NONE
        if not ends and found.closed_before and is_due:
            ends = [found.closed_before]
        for end in ends:
            done.adopted = (start, end - 1) if start < end else None
            namespace = statement.TRIMMING if is_officer else statement.HEADS
            done.made.append(
                signer.put(
                    self._reach(end), adopted=done.adopted, namespace=namespace,
                    next_key=next_key if end == ends[-1] else statement.NONE,
                )
            )  # fmt: skip
        done.next_event = ends[-1] if ends else self._signed
        done.unvouched_events = found.events_gone if self.unvouched else 0
        return done

    def check(self) -> None:
        """Check that the log continues from what this key has signed last.

        Raises:
            SigningError: It does not.
        """
        found, signed = self._found, self._signed
        base, end = self._signer.base, found.ends.get(signed, _NOWHERE)
        if signed < found.first_event:
            missing = f"events {signed}..{found.first_event - 1} are missing, or elsewhere"
            raise self.refused(missing)
        if self._signer.is_lost:
            problem = "there are statements of this key, and what it signed last is not known"
            raise self.refused(f"{problem} (KEY.state)", adopt=True)
        if base is None:
            return
        if signed > found.next_event:
            raise self.refused(
                f"this key has signed events up to {signed - 1}, and the log ends with "
                f"event {found.next_event - 1}: it was rolled back, or cut",
                adopt=True,
            )
        if signed not in found.ends_gone and end.head.hex() != base.head:
            raise self.refused(
                f"its commit before event {signed} is not the one that this key has "
                "signed: it was rewritten, or is another branch of that log",
                adopt=True,
            )
        is_whole = not (found.taken_before or found.first_event)
        if is_whole and self._last is not None and end.taken.hex() != self._last.taken:
            raise self.refused(
                "its time zone, building or robot differs from what this key has signed, or "
                "removed records were restored",
                adopt=True,
            )

    @property
    def unvouched(self) -> bool:
        """Whether something was taken out, and no statement for that purpose vouches for it."""
        found = self._found
        if not found.taken_before or found.first_event:
            return False
        return not any(
            one.namespace == statement.TRIMMING
            and isinstance(one.statement, statement.Statement)
            and one.statement.next_event >= found.taken_before
            and (end := found.ends.get(one.statement.next_event)) is not None
            and end.taken.hex() == one.statement.taken
            for one in signature_folder.signed_in(self._log, found.log_id)
        )

    def refused(self, why: str, *, adopt: bool = False) -> SigningError:
        """Return the error that says why, and what to do."""
        return _refused(self._log, why, adopt=adopt)

    def _adopted_from(self) -> int:
        """Return the first event of what is signed as it was found."""
        found, signed, base = self._found, self._signed, self._signer.base
        end = found.ends.get(signed, _NOWHERE)
        is_there = signed in found.ends_gone or (base is not None and end.head.hex() == base.head)
        if is_there and (self._last is None or end.taken.hex() == self._last.taken):
            return signed
        return found.first_event

    def _reach(self, next_event: int) -> Reach:
        try:
            return reach_at(self._found, next_event, self._last)
        except ValueError:
            raise self.refused(
                "its beginning is stored elsewhere, so its removals are unknown; fetch "
                "the whole log, and sign that"
            ) from None


def _refused(log: Path, why: str, *, adopt: bool = False) -> SigningError:
    line = command_line("verify", log)
    as_it_is = f" To sign it as it is: {command_line('sign', log, '--key', 'KEY', '--adopt')}"
    return SigningError(
        f"{log}: not signed: {why}. All that is wrong: {line}{as_it_is if adopt else ''}"
    )


def unwritten(log: Path, first: int, last: int) -> SigningError:
    """Return the error that a recorder with the key has not written some events of its log."""
    line = command_line("sign", log, "--key", "KEY")
    return SigningError(
        f"{log}: events {first}..{last} are not signed, and no recorder with this key wrote them. "
        f"Look who did. Then end this recorder and sign them ({line}), or let it adopt them "
        "(--adopt)."
    )


_PRIVATE_MODE, _PUBLIC_MODE = 0o600, 0o644
_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_MOST_BYTES = 2**16

Passphrase = Callable[[], str | None]
"""Called when a key needs a passphrase; returns None without one."""


def read_key(path: Path, *, log: Path, passphrase: Passphrase = lambda: None) -> SigningKey:
    """Return the key to sign a log with.

    Args:
        path: A private key of Ed25519, as `ssh-keygen -t ed25519` makes it.
        log: The log's folder, in which no key may lie.
        passphrase: Where the passphrase comes from, if the key has one.

    Raises:
        SigningError: It lies in the log's folder, cannot be read, others may read it, or it is no
            such key.
        MissingExtraError: A package is not installed.
    """
    _check_outside(log, path)
    data = _private_bytes(path)
    try:
        try:
            key = SigningKey.of_openssh(data)
        except PassphraseError:
            key = SigningKey.of_openssh(data, passphrase=passphrase())
    except SigningError as error:
        raise type(error)(f"{path}: {error}.") from None
    key.path = path.absolute()
    return key


def make_key(path: Path, *, log: Path, comment: str = "") -> SigningKey:
    """Make a key pair: the private key at a path, the public one next to it as `.pub`.

    The private key belongs to its owner alone from its first instant on. Nothing is replaced.

    Raises:
        SigningError: It would lie in the log's folder; one of the two files is there already, or
            cannot be written.
    """
    _check_outside(log, path)
    public = path.with_name(f"{path.name}.pub")
    for each in (path, public):
        if os.path.lexists(each):
            raise SigningError(f"{each}: is there already; a key is never replaced.")
    key = SigningKey.drawn()
    _write_new(path, key.to_openssh(), _PRIVATE_MODE)
    try:
        line = statement.PublicKey(key.public_bytes, comment).line
        _write_new(public, line.encode(), _PUBLIC_MODE)
        sync_folder(path.absolute().parent)
    except BaseException:
        with suppress(OSError):
            path.unlink()
        raise
    key.path = path.absolute()
    return key


def _check_outside(log: Path, path: Path) -> None:
    """Keep keys out of a log's folder, which is copied and shipped."""
    try:
        check_outside_log(log, path)
    except OutputError as error:
        raise SigningError(f"{error}") from None


def _private_bytes(path: Path) -> bytes:
    """Return what is in a key's file, if it is its owner's alone, as ssh asks for it."""
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | PLAIN), "rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise SigningError(f"{path}: expected a private key, got no regular file.")
            if status.st_uid == os.getuid() and status.st_mode & _OTHERS:
                raise SigningError(
                    f"{path}: others may read this private key (mode "
                    f"{stat.S_IMODE(status.st_mode):04o}, expected 0600); if nobody has: "
                    f"chmod 600 {path}"
                )
            return file.read(_MOST_BYTES)
    except OSError as error:
        raise SigningError(f"{path}: the private key cannot be read: {error.strerror}.") from None


def _write_new(path: Path, data: bytes, mode: int) -> None:
    """Make a file that was not there, with these bytes, synced."""
    try:
        fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | NO_LINK | PLAIN, mode)
    except OSError as error:
        raise SigningError(f"{path}: the key cannot be made: {error.strerror}.") from None
    try:
        with os.fdopen(fd, "wb"):
            write_all(fd, data)
            os.fsync(fd)
    except BaseException as error:
        with suppress(OSError):
            path.unlink()
        if isinstance(error, OSError):
            raise SigningError(f"{path}: the key cannot be made: {error.strerror}.") from None
        raise
