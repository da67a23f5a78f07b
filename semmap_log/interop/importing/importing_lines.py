"""What a file of JSON lines means for a log as it stands: its commits, as they were."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from semmap_log.core.batches.event_batch import in_ranges
from semmap_log.core.folds.door_index import DoorIndex
from semmap_log.core.folds.renumbering import begins_ns
from semmap_log.core.model import events as ev
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.doors import suspect_cells, suspect_units
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError, FormatError
from semmap_log.interop.formats.json.door_json import means_same
from semmap_log.interop.formats.json.event_json_reader import ParsedLine
from semmap_log.interop.importing.as_recorded import RecordedTimes, last_recorded_ns
from semmap_log.interop.importing.import_plan import Present, weight_of
from semmap_log.interop.importing.line_commits import (
    HeldLines,
    LineOptions,
    LineReader,
    NumberMap,
    OpenRetractions,
    PlannedCommit,
    grouped,
    taken,
)
from semmap_log.log import DoorLog, StoredCommand, Validator

MOST_KEPT = 100_000
"""Of more lines none is kept in memory: their file is read twice. For `weight_of`."""
NO_CELLS = np.zeros((0, 0), np.int8)


class Stored(Protocol):
    """The commits that a log holds already."""

    def find(self, command_id: bytes) -> StoredCommand | None:
        """Return that command."""

    def events_of(self, commit: Commit) -> Iterator[ev.Event]:
        """Yield the events of a commit."""

    def comings(self, first: int, last: int) -> Iterator[ev.Event]:
        """Yield the DoorAdded and DoorRemoved among the events of these numbers."""


@dataclass(frozen=True, slots=True)
class LinesPlan:
    """What to append of a file, and the messages for the user."""

    path: Path
    count: int
    """How many events the log does not hold yet."""
    commit_count: int
    """In how many commits."""
    why_recorded_now: str
    """Why the times at which it was known cannot be this log's; empty: they are."""
    has_recorded: bool
    """Whether there are such times."""
    left_out: tuple[str, ...]
    warnings: tuple[str, ...]
    groups: int
    """Of how many commits the file is."""
    held_lines: frozenset[int]
    """Lines whose sightings the log holds by another file."""
    nothing: str
    """Why nothing of it can be imported; empty: something can, or the log holds it."""
    options: LineOptions
    _present: Present = field(repr=False)
    _kept: list[tuple[int, ParsedLine]] | None = field(repr=False)
    _begins_ns: dict[int, int] = field(repr=False)
    """Place of a commit -> when it is recorded, where that is later than in its own log."""

    @property
    def summary(self) -> tuple[str, ...]:
        """What the events do, in words."""
        held = len(self.held_lines)
        known = (f"in the log already, by another file: {held:,}",) if held else ()
        if not self.count:
            return known
        said = f"events: {self.count:,}, in {counted(self.commit_count, 'commit')}"
        if not self.has_recorded:
            return (said, *known)
        why = self.why_recorded_now
        kept = (
            f"now, since {why}"
            if why
            else "as in the file, so that `known_at` gives the same answers"
        )
        return said, *known, f"recorded: {kept}"

    @property
    def keeps_recorded(self) -> bool:
        """Whether the times at which it was known are this log's."""
        return self.has_recorded and not self.why_recorded_now

    def commits(self) -> Iterator[PlannedCommit]:
        """Yield the commits of the file, those that the log holds, too.

        Raises:
            FormatError: The file changed since it was planned.
        """
        reader = LineReader(
            self.path, self._present, self.options.tz, as_recorded=self.options.as_recorded
        )
        lines = iter(self._kept) if self._kept is not None else reader.lines()
        left = (line for line in lines if line[0] not in self.held_lines)
        for place, commit in enumerate(grouped(left, self.options, self.groups)):
            begun_ns = self._begins_ns.get(place)
            yield commit if begun_ns is None else replace(commit, recorded_ns=begun_ns)
        reader.problems.raise_any()


def plan_event_lines(
    path: Path, present: Present, options: LineOptions, stored: Stored, *, now_ns: int,
    log: DoorLog | None = None,
) -> LinesPlan:  # fmt: skip
    """Return the commits of a file of JSON lines, gzipped or not; all of it is checked.

    A line may name a door of the log, or one that an earlier line added and named.

    Args:
        path: The file; blank lines are skipped.
        present: What the log holds.
        options: How the lines are taken.
        stored: The commits that the log holds.
        now_ns: The log's clock: nothing was recorded later.
        log: Lines that no log wrote are left out if it holds what they say by another file, from
            the same source where they have one; None: nothing is looked for.

    Raises:
        FormatError: The file cannot be read, or a line is wrong; names the lines.
    """
    return _LinePlanner(path, present, options, stored, now_ns=now_ns, log=log).plan()


class _LinePlanner:
    """Checks every commit of a file: against the log as it will be then, or as the one it holds."""

    def __init__(
        self, path: Path, present: Present, options: LineOptions, stored: Stored, *, now_ns: int,
        log: DoorLog | None,
    ) -> None:  # fmt: skip
        self.present, self.options, self.stored, self.now_ns = present, options, stored, now_ns
        self.reader = LineReader(path, present, options.tz, as_recorded=options.as_recorded)
        self.problems = self.reader.problems
        self.checks = _Checks(present, stored)
        self.held = None if log is None else HeldLines(log, stored, options)
        self.numbers = NumberMap()
        self.times = RecordedTimes(options.log_tz, now_ns)
        self.ended_ns = None if log is None else last_recorded_ns(log)
        self.uncovered = OpenRetractions()
        self.last_source = -1
        self.count = self.commit_count = self.groups = self.stored_count = 0
        self.uses_note = False
        self.zones: dict[str, None] = {}
        """Of the logs that wrote the lines."""
        self.left_out: list[str] = []
        self.suspects: list[str] = []
        self.begins_ns: dict[int, int] = {}
        """For the plan."""
        self.kept: list[tuple[int, ParsedLine]] | None = []
        self.kept_weight = 0

    def plan(self) -> LinesPlan:
        last_id = b""
        for commit in grouped(self.lines(), self.options, None):
            self.groups += 1
            found = self.stored.find(commit.command_id)
            if found is not None:
                self.compare(commit, found)
            else:
                self.check(commit, is_repeated=commit.command_id == last_id)
            last_id = commit.command_id
        self.report_uncovered()
        self.problems.raise_any()
        why = self.why_recorded_now
        if self.options.as_recorded and self.count and why:
            raise FormatError(self.reader.path, f"--as-recorded: {why}")
        return LinesPlan(
            path=self.reader.path,
            count=self.count,
            commit_count=self.commit_count,
            why_recorded_now=self.why_recorded_now,
            has_recorded=self.times.has_any,
            left_out=tuple(self.left_out),
            warnings=tuple(self.warnings()),
            groups=self.groups,
            nothing=self.nothing,
            held_lines=frozenset() if self.held is None else frozenset(self.held.lines),
            options=self.options,
            _present=self.present,
            _kept=self.kept,
            _begins_ns=self.begins_ns,
        )

    @property
    def is_copy(self) -> bool:
        """Whether the log holds nothing but the file's events."""
        return self.stored_count == self.present.next_event

    @property
    def why_recorded_now(self) -> str:
        """Why the times at which it was known cannot be this log's; empty: they can."""
        if self.times.why or self.is_copy:
            return self.times.why
        if self.options.as_recorded:
            return self.times.why_not_after(self.ended_ns)
        return (
            "the log has events of its own (--as-recorded keeps the file's times where all are "
            "later than those)"
        )

    @property
    def nothing(self) -> str:
        """Why nothing of the file can be imported; empty: something can, or the log holds it."""
        if self.count or self.stored_count or (self.held is not None and self.held.lines):
            return ""
        return "; ".join(self.left_out) or "expected a JSON object a line, got none"

    def warnings(self) -> Iterator[str]:
        yield from self.reader.order.warnings()
        yield from self.suspects
        note = self.options.note
        if (note.actor or note.reason) and self.count and not self.uses_note:
            yield (
                "who and why stay as the log that wrote the lines has them; what was given now "
                "is not stored"
            )
        others = [zone for zone in self.zones if zone != self.options.log_tz]
        if others and self.count:
            mine = self.options.log_tz
            yield (
                f"the lines are of a log in {', '.join(others)}, this one is in {mine}: the "
                f"instants stay, but times are shown and days are counted in {mine}; for a new "
                f"log: init --tz {others[0]}"
            )
        early = self.times.happened_later
        if early and self.why_recorded_now:
            yield (
                f"events that happened, as they say, after they were recorded: {early:,}; recorded "
                "later now, they count from when they say"
            )

    def lines(self) -> Iterator[tuple[int, ParsedLine]]:
        lines = self.reader.lines()
        for number, parsed in lines if self.held is None else self.held.left(lines):
            if self.kept is not None:
                self.kept.append((number, parsed))
                self.kept_weight += weight_of(parsed.event)
                if self.kept_weight > MOST_KEPT:
                    self.kept = None
            self.watch(number, parsed)
            yield number, parsed

    def watch(self, line: int, parsed: ParsedLine) -> None:
        """Take note of what is taken back: nothing of it may come to count again."""
        if parsed.timezone:
            self.zones[parsed.timezone] = None
        if parsed.number is None:
            if parsed.retracted:
                self.problems.add(line, "retracted: expected the key event with it, got none")
            return
        if parsed.number <= self.last_source:
            self.report_uncovered()
        self.last_source = parsed.number
        if isinstance(parsed.event, ev.Retracted):
            self.uncovered.cover(parsed.event.first_event, parsed.event.last_event)
        elif parsed.retracted:
            self.uncovered.add(parsed.number, line)

    def report_uncovered(self) -> None:
        for first, last, line in self.uncovered.take():
            which = f"event {first} was" if first == last else f"events {first}..{last} were"
            self.problems.add(
                line,
                f"retracted: {which} taken back, but the line of the Retracted event that did it "
                "is not in the file; add it, or leave out what was taken back",
            )

    def check(self, commit: PlannedCommit, *, is_repeated: bool) -> None:
        """Ask of each line what the log would ask of it, so that the line can be named."""
        before, needed_ns = self.count, 0
        is_kept = self.is_copy or self.options.as_recorded
        recorded_ns = commit.recorded_ns if is_kept else None
        now_ns = self.now_ns if recorded_ns is None else recorded_ns
        self.checks.begin(now_ns, are_facts=commit.is_exported)
        for line, parsed in commit.lines:
            if is_repeated:
                self.problems.add(line, _NOT_ONE)
                is_repeated = False
            event = self.taken(line, parsed)
            if event is None:
                continue
            try:
                self.checks.check(event)
            except CommandError as error:
                self.problems.add(line, str(error))
                continue
            if parsed.number is not None:
                self.numbers.add(parsed.number, self.present.next_event + self.count)
            self.times.add(line, parsed)
            self.suspect_units(line, event)
            needed_ns = max(needed_ns, (event.happened_ns or 0) - (self.count - before))
            self.count += 1
        self.commit_count += self.count > before
        if commit.recorded_ns is not None:
            lost = commit.count - (self.count - before)
            begun_ns = begins_ns(commit.recorded_ns, lost, needed_ns)
            if begun_ns > commit.recorded_ns:
                self.begins_ns[self.groups - 1] = begun_ns
        self.uses_note |= commit.note is self.options.note

    def suspect_units(self, line: int, event: ev.Event) -> None:
        """Take note of values that look like degrees or millimetres."""
        if isinstance(event, ev.DoorAdded | ev.DoorUpdated):
            found = suspect_units(theta=event.theta, width=event.width)
        elif isinstance(event, ev.FloorMap):
            found = suspect_cells(resolution=event.resolution, theta=event.origin_theta)
        else:
            return
        self.suspects += [f"line {line}: {what}" for what in found]

    def compare(self, commit: PlannedCommit, stored: StoredCommand) -> None:
        """Note a line that is another than the one that the log holds of the same command."""
        found = stored.commit
        self.stored_count += found.count
        if stored.seal is not None:
            self.compare_seal(commit, stored)
            return
        there = enumerate(self.stored.events_of(found), start=found.first_event)
        line, is_first = 0, True
        for line, parsed in commit.lines:
            event = self.taken(line, parsed)
            if event is None:
                continue
            number, held = next(there, _NOTHING)
            while is_first and isinstance(held, ev.RobotPose) and not means_same(event, held):
                number, held = next(there, _NOTHING)  # a pose that waited when it was appended
            is_first = False
            if held is None or not means_same(event, held):
                self.problems.add(line, _differs(found))
                return
            if parsed.number is not None:
                self.numbers.add(parsed.number, number)
        is_longer = next(there, None) is not None
        if is_longer or (commit.is_exported and commit.note != found.note):
            self.problems.add(line, _differs(found))

    def compare_seal(self, commit: PlannedCommit, stored: StoredCommand) -> None:
        """Note that the log held another command of that id, of which events were taken out."""
        found, seal = stored.commit, stored.seal
        assert seal is not None, "that is why this is called"
        lines = [(line, parsed, self.taken(line, parsed)) for line, parsed in commit.lines]
        events = [(parsed, event) for _, parsed, event in lines if event is not None]
        given = [event for _, event in events]
        if not seal.fits(commit.command_id, commit.content, commit.note, given):
            self.problems.add(lines[0][0], _differs(found))
            return
        first = found.last_event + 1 - len(events)
        for number, (parsed, _) in enumerate(events, start=first):
            if parsed.number is not None:
                self.numbers.add(parsed.number, number)

    def taken(self, line: int, parsed: ParsedLine) -> ev.Event | None:
        """Return a line's event for this log; None: there is none, which was noted."""
        try:
            event = taken(parsed, self.numbers, self.options.at_ns)
        except CommandError as error:
            self.problems.add(line, str(error))
            return None
        if event is None:
            self.left_out.append(f"line {line}: Retracted, as the file holds nothing of what it "
                                 "took back")  # fmt: skip
        return event


class _Checks:
    """Asks of events what the log will ask, retractions of what the file brings included."""

    def __init__(self, present: Present, stored: Stored) -> None:
        self.stored = stored
        self.index = present.index or DoorIndex.of_map(present.door_map, present.used_ids)
        self.first = self.next = present.next_event
        self.now_ns = 0
        """By which clock the events are recorded: a later time counts as that."""
        self.past = present.past
        self.validator = Validator(self.index, self.next, lambda: self.now_ns, past=self.past)
        self.retracted: list[tuple[int, int]] = []
        """What was retracted since the doors that are left were looked at."""
        self.changes: list[tuple[int, ev.Event]] = []
        """Number and event of what the file changed in the index."""

    def check(self, event: ev.Event) -> None:
        """Let the event pass.

        Raises:
            CommandError: The map forbids it.
        """
        event = self.validator.check(event)
        if isinstance(event, _CHANGING):
            happened_ns = self.now_ns if event.happened_ns is None else event.happened_ns
            happened_ns = min(happened_ns, self.now_ns)
            if isinstance(event, ev.FloorMap):  # only its level counts
                event = replace(event, cells=NO_CELLS)
            self.changes.append((self.next, replace(event, happened_ns=happened_ns)))
        self.next += 1
        if isinstance(event, ev.Retracted):
            self.retracted.append((event.first_event, event.last_event))

    def begin(self, now_ns: int, *, are_facts: bool) -> None:
        """Begin a commit: only events that were retracted before it are unavailable."""
        self.now_ns = now_ns
        last = self.validator
        index = self.without_retracted() if last.has_retraction else last.index
        self.validator = Validator(
            index,
            self.next,
            lambda: self.now_ns,
            are_facts=are_facts,
            past=self.past,
            first_new=self.first,
        )

    def without_retracted(self) -> DoorIndex:
        """Return the doors and levels that are left; what the log holds of levels stays.

        What was retracted stays so: it is looked at once.
        """
        ranges, self.retracted = self.retracted, []
        held = self.index = self.index.copy()
        for first, last in ranges:
            for event in self.stored.comings(first, min(last, self.first - 1)):
                if isinstance(event, ev.DoorAdded):
                    held.placed.pop(event.door_id, None)
                    held.level_of.pop(event.door_id, None)
                elif isinstance(event, ev.DoorRemoved):
                    held.bring_back(event.door_id)
        changes, self.changes = self.changes, []
        hidden = in_ranges(np.array([number for number, _ in changes], np.int64), ranges)
        for change, is_hidden in zip(changes, hidden.tolist(), strict=True):
            if not is_hidden:
                self.changes.append(change)
            elif isinstance(change[1], ev.DoorAdded):
                held.used_ids.add(change[1].door_id)
        index = held.copy()
        for number, event in self.changes:
            index.apply(event, number)
        return index


def _differs(found: Commit) -> str:
    first, last = found.first_event, found.last_event
    where = f"event {first}" if first == last else f"events {first}..{last}"
    return (
        f"command_id: the log already contains this command, as {where}, with other content than "
        "the file; give changed lines new ids, or none"
    )


_NOT_ONE = (
    "command_id: the previous line has the same id, but another commit, actor or reason; "
    "make them equal, or give another id"
)
_NOTHING: tuple[int, ev.Event | None] = (0, None)
_CHANGING = (ev.DoorAdded, ev.DoorRemoved, ev.DoorUpdated, ev.LevelAdded, ev.FloorMap)
