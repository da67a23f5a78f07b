"""Which levels of the logs are one in the building: by their names, else by their numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.events import FloorMap
from semmap_log.fleet.join.joined_logs import JoinedLogs
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window


@dataclass(frozen=True, slots=True)
class LevelPlan:
    """What the levels of each log are in the building."""

    numbers: Mapping[tuple[str, int], int]
    """(log, level) -> level of the building."""
    told_by: Mapping[int, str]
    """Level of the building -> the log whose name and height of it count."""
    drawn_by: Mapping[int, str]
    """Level of the building -> the log whose floor map counts."""

    def of(self, log: str, level: int) -> int:
        """Return a log's level as one of the building."""
        return self.numbers.get((log, level), level)


def level_plan(joined: JoinedLogs, states: Mapping[str, DoorMapState]) -> LevelPlan:
    """Return which levels are one: the reference keeps its numbers, and its floor maps count."""
    others = [log for log in joined.logs if log is not joined.reference]
    names: dict[int, str | None] = {}
    numbers: dict[tuple[str, int], int] = {}
    told_by: dict[int, str] = {}
    drawn_by: dict[int, str] = {}
    for log in (joined.reference, *others):
        known = states[log.name].door_map().levels
        own = {0: None} | {number: level.name for number, level in known.items()}
        own |= {d.level: own.get(d.level) for d in states[log.name].door_map().doors.values()}
        for number, name in sorted(own.items()):
            level = _level_of(number, name, names)
            numbers[log.name, number] = level
            names[level] = names.get(level) or name
            if number in known and known[number].name:
                told_by.setdefault(level, log.name)
        if log.frame is not None:
            for number in _drawn(log.opened):
                drawn_by.setdefault(numbers.get((log.name, number), number), log.name)
    return LevelPlan(numbers, told_by, drawn_by)


def _drawn(reader: LogReader) -> set[int]:
    """Return the levels of which it has a floor map."""
    hidden = reader.retractions()
    batches = map(hidden.visible, reader.batches(Window(kinds=bits_of_kinds([FloorMap]))))
    events = (event for batch in batches for event in batch.to_events())
    return {event.level for event in events if isinstance(event, FloorMap)}


def _level_of(number: int, name: str | None, names: Mapping[int, str | None]) -> int:
    """Return the building's level for a log's: that of the name, else of the number, else new."""
    if name:
        for level, known in names.items():
            if known == name:
                return level
    if number not in names or not name or not names[number]:
        return number
    return max(*names, number) + 1
