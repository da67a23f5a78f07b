"""Door logs as CSV: `timestamp,door,state[,accuracy]`, a row a change or a sighting.

A row with an accuracy is a sighting, one without an update. Times without an offset are a zone's
wall clock. A second file may say in which windows of time a door's state is known at all.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import NAN, DoorState
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorUpdated,
    Event,
)
from semmap_log.formats.csv_rows import Row, read_rows
from semmap_log.formats.csv_times import instants_of
from semmap_log.formats.csv_windows import KnownTimes, Window, read_windows
from semmap_log.formats.problems import Problems, shown
from semmap_log.moments import format_wall, zone

COLUMNS = ("timestamp", "door", "state", "accuracy")
MOST_NAME = 1_000


class Sighting(NamedTuple):
    """What a door was at an instant."""

    happened_ns: int
    door: str
    """Its name, as in the file."""
    state: DoorState
    accuracy: float
    """NaN: an update, not a sighting."""


@dataclass(frozen=True, slots=True)
class Sightings:
    """The rows of a file, with those that its windows add, each door's in order of time."""

    path: Path
    doors: tuple[str, ...]
    """Names, in order of their first rows."""
    door: NDArray[np.uint32]
    """Which of `doors`, for each row."""
    happened_ns: NDArray[np.int64]
    state: NDArray[np.uint8]
    accuracy: NDArray[np.float64]
    """NaN: an update, not a sighting."""
    rows_in_file: int
    """The others say what windows do: UNKNOWN at an end, the last state at a start."""
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.door)

    def __iter__(self) -> Iterator[Sighting]:
        columns = (self.happened_ns, self.door, self.state, self.accuracy)
        for start in range(0, len(self), 65_536):
            part = slice(start, start + 65_536)
            for ns, door, state, accuracy in zip(*(c[part].tolist() for c in columns), strict=True):
                yield Sighting(ns, self.doors[door], DoorState(state), accuracy)


def read_door_csv(path: Path, *, windows: Path | None = None, tz: str) -> Sightings:
    """Return the file's rows. It may be gzipped; it is never held in memory as text.

    Args:
        path: CSV with the columns timestamp, door, state and, if wanted, accuracy.
        windows: CSV with the columns door, start, end; None: all doors are known at all times.
        tz: IANA zone of times without an offset.

    Raises:
        FormatError: A file cannot be read, or a row is wrong; names the lines.
        MomentError: There is no such zone.
    """
    zone(tz)
    known = None if windows is None else read_windows(windows, tz=tz)
    reader = _Reader(Problems(path), known, tz)
    for rows in read_rows(path, reader.problems, required=COLUMNS[:3], optional=COLUMNS[3:]):
        reader.read(rows)
    reader.finish()
    if windows is not None and known is not None:
        _refuse_strangers(windows, known, reader.doors)
    return reader.sightings(path)


def dump_door_csv(rows: Iterable[Sighting], *, tz: str) -> Iterator[str]:
    """Yield the lines of a CSV file that reads as the same rows again.

    Args:
        rows: In order of time for each door.
        tz: The zone whose wall clock is written, with its offset.
    """
    yield ",".join(COLUMNS) + "\n"
    for ns, door, state, accuracy in rows:
        shown_accuracy = "" if math.isnan(accuracy) else repr(float(accuracy))
        yield f"{format_wall(ns, tz)},{_quoted(door)},{state.name},{shown_accuracy}\n"


def sighting_of(event: Event, *, happened_ns: int, door: str) -> Sighting | None:
    """Return the row that says what an event did to a door's state; None where it did nothing.

    The format has one accuracy: of a sensor with two, the one for the state that it saw.
    """
    match event:
        case DoorAdded(state=state):
            return Sighting(happened_ns, door, state, NAN)
        case DoorUpdated(changed=changed, state=state) if Changed.STATE in changed:
            return Sighting(happened_ns, door, state, NAN)
        case DoorObserved(state=DoorState.CLOSED, accuracy_closed=accuracy):
            return Sighting(happened_ns, door, DoorState.CLOSED, accuracy)
        case DoorObserved(state=state, accuracy_open=accuracy):
            return Sighting(happened_ns, door, state, accuracy)
        case DoorPassed(passed=True):
            return Sighting(happened_ns, door, DoorState.OPEN, 1.0)
    return None


@dataclass(slots=True)
class _Door:
    """What the reader remembers of a door."""

    index: int
    last_ns: int
    known: KnownTimes | None
    """None: at all times."""


class _Reader:
    """Takes rows, notes what is wrong, and keeps what is right as columns."""

    def __init__(
        self, problems: Problems, windows: dict[str, list[Window]] | None, tz: str
    ) -> None:
        self.problems = problems
        self.windows = windows
        self.tz = tz
        self.doors: dict[str, _Door] = {}
        self.rows = 0
        # Plain arrays: 13 bytes a row, 21 once there are accuracies.
        self.door = array("I")
        self.happened_ns = array("q")
        self.state = array("B")
        self.accuracy: array[float] | None = None

    def read(self, rows: list[Row]) -> None:
        first, second, wrong = instants_of([row.texts[0].strip() for row in rows], tz=self.tz)
        stamps = zip(rows, first.tolist(), second.tolist(), strict=True)
        for index, ((line, (_, name, state_text, accuracy_text)), ns, later_ns) in enumerate(
            stamps
        ):
            state = self.parsed_state(state_text, line)
            accuracy = self.parsed_accuracy(accuracy_text, line) if accuracy_text else NAN
            door = self.doors.get(name) or self.new_door(name, line)
            if index in wrong:
                self.problems.add(line, wrong[index])
            elif state is not None and door is not None:
                self.add(door, ns if ns >= door.last_ns else later_ns, state, accuracy, line)

    def add(self, door: _Door, ns: int, state: DoorState, accuracy: float, line: int) -> None:
        if ns < door.last_ns:
            last = format_wall(door.last_ns, self.tz)
            self.problems.add(
                line,
                "expected a door's times not to run backwards, got one before "
                f"that of its last row ({last}); sort the file by time",
            )
            return
        door.last_ns = ns
        self.rows += 1
        if door.known is not None:
            for edge_ns, edge_state in door.known.before_row(ns, state):
                self.keep(door, edge_ns, edge_state)
        self.keep(door, ns, state, accuracy)

    def keep(self, door: _Door, ns: int, state: DoorState, accuracy: float = NAN) -> None:
        if self.accuracy is None and not math.isnan(accuracy):
            self.accuracy = array("d", [NAN]) * len(self.door)
        if self.accuracy is not None:
            self.accuracy.append(accuracy)
        self.door.append(door.index)
        self.happened_ns.append(ns)
        self.state.append(state)

    def parsed_state(self, text: str, line: int) -> DoorState | None:
        state = STATES.get(text)
        if state is not None:
            return state
        try:
            return DoorState.parse(text)
        except ValueError as error:
            self.problems.add(line, f"state: {error}")
            return None

    def parsed_accuracy(self, text: str, line: int) -> float:
        try:
            value = float(text)
        except ValueError:
            value = NAN
        if not 0.5 <= value <= 1:
            self.problems.add(
                line,
                f"accuracy: expected a number from 0.5 to 1, or nothing for an "
                f"update, got {shown(text)}",
            )
        return value

    def new_door(self, name: str, line: int) -> _Door | None:
        if not name.strip() or len(name) > MOST_NAME or "\0" in name:
            self.problems.add(
                line,
                f"expected a door's name, of at most {MOST_NAME} characters, got {shown(name)}",
            )
            return None
        windows = (self.windows or {}).get(name)
        door = _Door(len(self.doors), 0, KnownTimes(windows) if windows else None)
        self.doors[name] = door
        return door

    def finish(self) -> None:
        """Let the windows after each door's last row have their say.

        Raises:
            FormatError: Some row was wrong.
        """
        self.problems.raise_any()
        for door in self.doors.values():
            for ns, state in door.known.after_rows() if door.known else ():
                self.keep(door, ns, state)

    def sightings(self, path: Path) -> Sightings:
        length = len(self.door)
        accuracy = (
            np.broadcast_to(np.float64(NAN), length)
            if self.accuracy is None
            else np.frombuffer(self.accuracy, np.float64, length)
        )
        return Sightings(
            path,
            tuple(self.doors),
            np.frombuffer(self.door, np.uint32, length),
            np.frombuffer(self.happened_ns, np.int64, length),
            np.frombuffer(self.state, np.uint8, length),
            accuracy,
            rows_in_file=self.rows,
            warnings=tuple(self.warnings()),
        )

    def warnings(self) -> Iterator[str]:
        for name, door in self.doors.items():
            if door.known is not None and door.known.rows_outside:
                yield (
                    f"door {shown(name)}: rows in none of its windows: "
                    f"{door.known.rows_outside}; UNKNOWN follows each"
                )
            if door.known is None and self.windows is not None:
                yield f"door {shown(name)}: no window; taken as known at all times"


STATES = {text: state for state in DoorState for text in (state.name, state.name.lower())}


def _refuse_strangers(path: Path, windows: dict[str, list[Window]], doors: Iterable[str]) -> None:
    """Raise where a window is of a door that has no row."""
    problems = Problems(path)
    for name in windows.keys() - set(doors):
        for window in windows[name]:
            problems.add(
                window.line, f"expected a door that has rows in the CSV file, got {shown(name)}"
            )
    problems.raise_any()


def _quoted(text: str) -> str:
    if text.strip() == text and not set(text) & set(',"\r\n'):
        return text
    doubled = text.replace('"', '""')
    return f'"{doubled}"'
