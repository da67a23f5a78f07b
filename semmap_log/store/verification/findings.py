"""What a verification found, as values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from pathlib import PurePath

from semmap_log.store.form import NO_HASH

EXIT_GOOD, EXIT_TORN, EXIT_DAMAGE, EXIT_NOT_A_LOG, EXIT_UNSIGNED = 0, 3, 4, 5, 6


class Severity(IntEnum):
    """How bad a finding is, from the harmless up."""

    NOTE = 0
    """Good to know: a suspect clock, a kept tail."""
    WARNING = 1
    """A cache is not as it should be; the log itself is."""
    TORN = 2
    """An unfinished end, as a crash leaves it; the next writer puts it in order."""
    UNSIGNED = 3
    """Events after all that is signed, or that the signer found there; nothing speaks against."""
    NOT_AS_SIGNED = 4
    """No signature vouches for it, or one says otherwise; each byte may fit the others."""
    DAMAGE = 5
    """Bytes are not what was written, or are missing."""
    NOT_A_LOG = 6
    """There is nothing of ours at that path."""


_EXIT_CODES = {
    Severity.TORN: EXIT_TORN,
    Severity.UNSIGNED: EXIT_UNSIGNED,
    Severity.NOT_AS_SIGNED: EXIT_DAMAGE,
    Severity.DAMAGE: EXIT_DAMAGE,
    Severity.NOT_A_LOG: EXIT_NOT_A_LOG,
}


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is not as it should be, or worth to know."""

    kind: str
    """One word for machines: `chunk`, `chain`, `missing`, `keyframe`, `clock` …"""
    severity: Severity
    path: PurePath
    offset: int | None
    """Where in the file; None: it is about the file as a whole."""
    events: tuple[int, int | None] | None
    """First and last number of the events it is about; last None: it cannot be known; None: it
    is about no event."""
    text: str
    """What was expected, what was found, and what to do."""


@dataclass(frozen=True, slots=True)
class CommitEnd:
    """Where a commit ends, and a log might."""

    head: bytes
    """Its hash: the head of a log that ends here."""
    commits: int
    """Up to here, of those that were read, with those that were taken out on purpose."""
    recorded_ns: int | None = None
    """When it was recorded; None: no commit before it was read, or it was taken out."""
    taken: bytes = b""
    """Digest of what no hash binds, up to here: `store.unbound`."""
    unvouched: int = 0
    """How many records up to here this head does not bind, since records were taken out."""


@dataclass(frozen=True, slots=True)
class Verification:
    """What reading every byte of a log has shown."""

    path: PurePath
    findings: tuple[Finding, ...]
    """The worst first; of equal ones in the order of the log."""
    log_id: str = ""
    segments: int = 0
    commits: int = 0
    """That are whole and in their place."""
    events: int = 0
    """In those commits."""
    keyframes: int = 0
    """That were compared with the replay."""
    size: int = 0
    """Bytes that were read."""
    head: bytes = NO_HASH
    """Hash of the last commit: kept elsewhere, it proves that nothing was cut off."""
    events_after_head: int | None = None
    """How many events came after the head that was asked about; None: none was, or not found."""
    ends: Mapping[int, CommitEnd] = field(default_factory=dict)
    """The number behind a commit's last event -> that end; the first, the last, and those asked
    about."""
    first_event: int = 0
    """With which the reading began."""
    next_event: int = 0
    """The number behind the last event."""
    closed_before: int = 0
    """Events below this number lie in closed segments."""
    segment_ends: tuple[int, ...] = ()
    """The number after the last event of each closed segment; `ends` has them, too."""
    ends_gone: frozenset[int] = frozenset()
    """Of the ends that were asked about: those within whole commits that were taken out."""
    taken_before: int = 0
    """Number of the first event after all that was taken out; 0: nothing was."""
    trimming_before: int = 0
    """The number after the last event that tells of a trimming; 0: none does."""
    events_gone: int = 0
    """That were taken out on purpose."""
    notes_gone: int = 0

    @property
    def exit_code(self) -> int:
        """Return 0 good, 3 torn tail, 4 damage or not as signed, 5 not a log, 6 unsigned end."""
        worst = max((finding.severity for finding in self.findings), default=Severity.NOTE)
        return _EXIT_CODES.get(worst, EXIT_GOOD)

    def moved(self, source: PurePath, target: PurePath) -> Verification:
        """Return the same of a folder that people know by another path."""
        findings = tuple(
            replace(finding, path=target / finding.path.relative_to(source))
            for finding in self.findings
        )
        return replace(self, path=target, findings=findings)

    def of(self, *severities: Severity) -> list[Finding]:
        """Return the findings of these severities."""
        return [finding for finding in self.findings if finding.severity in severities]
