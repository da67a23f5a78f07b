"""What is signed: a few lines that people can read, about one closed stretch of a log.

    semmap-log head 1
    log: 0f3c…
    first-event: 0
    next-event: 217
    commits: 41
    recorded: 2026-03-02T17:00:00.000000000Z
    previous-head: 0000…
    head: c16b…

Through the hash chain `head` stands for every event below `next-event`, not for this stretch alone.
Segments are not named: small ones are continued, and merged; events keep their numbers.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from semmap_log.domain.moments import format_utc
from semmap_log.store.verification.findings import CommitEnd

_NUMBER = "0|[1-9][0-9]{0,18}"
_HASH = "[0-9a-f]{64}"
_TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{9}Z"
_FORM = re.compile(
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
class HeadStatement:
    """That a log holds so many events, and which commit is the last of them."""

    log_id: str
    first_event: int
    """With which the stretch begins."""
    next_event: int
    """The number behind its last event."""
    commits: int
    """In the stretch."""
    recorded: str
    """When its last commit was recorded: ISO-8601, UTC, nanoseconds."""
    previous_head: str
    """Hash of the commit before the stretch, hexadecimal."""
    head: str
    """Hash of its last commit, hexadecimal."""

    @classmethod
    def between(
        cls, log_id: str, first_event: int, next_event: int, *, start: CommitEnd, end: CommitEnd
    ) -> HeadStatement:
        """Return the statement about the events between two ends of commits that were read."""
        assert end.recorded_ns is not None
        return cls(
            log_id, first_event, next_event, end.commits - start.commits,
            format_utc(end.recorded_ns), start.head.hex(), end.head.hex(),
        )  # fmt: skip

    @property
    def text(self) -> str:
        """Return it as it is signed."""
        return (
            "semmap-log head 1\n"
            f"log: {self.log_id}\n"
            f"first-event: {self.first_event}\n"
            f"next-event: {self.next_event}\n"
            f"commits: {self.commits}\n"
            f"recorded: {self.recorded}\n"
            f"previous-head: {self.previous_head}\n"
            f"head: {self.head}\n"
        )


def read_statement(data: bytes) -> HeadStatement:
    """Return the statement of a text, which has to be exactly as `text` writes it.

    Raises:
        ValueError: It is not.
    """
    found = _FORM.fullmatch(data.decode("ascii", "replace"))
    if found is None:
        raise ValueError("no statement of a log's head, version 1, as it is written")
    log_id, first, behind, commits, recorded, previous, head = found.groups()
    return HeadStatement(log_id, int(first), int(behind), int(commits), recorded, previous, head)
