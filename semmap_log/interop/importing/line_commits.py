"""Lines of JSON as commits: as they were, where a log wrote them.

Other lines are one commit if they follow each other and have the same note. Each line is read with
the doors as they are after those before it. Sightings that the log has already, by another file,
are left out, and the events of the file get the numbers of the log that imports them.
"""

from __future__ import annotations

import hashlib
from array import array
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from itertools import chain, groupby, islice
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.levels import NUMBER_PREFIX, level_called, levels_of
from semmap_log.core.folds.renumbering import renamed
from semmap_log.core.model import events as ev
from semmap_log.core.model.commits import GIVEN_EVENTS, NO_CONTENT, Note
from semmap_log.core.model.doors import LEVEL_NOT_GIVEN, DoorId, next_door_id
from semmap_log.core.model.meaning import Changed
from semmap_log.errors import CommandError, FormatError, UnknownDoorError
from semmap_log.interop.formats.json.event_json_reader import (
    DoorLookup,
    ParsedLine,
    parse_event_line,
)
from semmap_log.interop.formats.parsing.foreign_file import FileOrder, numbered_lines
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.interop.formats.parsing.strict_json import MOST_LINE_BYTES
from semmap_log.interop.importing.held_sightings import AT_ONCE, HeldSightings
from semmap_log.interop.importing.import_plan import Present
from semmap_log.log import DoorLog, StoredCommand

MOST_LEVEL_DIGITS = 5
"""Of a level's number."""


class LineReader:
    """Reads line after line, and knows the doors as they are after each."""

    def __init__(self, path: Path, present: Present, tz: str, *, as_recorded: bool = False) -> None:
        """Read nothing yet.

        Args:
            path: The file.
            present: What the log holds.
            tz: IANA zone of times without an offset.
            as_recorded: Lines that do not say when they were recorded were so when they happened;
                those of one time follow each other by a nanosecond, as a log's commit counts.
        """
        self.path = path
        self.as_recorded = as_recorded
        self._last_ns = (-1, -1)
        self.order = FileOrder(tz)
        self.problems = Problems(path)
        self.lookup = DoorLookup(self._resolve, self._next_id, self._level_of, self._level)
        self.door_map = present.door_map
        self.used_ids, self.greatest_id = {*present.used_ids}, present.greatest_id
        self.level_names = {n: level.name for n, level in levels_of(present.door_map).items()}
        self.levels = {door.door_id: door.level for door in present.door_map.doors.values()}
        names = ((door.door_id, door.name) for door in present.door_map.doors.values())
        self.doors_called = _Called(names)
        self.levels_called = _Called(self.level_names.items())
        self.longest_level = max(
            map(len, map(self.door_map.level_name, self.level_names)), default=0
        )
        """So many characters a level's name has at most, before a slash and a door's."""

    def lines(self) -> Iterator[tuple[int, ParsedLine]]:
        """Yield number and content of good lines, until there are too many bad ones."""
        for number, text in numbered_lines(self.path, most_bytes=MOST_LINE_BYTES):
            parsed = self._read(number, text) if text.strip() else None
            if parsed is not None:
                yield number, parsed
            if self.problems.is_full:
                return

    def _read(self, number: int, text: str) -> ParsedLine | None:
        try:
            parsed = parse_event_line(
                text, lookup=self.lookup, order=self.order, path=self.path, line=number
            )
        except FormatError as error:
            self.problems.add(number, error.first)
            return None
        if isinstance(parsed.event, ev.DoorEvent):
            self._learn(parsed.event)
        elif isinstance(parsed.event, ev.LevelAdded):
            self.level_names[parsed.event.level] = parsed.event.name
            self.levels_called.rename(parsed.event.level, parsed.event.name)
        return self._recorded(parsed) if self.as_recorded else parsed

    def _recorded(self, parsed: ParsedLine) -> ParsedLine:
        """Return a line with when it was recorded, if it only says when it happened."""
        happened_ns = parsed.event.happened_ns
        if parsed.recorded_ns is not None or happened_ns is None:
            return parsed
        before_ns, recorded_ns = self._last_ns
        recorded_ns = recorded_ns + 1 if happened_ns == before_ns else happened_ns
        self._last_ns = happened_ns, recorded_ns
        return replace(parsed, recorded_ns=recorded_ns)

    def _learn(self, event: ev.DoorEvent) -> None:
        self.used_ids.add(event.door_id)
        self.greatest_id = max(self.greatest_id, event.door_id)
        if event.sets() & Changed.POSE:
            self.levels[event.door_id] = event.values_set()["level"]
        if isinstance(event, ev.DoorAnnotated) and event.key == "name":
            self.doors_called.rename(event.door_id, event.value)

    # What the reader of a line asks

    def _resolve(self, text: str) -> DoorId:
        text = text.strip()
        found = {*self.doors_called[text]}
        slash = text.find("/")
        while 0 <= slash <= max(self.longest_level, MOST_LEVEL_DIGITS):
            level, name = text[:slash], text[slash + 1 :]
            found |= {
                door_id
                for door_id in self.doors_called[name]
                if self.door_map.level_name(self.levels.get(DoorId(door_id), 0)) == level
            }
            slash = text.find("/", slash + 1)
        if len(found) != 1:
            many = f"{len(found)} doors have" if found else "no door has"
            raise UnknownDoorError(f"door: {many} the name {shown(text)}")
        return DoorId(found.pop())

    def _next_id(self) -> DoorId:
        return next_door_id(self.used_ids, self.greatest_id)

    def _level_of(self, door_id: DoorId) -> int:
        return self.levels.get(door_id, LEVEL_NOT_GIVEN)

    def _level(self, text: str | None) -> int:
        if text is None:
            return LEVEL_NOT_GIVEN
        digits = text.removeprefix(NUMBER_PREFIX)
        numbers = {*self.levels_called[text]}
        if digits.isdecimal() and len(digits) <= MOST_LEVEL_DIGITS:
            numbers.add(int(digits))
        meant = {n: self.level_names[n] for n in numbers if n in self.level_names}
        return level_called(text, meant or self.level_names)


class _Called:
    """Which doors, or levels, bear a name."""

    def __init__(self, names: Iterable[tuple[int, str | None]]) -> None:
        self._names: dict[int, str] = {}
        self._called: defaultdict[str, set[int]] = defaultdict(set)
        for number, name in names:
            self.rename(number, name or "")

    def rename(self, number: int, name: str) -> None:
        """Take in what one is called from now on; empty: nothing."""
        self._called[self._names.get(number, "")].discard(number)
        self._names[number] = name
        if name:
            self._called[name].add(number)

    def __getitem__(self, name: str) -> AbstractSet[int]:
        """Return those that are called so."""
        return self._called.get(name, frozenset())


MOST_PARTS = 100
"""Of so many commits of a file it is looked whether an import that was interrupted wrote one."""
Line = tuple[int, ParsedLine]


class FindsCommands(Protocol):
    """Finds commands in a log."""

    def find(self, command_id: bytes) -> StoredCommand | None:
        """Return that command, if it is stored."""


class HeldLines:
    """Leaves out lines that no log wrote if what they say is in the log by another file."""

    def __init__(self, log: DoorLog, stored: FindsCommands, options: LineOptions) -> None:
        """Look whether the log has commits of the file itself: they are none of another."""
        ids = (options.file_id, *(part_id(options, place) for place in range(MOST_PARTS)))
        own = [found.commit.first_event for each in ids if (found := stored.find(each))]
        self._log = log
        self._before_event = min(own) if own else None
        self._source = options.source
        self._by_source: dict[str, HeldSightings] = {}
        self.lines: list[int] = []
        """Those that were left out, by their numbers."""

    def left(self, lines: Iterable[Line]) -> Iterator[Line]:
        """Yield the lines that are left, in their order."""
        every = iter(lines)
        while some := list(islice(every, AT_ONCE)):
            held = self._held(some)
            self.lines += sorted(held)
            yield from (line for line in some if line[0] not in held)

    def _held(self, lines: list[Line]) -> set[int]:
        """Return the numbers of the lines that the log holds."""
        by_source: dict[str, list[Line]] = {}
        for line in lines:
            parsed = line[1]
            is_own = parsed.command_id is None and parsed.number is None
            if is_own and isinstance(parsed.event, ev.DoorObserved | ev.DoorUpdated):
                by_source.setdefault(parsed.note.source or self._source, []).append(line)
        held: set[int] = set()
        for source, some in by_source.items():
            finder = self._by_source.get(source)
            if finder is None:
                finder = self._by_source[source] = HeldSightings(
                    self._log, source=source, before_event=self._before_event
                )
            found = finder.among(EventBatch.from_events(parsed.event for _, parsed in some))
            held.update(some[place][0] for place in np.flatnonzero(found).tolist())
        return held


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
    """The file's sensor, where it was given."""
    as_recorded: bool = False
    """The times of the lines are when it was known; refused where they cannot be kept."""
    at_ns: int | None = None
    """When events happened whose line does not say; None: when they are recorded."""


class PlannedEvent(NamedTuple):
    """An event for the log."""

    event: ev.Event
    source: int | None
    """Its number in the log that it was exported from."""


@dataclass(frozen=True, slots=True)
class PlannedCommit:
    """A commit for the log; its events are read during iteration, and only once."""

    command_id: bytes
    content: bytes
    note: Note
    recorded_ns: int | None
    """When the log that it was exported from recorded it, also if its first events are gone."""
    count: int
    """How many events it had there; 1 if the lines do not say."""
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


def taken(parsed: ParsedLine, numbers: NumberMap, at_ns: int | None) -> ev.Event | None:
    """Return a line's event for this log; None: it takes back what the file does not hold.

    Raises:
        CommandError: What it takes back does not lie together here.
    """
    event = parsed.event
    if parsed.number is not None:
        told = renamed(event, numbers.ranges)
        if len(told) > 1:
            ranges = [(e.first_event, e.last_event) for e in told if isinstance(e, ev.Retracted)]
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
            _commit_recorded_ns(parsed),
            1 if parsed.commit is None else parsed.commit[1] - parsed.commit[0] + 1,
            parsed.is_exported,
            chain([first], its_lines),
        )


def _commit_recorded_ns(first: ParsedLine) -> int | None:
    """Return when a commit was recorded, by its first line: a log counts on by nanoseconds."""
    if first.recorded_ns is None or first.number is None or first.commit is None:
        return first.recorded_ns
    return max(first.recorded_ns - (first.number - first.commit[0]), 1)


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
    """Return whether two lines that follow each other are of one commit."""
    if (last.command_id, last.note) != (line.command_id, line.note):
        return False
    if line.command_id is not None:
        return last.commit == line.commit
    if last.recorded_ns is None or line.recorded_ns is None:
        return last.recorded_ns is line.recorded_ns
    return line.recorded_ns == last.recorded_ns + 1  # a log's commit counts on by nanoseconds


class NumberMap:
    """Runs of event numbers, of the file and of the log; both ascend, gaps allowed."""

    def __init__(self) -> None:
        self._firsts, self._targets, self._counts = array("q"), array("q"), array("q")

    def add(self, source: int, target: int) -> None:
        """Note what the next event of the file is called in the log.

        A number that is not greater than the last starts over: another log's events follow.
        """
        if self._counts:
            last = self._firsts[-1] + self._counts[-1] - 1
            if source <= last:
                del self._firsts[:], self._targets[:], self._counts[:]
            elif source == last + 1 and target == self._targets[-1] + self._counts[-1]:
                self._counts[-1] += 1
                return
        self._firsts.append(source)
        self._targets.append(target)
        self._counts.append(1)

    def ranges(self, first: int, last: int) -> list[tuple[int, int]]:
        """Return the log's numbers of the file's events `first` to `last`, as few ranges."""
        found: list[tuple[int, int]] = []
        for i in range(max(bisect_right(self._firsts, first) - 1, 0), len(self._firsts)):
            start, target = self._firsts[i], self._targets[i]
            if start > last:
                break
            low, high = max(first, start), min(last, start + self._counts[i] - 1)
            if low > high:
                continue
            piece = target + low - start, target + high - start
            if found and found[-1][1] + 1 == piece[0]:
                found[-1] = found[-1][0], piece[1]
            else:
                found.append(piece)
        return found


class OpenRetractions:
    """Retracted events of a file whose retraction has not come yet."""

    def __init__(self) -> None:
        self._runs: list[tuple[int, int, int]] = []
        """First and last number, and the line of the first."""

    def add(self, number: int, line: int) -> None:
        """Note a retracted event."""
        if self._runs and self._runs[-1][1] + 1 == number:
            first, _, its_line = self._runs[-1]
            self._runs[-1] = first, number, its_line
        else:
            self._runs.append((number, number, line))

    def cover(self, first: int, last: int) -> None:
        """Take note of a retraction of these."""
        left = []
        for low, high, line in self._runs:
            if low < first:
                left.append((low, min(high, first - 1), line))
            if high > last:
                left.append((max(low, last + 1), high, line))
        self._runs = left

    def take(self) -> list[tuple[int, int, int]]:
        """Return what is left, and forget it."""
        left, self._runs = self._runs, []
        return left
