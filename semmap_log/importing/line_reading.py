"""The lines of a file of JSON lines, each read with the doors as they are after those before it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from semmap_log.domain.doors import LEVEL_NOT_GIVEN, DoorId, next_door_id
from semmap_log.domain.events import DoorAnnotated, DoorEvent, LevelAdded
from semmap_log.domain.meaning import Changed
from semmap_log.errors import FormatError, UnknownDoorError
from semmap_log.folds.levels import level_called, levels_of
from semmap_log.formats.json.event_json_reader import DoorLookup, ParsedLine, parse_event_line
from semmap_log.formats.parsing.foreign_file import numbered_lines
from semmap_log.formats.parsing.problems import Problems, shown
from semmap_log.formats.parsing.strict_json import MOST_LINE_BYTES
from semmap_log.importing.import_plan import Present


class LineReader:
    """Reads line after line, and knows the doors as they are after each."""

    def __init__(self, path: Path, present: Present, tz: str) -> None:
        self.path = path
        self.tz = tz
        self.problems = Problems(path)
        self.lookup = DoorLookup(self._resolve, self._next_id, self._level_of, self._level)
        self.door_map = present.door_map
        self.used_ids, self.greatest_id = {*present.used_ids}, present.greatest_id
        self.level_names = {n: level.name for n, level in levels_of(present.door_map).items()}
        self.levels = {door.door_id: door.level for door in present.door_map.doors.values()}
        self.names = {door.door_id: door.name or "" for door in present.door_map.doors.values()}

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
                text, tz=self.tz, lookup=self.lookup, path=self.path, line=number
            )
        except FormatError as error:
            self.problems.add(number, error.first)
            return None
        if isinstance(parsed.event, DoorEvent):
            self._learn(parsed.event)
        elif isinstance(parsed.event, LevelAdded):
            self.level_names[parsed.event.level] = parsed.event.name
        return parsed

    def _learn(self, event: DoorEvent) -> None:
        self.used_ids.add(event.door_id)
        self.greatest_id = max(self.greatest_id, event.door_id)
        if event.sets() & Changed.POSE:
            self.levels[event.door_id] = event.values_set()["level"]
        if isinstance(event, DoorAnnotated) and event.key == "name":
            self.names[event.door_id] = event.value

    # What the reader of a line asks

    def _resolve(self, text: str) -> DoorId:
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

    def _next_id(self) -> DoorId:
        return next_door_id(self.used_ids, self.greatest_id)

    def _level_of(self, door_id: DoorId) -> int:
        return self.levels.get(door_id, LEVEL_NOT_GIVEN)

    def _level(self, text: str | None) -> int:
        return LEVEL_NOT_GIVEN if text is None else level_called(text, self.level_names)
