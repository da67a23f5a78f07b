"""What is signed: a few lines that people can read, about a log up to one of its commits.

    semmap-log statement 2
    log: 0f3c…
    number: 3
    commits: 41
    next-event: 217
    head: c16b…
    taken: 5e01…
    adopted: none
    before: 0000…
    next-key: none

Through the hash chain `head` stands for every event below `next-event` of which nothing was taken
out; `taken` for the rest: what was taken out, and what no commit binds (`store.unbound`). Segments
are not named: small ones are continued, and merged; events keep their numbers.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from semmap_log.core.model.moments import format_utc
from semmap_log.log.signing.ssh_format import KEY_TYPE
from semmap_log.store.form import NO_HASH
from semmap_log.store.verification.findings import CommitEnd

NONE = "none"
NO_DIGEST = NO_HASH.hex()
_NUMBER = "0|[1-9][0-9]{0,18}"
_HASH = "[0-9a-f]{64}"
_TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{9}Z"
_FORM = re.compile(
    "semmap-log statement 2\n"
    "log: ([0-9a-f]{32})\n"
    f"number: ({_NUMBER})\n"
    f"commits: ({_NUMBER})\n"
    f"next-event: ({_NUMBER})\n"
    f"head: ({_HASH})\n"
    f"taken: ({_HASH})\n"
    rf"adopted: ({NONE}|(?:{_NUMBER})\.\.(?:{_NUMBER}))" + "\n"
    f"before: ({_HASH})\n"
    f"next-key: ({NONE}|{KEY_TYPE} [A-Za-z0-9+/=]+)\n",
    re.ASCII,
)
_FORM_1 = re.compile(
    "semmap-log head 1\n"
    "log: ([0-9a-f]{32})\n"
    f"first-event: ({_NUMBER})\n"
    f"next-event: ({_NUMBER})\n"
    f"commits: ({_NUMBER})\n"
    f"recorded: ({_TIME})\n"
    f"previous-head: ({_HASH})\n"
    f"head: ({_HASH})\n",
    re.ASCII,
)


@dataclass(frozen=True, slots=True)
class Statement:
    """That a log holds so many events, which commit is the last, and what was taken out."""

    log_id: str
    number: int
    """It rises with each statement of a key about a log."""
    commits: int
    """Up to its last, with those that were taken out."""
    next_event: int
    """The number after its last event."""
    head: str
    """Hash of its last commit, hexadecimal."""
    taken: str
    """Digest of what was taken out, and of what no commit binds, hexadecimal."""
    adopted: tuple[int, int] | None
    """First and last of the events that the signer found there, and neither wrote nor verified."""
    before: str
    """SHA-256 of the key's last statement about the log that is kept, hexadecimal; else zeros."""
    next_key: str = NONE
    """The public key that goes on in the place of this one, as a `.pub` has it."""

    @property
    def text(self) -> str:
        """Return it as it is signed."""
        adopted = NONE if self.adopted is None else f"{self.adopted[0]}..{self.adopted[1]}"
        return (
            "semmap-log statement 2\n"
            f"log: {self.log_id}\n"
            f"number: {self.number}\n"
            f"commits: {self.commits}\n"
            f"next-event: {self.next_event}\n"
            f"head: {self.head}\n"
            f"taken: {self.taken}\n"
            f"adopted: {adopted}\n"
            f"before: {self.before}\n"
            f"next-key: {self.next_key}\n"
        )

    def agrees(self, end: CommitEnd, *, counts_all: bool) -> bool:
        """Tell whether a log that was read holds what this says besides the head.

        Args:
            end: Of the commit that it names.
            counts_all: Whether the reading began with the log's first commit.
        """
        return not counts_all or self.commits == end.commits


@dataclass(frozen=True, slots=True)
class OldStatement:
    """A statement of version 1: it does not tell what was taken out. None is made any more."""

    log_id: str
    first_event: int
    """With which the stretch begins."""
    next_event: int
    """The number after its last event."""
    commits: int
    """In the stretch."""
    recorded: str
    """When its last commit was recorded: ISO-8601, UTC, nanoseconds."""
    previous_head: str
    """Hash of the commit before the stretch, hexadecimal."""
    head: str
    """Hash of its last commit, hexadecimal."""

    def agrees(self, start: CommitEnd, end: CommitEnd) -> bool:
        """Tell whether a log holds what this says besides the head, between two of its commits."""
        assert end.recorded_ns is not None, "the commit is there"
        said = (self.commits, self.recorded, self.previous_head)
        found = end.commits - start.commits, format_utc(end.recorded_ns), start.head.hex()
        return said == found


def read_statement(data: bytes) -> Statement | OldStatement:
    """Return the statement of a text, which has to be exactly as it is written.

    Raises:
        ValueError: It is not.
    """
    text = data.decode("ascii", "replace")
    if found := _FORM_1.fullmatch(text):
        log_id, first, end, commits, recorded, previous, head = found.groups()
        return OldStatement(log_id, int(first), int(end), int(commits), recorded, previous, head)
    found = _FORM.fullmatch(text)
    if found is None:
        raise ValueError("no statement of version 1 or 2 about a log, as it is written")
    log_id, number, commits, end, head, taken, adopted, before, next_key = found.groups()
    return Statement(
        log_id, int(number), int(commits), int(end), head, taken, _range(adopted), before, next_key
    )


def _range(text: str) -> tuple[int, int] | None:
    if text == NONE:
        return None
    first, _, last = text.partition("..")
    return int(first), int(last)
