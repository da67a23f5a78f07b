"""A log signed: each closed stretch that a key has not vouched for yet, read and checked before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from semmap_log.common.texts import command_line
from semmap_log.errors import LogError, NotALogError, SigningError
from semmap_log.io.made_logs import refuse_made
from semmap_log.io.progress import Progress
from semmap_log.replay.care import verify
from semmap_log.signing.ed25519_sdk import SigningKey
from semmap_log.signing.head_statement import HeadStatement
from semmap_log.signing.signature_folder import last_signed, write_signed
from semmap_log.store.form import NO_HASH
from semmap_log.store.verification.file_bytes import Vanished
from semmap_log.store.verification.file_heads import SegmentFile
from semmap_log.store.verification.file_place import DiskPlace
from semmap_log.store.verification.findings import CommitEnd, Finding, Severity, Verification
from semmap_log.store.verification.folder_files import FolderFiles, arrange, mark_findings

_ATTEMPTS = 5
"""How often to begin anew when a compaction replaces files meanwhile."""


@dataclass(slots=True)
class Signed:
    """What a signing has done."""

    made: list[Path] = field(default_factory=list)
    """Statements that were signed now."""
    next_event: int = 0
    """Events below this number are signed by this key."""
    is_live: bool = False
    """Whether a segment is live: it is signed once it is closed."""


def sign(log: Path, key: SigningKey, *, progress: Progress | None = None) -> Signed:
    """Sign what is closed of a log and not signed by this key yet; nothing else of it changes.

    What is signed is read first, byte for byte, as `verify` reads it, from where the key's last
    statement ends. Stopped at any moment it leaves whole signatures or none. Somebody may be
    writing, compacting or signing meanwhile.

    Args:
        log: The log's folder.
        key: Who signs.
        progress: Told how many bytes of a segment are read.

    Raises:
        SigningError: It is damaged, or not what the key has signed before.
        OutputError: The disk does not take the signatures.
        LogError: It cannot be read, or is no log.
    """
    refuse_made(log)
    done = Signed()
    for _ in range(_ATTEMPTS):
        with suppress(Vanished):
            _Signing(log, key, progress, done).run()
            return done
    raise LogError(f"{log}: its files change faster than they can be read; try again.")


class _Signing:
    """One try: from what is signed to the end of what is closed."""

    def __init__(self, log: Path, key: SigningKey, progress: Progress | None, done: Signed) -> None:
        self._log = log
        self._key = key
        self._progress = progress
        self._done = done
        before = last_signed(log, key)
        self._log_id = "" if before is None else before.statement.log_id
        self._signed = 0 if before is None else before.statement.next_event
        """Events below this number were signed before."""
        self._head = NO_HASH if before is None else bytes.fromhex(before.statement.head)
        """Hash of the commit before `next_event`."""
        self._next_event = self._signed

    def run(self) -> None:
        """Read and sign segment after segment."""
        found = self._arranged()
        self._done.next_event = self._signed
        self._done.is_live = not found.segments[-1].is_closed
        for file in _not_skipped(found.segments, self._signed):
            checked = self._checked(file)
            if file is found.segments[-1]:
                self._refuse_any(mark_findings(found, checked.next_event, None))
            if checked.next_event > self._signed:
                self._sign(checked)

    def _sign(self, checked: Verification) -> None:
        first, last = checked.first_event, checked.next_event
        statement = HeadStatement.between(
            checked.log_id, first, last, start=checked.ends[first], end=checked.ends[last]
        )
        self._done.made.append(write_signed(self._log, statement, self._key))
        self._done.next_event = last

    def _arranged(self) -> FolderFiles:
        found = arrange(DiskPlace(self._log))
        self._refuse_any(found.findings)
        first = found.segments[0].header
        if first is not None and self._log_id not in ("", first.info.log_id):
            raise self._refused(f"this key has signed another log here, {self._log_id}")
        return found

    def _checked(self, file: SegmentFile) -> Verification:
        """Read a closed segment that follows what was read, or signed, before.

        Raises:
            SigningError: It is not as it was written, or not what was signed.
            Vanished: A compaction has replaced it.
        """
        assert file.header is not None
        first = file.header.first_event
        if first > self._next_event:
            raise self._refused(f"events {self._next_event}..{first - 1} are missing, or elsewhere")
        found = _verified(file, self._progress, self._next_event)
        if found.events and found.closed_before != found.next_event:
            raise Vanished(file.path)  # a writer continues it: a power cut may still shorten it
        self._refuse_any(found.findings)
        if found.next_event < self._next_event:
            raise self._refused(
                f"this key has signed events up to {self._next_event - 1}, and the log ends with "
                f"event {found.next_event - 1}: it was rolled back, or cut"
            )
        if found.ends.get(self._next_event, _NOWHERE).head != self._head:
            raise self._refused(
                f"its commit before event {self._next_event} is not the one that this key has "
                "signed: it was rewritten, or is another branch of that log"
            )
        self._next_event, self._head = found.next_event, found.head
        return found

    def _refuse_any(self, findings: Sequence[Finding]) -> None:
        for one in findings:
            if one.severity is Severity.NOT_A_LOG:
                raise NotALogError(f"{one.path}: {one.text}.")
            if one.severity >= Severity.TORN:
                raise self._refused(f"{one.path.name}: {one.text}")

    def _refused(self, why: str) -> SigningError:
        line = command_line("verify", self._log)
        return SigningError(f"{self._log}: not signed: {why}. All that is wrong: {line}")


_NOWHERE = CommitEnd(b"", 0)


def _not_skipped(segments: Sequence[SegmentFile], signed: int) -> Iterator[SegmentFile]:
    """Yield the closed segments that hold more than what was signed, and the last in any case."""
    for file, following in zip(segments, (*segments[1:], None), strict=True):
        behind = None if following is None else following.header
        if file.is_closed and (behind is None or behind.first_event > signed):
            yield file


def _verified(file: SegmentFile, progress: Progress | None, before: int) -> Verification:
    """Read one segment by itself."""
    path = Path(file.path)
    try:
        return verify(path, None, progress, ends=(before,))
    except LogError:
        if not path.exists():
            raise Vanished(path) from None
        raise
