"""The lines of a file of JSON lines, each read with the doors as they are after those before it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from collections.abc import Set as AbstractSet
from dataclasses import replace
from pathlib import Path

from semmap_log.core.folds.levels import NUMBER_PREFIX, level_called, levels_of
from semmap_log.core.model.doors import LEVEL_NOT_GIVEN, DoorId, next_door_id
from semmap_log.core.model.events import DoorAnnotated, DoorEvent, LevelAdded
from semmap_log.core.model.meaning import Changed
from semmap_log.errors import FormatError, UnknownDoorError
from semmap_log.interop.formats.json.event_json_reader import (
    DoorLookup,
    ParsedLine,
    parse_event_line,
)
from semmap_log.interop.formats.parsing.file_order import FileOrder
from semmap_log.interop.formats.parsing.foreign_file import numbered_lines
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.interop.formats.parsing.strict_json import MOST_LINE_BYTES
from semmap_log.interop.importing.import_plan import Present

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
        if isinstance(parsed.event, DoorEvent):
            self._learn(parsed.event)
        elif isinstance(parsed.event, LevelAdded):
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

    def _learn(self, event: DoorEvent) -> None:
        self.used_ids.add(event.door_id)
        self.greatest_id = max(self.greatest_id, event.door_id)
        if event.sets() & Changed.POSE:
            self.levels[event.door_id] = event.values_set()["level"]
        if isinstance(event, DoorAnnotated) and event.key == "name":
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
