"""A log, and all that it was sent: what the two must agree on at every step."""

from __future__ import annotations

import time
from bisect import bisect
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import semmap_log as sl
from fault_injection.questions import Answer, ask_verb
from fault_injection.trimming.commands import Command, row_of
from fault_injection.trimming.whole_log import OF_TRIMMING, Commit, Row, WholeLog
from semmap_log.store.reading.reader import LogReader

START_NS = 1_772_400_000 * 10**9


class WrongError(AssertionError):
    """A log answered, refused or did what it must not."""


@dataclass(frozen=True)
class Sent:
    """A command that was stored, and the number with which it was answered."""

    command: Command
    number: int


class Clock:
    """The time of the whole program, while it is `installed`."""

    def __init__(self) -> None:
        self.now_ns = START_NS

    def time_ns(self) -> int:
        """Return the time, a microsecond later at each look."""
        self.now_ns += 1000
        return self.now_ns

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Have everybody ask this clock."""
        with patch.object(time, "time_ns", self.time_ns):
            yield


class Life:
    """A log, and all that was ever sent to it."""

    def __init__(self, room: Path, clock: Clock, *, is_small: bool) -> None:
        """Create the log.

        Args:
            room: An empty folder.
            clock: Is installed already.
            is_small: Whether segments hold a few commits only.
        """
        self.is_small = is_small
        self.room = room
        self.path = room / "log"
        self.out = room / "out"
        self.whole = WholeLog()
        self.sent: list[Sent] = []
        self.files: list[Path] = []
        """Files that were imported."""
        self.copies: dict[Path, int] = {}
        """Copies that can be brought up to date, and the number of the last event in each."""
        self.steps: list[str] = []
        """What was done, in words."""
        self.checked = 0
        """Answers that were right."""
        self.clock = clock
        with sl.create(self.path, tz="UTC", durability="flush", compact=False) as log:
            for name in ("front", "store"):
                log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, name=name)
                self.take_in()

    def append(self) -> sl.DoorLogWriter:
        """Open the log for writing."""
        return sl.append(self.path, durability="flush", compact=False)

    def verb(self, *arguments: str, good: bool = True) -> Answer:
        """Run a verb on the log, whose path follows the verb's name.

        Raises:
            WrongError: It ended in a traceback; or in an error, and `good` says that it must not.
        """
        verb, *more = arguments
        self.steps.append(f"semmap-log {verb} LOG {' '.join(more)}")
        answer = ask_verb((verb, "{log}", *more), self.path, self.out)
        if answer.code < 0 or (good and answer.code):
            raise WrongError(f"{verb}: exit {answer.code}: {answer.error.strip()[-500:]}")
        return answer

    def next_commits(self) -> list[Commit]:
        """Return what the log holds after all that is known of it."""
        log = sl.read(self.path)
        return [_commit(followed) for followed in log.commits_after(self.whole.last)]

    def take_in(self) -> list[Row]:
        """Take in what was stored since, by whomever; return the events."""
        found = self.next_commits()
        for commit in found:
            self.whole.take(commit)
        return [row for commit in found for row in commit.events]

    def take_in_trimming(self) -> list[Row]:
        """Take in what a trimming has stored, which only says what it took out.

        Raises:
            WrongError: It stored something else.
        """
        rows, pins = self.take_in(), self.whole.pins()
        if foreign := [row for row in rows if not self._is_of_trimming(row, pins)]:
            raise WrongError(f"a trimming stored {foreign}")
        self.whole.from_trimming |= {row["event"] for row in rows}
        return rows

    def _is_of_trimming(self, row: Row, pins: dict[str, int]) -> bool:
        if row["kind"] == "Retracted":
            reached = range(row["first_event"], row["last_event"] + 1)
            return all(self.whole.rows[number]["kind"] in OF_TRIMMING for number in reached)
        if row["kind"] == "MomentPinned":
            return bool(pins.get(row["name"]) == row["at_ns"])
        return row["kind"] in OF_TRIMMING

    def left(self) -> set[int]:
        """Return the numbers of the events that the log still holds."""
        return {entry.number for entry in sl.read(self.path).history()}

    def may_refuse_retraction(self, first: int) -> bool:
        """Tell whether what would be true without an event may rest on what is gone.

        That is so up to the end of the last file that lost events for their age or as repeated.
        """
        last = max(self.whole.last_lost, self.whole.horizon - 1)
        if first <= last:
            return True
        starts = [segment.header.first_event for segment in LogReader(self.path).segments]
        return last >= 0 and bisect(starts, first) == bisect(starts, last)


def _commit(followed: Any) -> Commit:
    """Return a commit of the log as plain values."""
    said = followed.commit
    rows = [
        row_of(one.event)
        | {"event": one.number, "recorded": one.recorded_ns, "happened": one.happened_ns}
        for one in followed
    ]
    note = (said.note.actor, said.note.source, said.note.reason, said.note.correlation)
    return Commit(said.recorded_ns, said.closed_ns, said.command_id, note, rows)
