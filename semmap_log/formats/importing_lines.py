"""What a file of JSON lines means for a log as it stands: its events, as they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from semmap_log.commands import Gatekeeper, Roster
from semmap_log.doors import DoorId
from semmap_log.errors import CommandError, FormatError, UnknownDoorError
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorUpdated,
    Event,
    Retracted,
)
from semmap_log.formats.event_json_reader import DoorLookup, ParsedLine, parse_event_line
from semmap_log.formats.files import text_lines
from semmap_log.formats.importing import ImportPlan, Present
from semmap_log.formats.problems import Problems, shown
from semmap_log.formats.strict_json import MOST_LINE_BYTES


def plan_event_lines(path: Path, present: Present, *, tz: str) -> ImportPlan:
    """Return the events of a file of JSON lines, gzipped or not, for one commit.

    A line may name a door of the log, or one that an earlier line added and named. Retractions
    that were exported from a log are left out: their numbers are of that log's events.

    Args:
        path: The file; blank lines are skipped.
        present: What the log holds.
        tz: IANA zone of times without an offset.

    Raises:
        FormatError: The file cannot be read, or a line is wrong; names the lines.
    """
    planner = _LinePlanner(path, present, tz)
    events = planner.events()
    kept = list(islice(events, MOST_KEPT))
    for _ in events:
        pass  # only looked at
    planner.problems.raise_any()
    if planner.count <= MOST_KEPT:
        return planner.plan(kept)
    return planner.plan(_LineEvents(path, present, tz, planner.count))


MOST_KEPT = 100_000
"""Of more events none is kept in memory: their file is read twice."""


@dataclass(frozen=True, slots=True)
class _LineEvents:
    """The events of a file that was found good, read anew each time: they may be many."""

    path: Path
    present: Present
    tz: str
    count: int

    def __iter__(self) -> Iterator[Event]:
        planner = _LinePlanner(self.path, self.present, self.tz)
        yield from planner.events()
        planner.problems.raise_any()
        if planner.count != self.count:
            raise FormatError(self.path, "the file changed while it was imported; import it again")


class _LinePlanner:
    """Reads line after line, and knows the doors as they are after each."""

    def __init__(self, path: Path, present: Present, tz: str) -> None:
        self.path = path
        self.tz = tz
        self.problems = Problems(path)
        self.lookup = DoorLookup(self.resolve, self.next_id, self.level_of)
        self.count = 0
        self.left_out: list[str] = []
        self.noted = 0
        self.door_map = present.door_map
        self.used_ids = set(present.used_ids)
        roster = present.roster or Roster.of_map(present.door_map, present.used_ids)
        self.gatekeeper = Gatekeeper(roster, present.next_event)
        self.free_id = present.next_id
        self.levels = {door.door_id: door.level for door in present.door_map.doors.values()}
        self.names = {door.door_id: door.name or "" for door in present.door_map.doors.values()}

    def plan(self, events: Iterable[Event]) -> ImportPlan:
        warnings = [
            f"lines that say who or why: {self.noted:,}; an import is one commit, with one note"
        ]
        return ImportPlan(
            events,
            count=self.count,
            summary=(f"events: {self.count:,}",),
            left_out=tuple(self.left_out),
            warnings=tuple(warnings) if self.noted else (),
        )

    def events(self) -> Iterator[Event]:
        """Yield the events of good lines, until there are too many bad ones."""
        lines = text_lines(self.path, most_bytes=MOST_LINE_BYTES)
        for number, text in enumerate(lines, start=1):
            event = self.read(number, text) if text.strip() else None
            if event is not None:
                self.count += 1
                yield event
            if self.problems.is_full:
                return

    def read(self, number: int, text: str) -> Event | None:
        try:
            line = parse_event_line(
                text, tz=self.tz, lookup=self.lookup, path=self.path, line=number
            )
            return self.take(line, number)
        except FormatError as error:
            self.problems.add(number, error.first)
            return None

    def take(self, line: ParsedLine, number: int) -> Event | None:
        event = line.event
        if isinstance(event, Retracted) and line.number is not None:
            self.left_out.append(
                f"line {number}: Retracted, as it numbers the events of the log "
                "that it was exported from"
            )
            return None
        self.check(event, number)
        if isinstance(event, DoorEvent):
            self.learn(event)
        self.noted += bool(line.actor or line.source or line.reason or line.correlation)
        return event

    def check(self, event: Event, number: int) -> None:
        """Ask of each line what the log would ask of it, so that the line can be named."""
        try:
            self.gatekeeper.check(event)
        except CommandError as error:
            self.problems.add(number, str(error))

    def learn(self, event: DoorEvent) -> None:
        self.used_ids.add(event.door_id)
        self.free_id = max(self.free_id, DoorId(event.door_id + 1))
        if isinstance(event, DoorAdded) or (
            isinstance(event, DoorUpdated) and Changed.POSE in event.changed
        ):
            self.levels[event.door_id] = event.level
        if isinstance(event, DoorAnnotated) and event.key == "name":
            self.names[event.door_id] = event.value

    # What the reader of a line asks

    def resolve(self, text: str) -> DoorId:
        found = [
            door_id
            for door_id, name in self.names.items()
            if name
            and text in (name, f"{self.door_map.level_name(self.levels.get(door_id, 0))}/{name}")
        ]
        if len(found) != 1:
            many = f"{len(found)} doors have" if found else "no door has"
            raise UnknownDoorError(f"door: {many} the name {shown(text)}")
        return found[0]

    def next_id(self) -> DoorId:
        return self.free_id

    def level_of(self, door_id: DoorId) -> int:
        return self.levels.get(door_id, 0)
