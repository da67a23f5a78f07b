"""Lines of JSON as commits: as they were, where a log wrote them.

Other lines that follow each other and say the same about who and why are one commit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, groupby
from typing import NamedTuple

from semmap_log.core.model.commits import GIVEN_EVENTS, NO_CONTENT, Note
from semmap_log.core.model.events import Event, Retracted
from semmap_log.errors import CommandError
from semmap_log.interop.formats.json.event_json_reader import ParsedLine
from semmap_log.interop.importing.line_numbers import NumberMap
from semmap_log.log.rewriting.new_numbers import renamed


@dataclass(frozen=True, slots=True)
class LineOptions:
    """How the lines of a file are taken."""

    tz: str
    """IANA zone of times without an offset."""
    file_id: bytes
    """Digest of the file and of how it is taken, 16 bytes: of it the ids of commits are made."""
    note: Note
    """Of lines that say nothing of who and why, unless a log wrote them."""
    log_tz: str
    """IANA zone of the log."""
    source: str = ""
    """Which sensor the file is of, where it was said."""
    as_recorded: bool = False
    """The times of the lines are when it was known; refused where they cannot be kept."""
    at_ns: int | None = None
    """When events happened whose line does not say; None: when they are recorded."""


class PlannedEvent(NamedTuple):
    """An event for the log."""

    event: Event
    source: int | None
    """Its number in the log that it was exported from."""


@dataclass(frozen=True, slots=True)
class PlannedCommit:
    """A commit for the log; its events are read on while they are asked for, and once."""

    command_id: bytes
    content: bytes
    note: Note
    recorded_ns: int | None
    """When the log that it was exported from recorded it."""
    is_exported: bool
    """A log wrote it, with its note, if it has one."""
    lines: Iterator[tuple[int, ParsedLine]]

    def events(self, numbers: NumberMap, at_ns: int | None) -> Iterator[PlannedEvent]:
        """Yield the events, with the numbers that those which they name have in this log.

        Retractions of what the file does not hold are left out.
        """
        for _, parsed in self.lines:
            event = taken(parsed, numbers, at_ns)
            if event is not None:
                yield PlannedEvent(event, parsed.number)


def taken(parsed: ParsedLine, numbers: NumberMap, at_ns: int | None) -> Event | None:
    """Return a line's event for this log; None: it takes back what the file does not hold.

    Raises:
        CommandError: What it takes back does not lie together here.
    """
    event = parsed.event
    if parsed.number is not None:
        told = renamed(event, numbers.ranges)
        if len(told) > 1:
            ranges = [(e.first_event, e.last_event) for e in told if isinstance(e, Retracted)]
            places = " and ".join(f"{first}..{last}" for first, last in ranges)
            raise CommandError(
                f"it takes back events that lie apart in this log ({places}): import the whole "
                "file into a new log"
            )
        if not told:
            return None
        (event,) = told
    if event.happened_ns is None and at_ns is not None:
        event = replace(event, happened_ns=at_ns)
    return event


def grouped(
    lines: Iterable[tuple[int, ParsedLine]], options: LineOptions, groups: int | None
) -> Iterator[PlannedCommit]:
    """Yield lines as commits.

    Args:
        lines: Number and content of each.
        options: How they are taken.
        groups: How many commits it will be; the last one without an id of its own gets the
            file's: it then says that all of the file is stored. None: not known yet.
    """
    key = _CommitKey()
    for place, (_, its_lines) in enumerate(groupby(lines, lambda line: key.of(line[1]))):
        first = next(its_lines)
        parsed = first[1]
        note = parsed.note
        if not note and not parsed.is_exported:
            note = options.note
        command_id = parsed.command_id
        content = parsed.content or (NO_CONTENT if parsed.is_exported else GIVEN_EVENTS)
        if command_id is None:
            is_last = groups is not None and place == groups - 1
            command_id = content = options.file_id if is_last else part_id(options, place)
        yield PlannedCommit(
            command_id,
            content,
            note,
            parsed.recorded_ns,
            parsed.is_exported,
            chain([first], its_lines),
        )


def part_id(options: LineOptions, place: int) -> bytes:
    """Return the id of one of a file's commits that has none of its own."""
    digest = hashlib.sha256(options.file_id + f"commit {place}".encode()).digest()
    return digest[: len(options.file_id)]


class _CommitKey:
    """Numbers commits: a line has the number of the line before it, or the next."""

    def __init__(self) -> None:
        self._last: ParsedLine | None = None
        self._number = 0

    def of(self, line: ParsedLine) -> int:
        self._number += self._last is not None and not _are_one(self._last, line)
        self._last = line
        return self._number


def _are_one(last: ParsedLine, line: ParsedLine) -> bool:
    """Tell whether two lines that follow each other are of one commit."""
    if (last.command_id, last.note) != (line.command_id, line.note):
        return False
    if line.command_id is not None:
        return last.commit == line.commit
    if last.recorded_ns is None or line.recorded_ns is None:
        return last.recorded_ns is line.recorded_ns
    return line.recorded_ns == last.recorded_ns + 1  # a log's commit counts on by nanoseconds
