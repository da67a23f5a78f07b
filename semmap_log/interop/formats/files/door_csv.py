"""Door logs as CSV: `timestamp,door,state[,accuracy]`, a row a change or a sighting.

A row with an accuracy is a sighting, one without is an update, unless the caller gives the accuracy
of all that have none. Times without an offset are a zone's wall clock; in the hour that comes twice
the order of the rows decides which is meant. A second file may have the windows of time in which a
door's state is known at all. `csv_text` escapes names that a spreadsheet or a terminal would obey.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.doors import NAN, DoorState
from semmap_log.core.model.events import Event
from semmap_log.core.model.moments import format_wall, zone
from semmap_log.interop.formats.files import csv_blocks, csv_windows
from semmap_log.interop.formats.files.csv_sightings import Sighting, SightingColumns, Sightings
from semmap_log.interop.formats.files.door_table import TableForm
from semmap_log.interop.formats.parsing import text_column
from semmap_log.interop.formats.parsing.foreign_file import FileOrder, numbered_lines
from semmap_log.interop.formats.parsing.problems import Problems, shown

COLUMNS = ("timestamp", "door", "state", "accuracy")
MOST_NAME = 1_000


def read_door_csv(
    path: Path, *, windows: Path | None = None, tz: str, form: TableForm | None = None,
    accuracy: float | None = None,
) -> Sightings:  # fmt: skip
    """Return the file's rows. It may be gzipped; it is never held in memory as text.

    Args:
        path: CSV with the columns timestamp, door, state and, if wanted, accuracy.
        form: How it is written, if otherwise; None: as above, with commas or semicolons.
        windows: CSV with the columns door, start, end; None: all doors are known at all times.
        tz: IANA zone of times without an offset.
        accuracy: Of rows without one, which are then sightings; None: they are updates.

    Raises:
        FormatError: A file cannot be read, or a row is wrong; names the lines.
        MomentError: There is no such zone.
    """
    zone(tz)
    known = None if windows is None else csv_windows.read_windows(windows, tz=tz)
    reader = _Reader(Problems(path), known, tz, accuracy)
    left_out: tuple[str, ...] = ()
    if form is None and not _has_semicolons(path):
        _read_ours(path, reader)
    else:
        foreign = csv_blocks.ForeignRows(path, form or TableForm(), reader.problems)
        for rows in foreign.blocks():
            reader.read(rows)
        left_out = foreign.left_out()
    reader.finish()
    if windows is not None and known is not None:
        _check_known_doors(windows, known, reader.doors)
    return replace(reader.sightings(path), left_out=left_out)


def _read_ours(path: Path, reader: _Reader) -> None:
    """Read a file of our own form, whole blocks at once where they are plain."""
    table = csv_blocks.CsvBlocks(
        path, reader.problems, required=COLUMNS[:3], optional=COLUMNS[3:],
        hint="; of another system's: --columns, or --preset",
    )  # fmt: skip
    for block in table.blocks():
        columns = table.columns(block) if reader.windows is None else None
        if columns is None or not reader.take(columns):
            reader.read(table.rows(block))
        if reader.problems.is_full:
            break


def _has_semicolons(path: Path) -> bool:
    """Return whether semicolons separate the header's names, as some spreadsheets write them."""
    _, header = next(numbered_lines(path, most_bytes=csv_blocks.MOST_LINE_BYTES), (1, ""))
    return ";" in header and "," not in header


def dump_door_csv(rows: Iterable[Sighting], *, tz: str) -> Iterator[str]:
    """Yield the lines of a CSV file that reads as the same rows again.

    Args:
        rows: In order of time for each door.
        tz: The zone whose wall clock is written, with its offset.
    """
    yield ",".join(COLUMNS) + "\n"
    for ns, door, state, accuracy in rows:
        shown_accuracy = "" if math.isnan(accuracy) else repr(float(accuracy))
        name = _quoted(text_column.harmless(door))
        yield f"{format_wall(ns, tz)},{name},{state.name},{shown_accuracy}\n"


def sighting_of(event: Event, *, happened_ns: int, door: str) -> Sighting | None:
    """Return the row that says what an event did to a door's state; None where it did nothing.

    The format has one accuracy: of a sensor with two, the one for the state that it saw.
    """
    state = event.values_set().get("state")
    if state is None:
        return None
    name = "accuracy_closed" if state is DoorState.CLOSED else "accuracy_open"
    accuracy = getattr(event, name, 1.0) if event.effect.is_sighting else NAN
    return Sighting(happened_ns, door, state, accuracy)


class _Reader:
    """Takes rows, notes what is wrong, and keeps what is right as columns."""

    def __init__(
        self,
        problems: Problems,
        windows: dict[str, list[csv_windows.KnownWindow]] | None,
        tz: str,
        accuracy: float | None,
    ) -> None:
        self.problems = problems
        self.windows = windows
        self.tz = tz
        self.accuracy = NAN if accuracy is None else accuracy
        """Of rows without one."""
        self.order = FileOrder(tz)
        self.names = text_column.TextCodes()
        self.states = text_column.TextCodes()
        self.known: list[csv_windows.KnownTimes | None] = []
        """Of each door; None: at all times."""
        self.last_ns = np.zeros(16, np.int64)
        """Of each door: when its last row happened."""
        self.has_odd_names = False
        """Some of them read like others that are written harmlessly."""
        self.rows = 0
        self.kept = SightingColumns()
        self.waiting: list[tuple[int, int, int, float]] = []
        """Rows that were read one by one and are not among the columns yet."""

    @property
    def doors(self) -> list[str]:
        """Names, in order of their first rows."""
        return [text.decode() for text in self.names.texts]

    def take(self, columns: csv_blocks.Columns) -> bool:
        """Keep the rows of a plain block all at once; False: something about them is odd."""
        times, names, states, accuracies = columns.texts
        assert times is not None
        assert names is not None
        assert states is not None
        if not columns.lines:
            return True
        ns, second_ns, wrong = csv_windows.instants_in(times, tz=self.tz)
        state = self.state_numbers(states)
        accuracy = None if accuracies is None else text_column.decimals_in(accuracies)
        if wrong or state is None or not _are_shares(accuracy, accuracies):
            return False
        if (ns != second_ns).any():  # the order of the rows decides
            return False
        door = self.door_numbers(names)
        if door is None or not self.runs_forward(door, ns):
            return False
        self.order.pass_clear(ns)
        self.rows += len(ns)
        if not math.isnan(self.accuracy):
            given = np.full(len(ns), NAN) if accuracy is None else accuracy
            accuracy = np.where(np.isnan(given), self.accuracy, given)
        self.kept.add(door, ns, state, accuracy)
        return True

    def state_numbers(self, column: text_column.TextColumn) -> NDArray[np.uint8] | None:
        """Return the states; None: one of the texts is none."""
        codes = self.states.codes_of(column, accepts=_is_state)
        if codes is None:
            return None
        known = [DoorState.parse(text.decode()) for text in self.states.texts]
        return np.array(known, np.uint8)[codes]

    def door_numbers(self, column: text_column.TextColumn) -> NDArray[np.int64] | None:
        """Return the doors, new ones among them; None: a name is odd."""
        if self.has_odd_names:  # what is read as one of them may be written as another
            return None
        codes = self.names.codes_of(column, accepts=_is_plain_name)
        for text in self.names.texts[len(self.known) :]:
            self.begin(text.decode())
        return codes

    def runs_forward(self, door: NDArray[np.int64], ns: NDArray[np.int64]) -> bool:
        """Return whether no door's times run backwards, and remember the last ones if so."""
        if not ((np.diff(ns) >= 0).all() and ns[0] >= self.last_ns.max()):
            order = np.argsort(door, kind="stable")
            doors, times = door[order], ns[order]
            begins = np.flatnonzero(np.diff(doors, prepend=-1))
            steps = np.diff(times, prepend=times[:1])
            steps[begins] = times[begins] - self.last_ns[doors[begins]]
            if (steps < 0).any():
                return False
        self.last_ns[door] = ns  # of assignments to the same place numpy keeps the last
        return True

    def read(self, rows: list[csv_blocks.Row]) -> None:
        """Read rows one by one."""
        first, second, wrong = csv_windows.instants_of([row.texts[0] for row in rows], tz=self.tz)
        stamps = zip(rows, first.tolist(), second.tolist(), strict=True)
        for index, ((line, (_, name, state_text, accuracy_text)), ns, later_ns) in enumerate(
            stamps
        ):
            if self.problems.is_full:
                return
            state = self.parsed_state(state_text, line)
            accuracy = self.parsed_accuracy(accuracy_text, line) if accuracy_text else self.accuracy
            named = text_column.meant(name)
            door = self.names.code_of(named.encode())
            if door is None:
                door = self.new_door(named, line)
            if index in wrong:
                is_number = rows[index].texts[0].replace(".", "", 1).isdecimal()
                hint = " --time-unit says what a number counts." if is_number else ""
                self.problems.add(line, f"{wrong[index]}{hint}")
            elif state is not None and door is not None:
                happened_ns = self.order.chosen(ns, later_ns, own_last_ns=int(self.last_ns[door]))
                self.add(door, happened_ns, state, accuracy, line)
        self.keep_waiting()

    def add(self, door: int, ns: int, state: DoorState, accuracy: float, line: int) -> None:
        if ns < self.last_ns[door]:
            last = format_wall(int(self.last_ns[door]), self.tz)
            self.problems.add(
                line,
                "expected a door's times not to run backwards, got one before "
                f"that of its last row ({last}); sort the file by time",
            )
            return
        self.last_ns[door] = ns
        self.rows += 1
        known = self.known[door]
        if known is not None:
            for edge_ns, edge_state in known.before_row(ns, state):
                self.waiting.append((door, edge_ns, edge_state, NAN))
        self.waiting.append((door, ns, state, accuracy))

    def keep_waiting(self) -> None:
        """Put the rows that wait among the columns."""
        if self.waiting:
            doors, ns, states, accuracies = zip(*self.waiting, strict=True)
            accuracy = np.array(accuracies)
            self.kept.add(
                np.array(doors, np.int64),
                np.array(ns, np.int64),
                np.array(states, np.uint8),
                None if np.isnan(accuracy).all() else accuracy,
            )
            self.waiting = []

    def parsed_state(self, text: str, line: int) -> DoorState | None:
        state = STATES.get(text)
        if state is not None:
            return state
        try:
            return DoorState.parse(text)
        except ValueError as error:
            self.problems.add(line, f"state: {error}; --states says what another word means")
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

    def new_door(self, name: str, line: int) -> int | None:
        if not name.strip() or len(name) > MOST_NAME or "\0" in name:
            self.problems.add(
                line,
                f"expected a door's name, of at most {MOST_NAME} characters, got {shown(name)}",
            )
            return None
        self.has_odd_names |= text_column.is_written_otherwise(name)
        door = self.names.add(name.encode())
        self.begin(name)
        return door

    def begin(self, name: str) -> None:
        """Make room for what is remembered of one more door."""
        windows = (self.windows or {}).get(name)
        self.known.append(csv_windows.KnownTimes(windows) if windows else None)
        if len(self.known) > len(self.last_ns):
            self.last_ns = np.concatenate([self.last_ns, np.zeros_like(self.last_ns)])

    def finish(self) -> None:
        """Let the windows after each door's last row have their say.

        Raises:
            FormatError: Some row was wrong.
        """
        self.problems.raise_any()
        for door, known in enumerate(self.known):
            for ns, state in known.after_rows() if known else ():
                self.waiting.append((door, ns, state, NAN))
        self.keep_waiting()

    def sightings(self, path: Path) -> Sightings:
        return Sightings(
            path, tuple(self.doors), self.kept, self.rows, warnings=tuple(self.warnings())
        )

    def warnings(self) -> Iterator[str]:
        yield from self.order.warnings()
        for name, known in zip(self.doors, self.known, strict=True):
            if known is not None and known.rows_outside:
                yield (
                    f"door {shown(name)}: rows in none of its windows: "
                    f"{known.rows_outside}; UNKNOWN follows each"
                )
            if known is None and self.windows is not None:
                yield f"door {shown(name)}: no window; taken as known at all times"


def _is_plain_name(text: bytes) -> bool:
    name = text.decode()
    return bool(name) and name == name.strip() and not text_column.is_written_otherwise(name)


def _is_state(text: bytes) -> bool:
    try:
        DoorState.parse(text.decode())
    except ValueError:
        return False
    return True


def _are_shares(accuracy: NDArray[np.float64] | None, texts: text_column.TextColumn | None) -> bool:
    """Return whether all accuracies are from 0.5 to 1, or not given."""
    if accuracy is None or texts is None:
        return True
    return bool((((accuracy >= 0.5) & (accuracy <= 1)) | (texts.lengths == 0)).all())


STATES = {text: state for state in DoorState for text in (state.name, state.name.lower())}


def _check_known_doors(
    path: Path, windows: dict[str, list[csv_windows.KnownWindow]], doors: Iterable[str]
) -> None:
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
