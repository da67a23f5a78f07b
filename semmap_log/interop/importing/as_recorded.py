"""Files whose times are when it was known: a commit for each time, recorded then.

So one can query what was known at a moment in a history that another program wrote. A log's
recorded times only grow: none of a file may be earlier than what the log has. What is of the same
time as the log's last commit is recorded just after it, as doors after the plan of one day. The
recorded times of JSON lines are checked in the same way.

Rooms get their names from a building's file, which names points. Where one such point lies in a
room, and no other, the room gets its name; each of its doors has it in the annotation `rooms`. So
the name stays with the doors wherever the floor plan comes from later.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

from semmap_log.analysis.rooms.level_rooms import LevelRooms, level_rooms, sides_of
from semmap_log.analysis.rooms.room_graph import OUTSIDE, ROOMS, RoomId
from semmap_log.core.batches.event_batch import EventBatch, one_by_one
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Note
from semmap_log.core.model.doors import NAN, Door, DoorId, DoorState
from semmap_log.core.model.events import Event
from semmap_log.core.model.moments import format_local
from semmap_log.core.texts import counted
from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor, TablePlace
from semmap_log.interop.formats.json.event_json_reader import ParsedLine
from semmap_log.interop.importing.import_plan import ImportPlan
from semmap_log.log import DoorLog, DoorLogWriter

MOST_SORTED = 200_000
"""Of more events the file has to have them in order of time."""
SAME_TIME_NS = 1_000_000
"""By so much a file may begin before the log's end: each event of a commit takes a nanosecond."""
TOLD_EVERY = 1000
"""Commits between two words of progress."""


def append_as_recorded(
    log: DoorLogWriter, path: Path, plan: ImportPlan, *, note: Note, file_id: bytes,
    progress: Progress | None = None,
) -> int:  # fmt: skip
    """Append a file's events as commits that were recorded when they happened.

    Who is interrupted imports the file again: it goes on where it stopped.

    Returns:
        The first event's number.

    Raises:
        FormatError: An event has no time, or the log's order does not allow one.
        CommandError: The map forbids an event; what was before it is stored.
        LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
    """
    first_ns, last_ns = _span(path, plan)
    _check_order(log, path, first_ns, last_ns)
    if last_recorded_ns(log) is None and not log.begin_at(first_ns - 1):
        raise FormatError(path, "--as-recorded: the log had events before, so it has begun already")
    first_event: int | None = None
    ended_ns = last_recorded_ns(log) or 0
    done = 0
    for count, (at_ns, events) in enumerate(groupby(_in_order(path, plan), key=_time_of)):
        some = list(events)
        done += len(some)
        is_last = done == plan.count
        command_id = file_id if is_last else _id_at(file_id, at_ns)
        commit = log.take_over(
            _given(some), note=note, command_id=command_id, content=command_id, are_facts=False,
            recorded_ns=max(at_ns, ended_ns + 1),
        )  # fmt: skip
        ended_ns = commit.closed_ns
        first_event = commit.first_event if first_event is None else first_event
        if progress is not None and count % TOLD_EVERY == 0:
            progress(done, plan.count)
    log.sync()
    assert first_event is not None
    return first_event


def _span(path: Path, plan: ImportPlan) -> tuple[int, int]:
    """Return the first and the last time of a file's events.

    Raises:
        FormatError: One has none; or they are out of order, and too many to be sorted.
    """
    first_ns = last_ns = before_ns = -1
    is_ordered = True
    for times in _times(plan.events):
        for at_ns in times:
            if at_ns <= 0:
                raise FormatError(
                    path, "--as-recorded: expected a time of each event; this file says none: give "
                    "it with --since, or --at",
                )  # fmt: skip
            is_ordered &= at_ns >= before_ns
            before_ns = at_ns
            first_ns = at_ns if first_ns < 0 else min(first_ns, at_ns)
            last_ns = max(last_ns, at_ns)
    if not is_ordered and plan.count > MOST_SORTED:
        raise FormatError(
            path, f"--as-recorded: expected times in order, or at most {MOST_SORTED:,} events; "
            "sort the file by time",
        )  # fmt: skip
    return first_ns, last_ns


def _check_order(log: DoorLogWriter, path: Path, first_ns: int, last_ns: int) -> None:
    """Check that the log can still record all of it at its own times.

    Raises:
        FormatError: It cannot.
    """
    zone, now_ns = log.info.timezone, log.now_ns()
    if last_ns > now_ns:
        raise FormatError(
            path, f"--as-recorded: expected times up to now, got {format_local(last_ns, zone)}"
        )
    ended_ns = last_recorded_ns(log)
    if ended_ns is not None and first_ns < ended_ns - SAME_TIME_NS:
        raise FormatError(
            path, "--as-recorded: recorded times only grow: expected no time before the log's "
            f"last commit, {format_local(ended_ns, zone)}, got {format_local(first_ns, zone)}; "
            "import it into a new log before anything else, or without --as-recorded",
        )  # fmt: skip


def _in_order(path: Path, plan: ImportPlan) -> Iterator[Event]:
    """Yield the events in order of time; those of one time as the file has them."""
    if plan.count > MOST_SORTED:
        yield from one_by_one(plan.events)
        return
    events = sorted(one_by_one(plan.events), key=_time_of)
    if len(events) != plan.count:
        raise FormatError(path, "it changed while it was imported; import it again")
    yield from events


def _time_of(event: Event) -> int:
    return event.happened_ns or 0


def _times(events: Iterable[Event | EventBatch]) -> Iterator[list[int]]:
    for each in events:
        if isinstance(each, EventBatch):
            yield each.happened_ns.tolist()
        else:
            yield [-1 if each.happened_ns is None else each.happened_ns]


def _given(events: list[Event]) -> Callable[[int], Iterable[Event]]:
    return lambda _: events


def _id_at(file_id: bytes, at_ns: int) -> bytes:
    return hashlib.sha256(file_id + f"known at {at_ns}".encode()).digest()[: len(file_id)]


Number = int
"""Of a door in the table."""


def with_room_names(table: DoorTable) -> DoorTable:
    """Return a building whose doors say what the rooms on their sides are called.

    Raises:
        CostmapError: A floor plan is turned against its grid.
    """
    told: dict[Number, dict[str, str]] = {}
    used: set[TablePlace] = set()
    for floor in table.floor_maps:
        numbers = [n for n, door in enumerate(table.doors) if door.level == floor.level]
        doors = [_door(table.doors[n]) for n in numbers]
        rooms = level_rooms(floor, doors)
        named = _named(rooms, [place for place in table.places if place.level == floor.level])
        sides = sides_of(rooms, doors) if doors else []
        for number, (left, right) in zip(numbers, sides, strict=True):
            names = [named[side].name if side in named else "" for side in (left, right)]
            if any(names) and left != right:
                told[number] = {ROOMS: ",".join(names)}
                used |= {named[side] for side in (left, right) if side in named}
    annotated_doors = tuple(
        replace(door, annotations={**door.annotations, **told.get(number, {})})
        for number, door in enumerate(table.doors)
    )
    return replace(
        table,
        doors=annotated_doors,
        left_out=(*table.left_out, *_said(len(table.places), len(used))),
    )


def _named(rooms: LevelRooms, places: Sequence[TablePlace]) -> dict[RoomId | None, TablePlace]:
    """Return the places that lie alone in a room, or with others of the same name, by room."""
    inside: defaultdict[RoomId, list[TablePlace]] = defaultdict(list)
    for place in places:
        inside[int(rooms.rooms_at(place.x, place.y))].append(place)
    return {
        room: found[0]
        for room, found in inside.items()
        if room > OUTSIDE and len({place.name for place in found}) == 1 and "," not in found[0].name
    }


def _said(places: int, used: int) -> Iterable[str]:
    if places > used:
        yield (
            f"{counted(places - used, 'named point')}: one names a room where it lies there alone, "
            "at the room's doors"
        )


def _door(door: TableDoor) -> Door:
    return Door(
        DoorId(0), door.level, door.x, door.y, door.theta, door.width, DoorState.UNKNOWN, NAN, NAN
    )


def last_recorded_ns(log: DoorLog) -> int | None:
    """Return when a log's last commit was recorded; None: it has none."""
    last = log.last_event()
    commit = log.find_commit(last) if last >= 0 else None
    return None if commit is None else commit.closed_ns


@dataclass(slots=True)
class RecordedTimes:
    """Goes along with the lines of a file."""

    tz: str
    """The log's, for messages."""
    now_ns: int
    """The log's clock: nothing was recorded later."""
    has_any: bool = False
    """Some line says when it was recorded."""
    why: str = ""
    """Why they cannot be a log's, with the line; empty: they can."""
    happened_later: int = 0
    """So many events say that they happened after they were recorded."""
    _first: tuple[int, int] | None = None
    """Line and time of the first."""
    _last: tuple[int, int] = (0, 1)

    def add(self, line: int, parsed: ParsedLine) -> None:
        """Take note of the next event: its time has to be later than the last, and not to come."""
        recorded_ns, happened_ns = parsed.recorded_ns, parsed.event.happened_ns
        self.has_any |= recorded_ns is not None
        if self.why:
            return
        if recorded_ns is None:
            self.why = f"line {line} does not say when it was recorded"
        elif recorded_ns <= self._last[1]:
            self.why = (
                f"line {line} was recorded at {self._told(recorded_ns)}, not after line "
                f"{self._last[0]} ({self._told(self._last[1])}): recorded times only grow"
            )
        elif recorded_ns > self.now_ns:
            self.why = f"line {line} was recorded at {self._told(recorded_ns)}, which is to come"
        else:
            self._first = self._first or (line, recorded_ns)
            self._last = (line, recorded_ns)
            self.happened_later += happened_ns is not None and happened_ns > recorded_ns

    def why_not_after(self, ended_ns: int | None) -> str:
        """Return why they cannot follow what a log has; empty: they can.

        Args:
            ended_ns: When the log's last commit was recorded; None: it has none.
        """
        if self._first is None or ended_ns is None or self._first[1] > ended_ns:
            return ""
        line, recorded_ns = self._first
        return (
            f"line {line} was recorded at {self._told(recorded_ns)}, not after the log's last "
            f"commit ({self._told(ended_ns)}): recorded times only grow"
        )

    def _told(self, ns: int) -> str:
        return format_local(ns, self.tz)
