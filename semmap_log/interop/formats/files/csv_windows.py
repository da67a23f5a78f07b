"""When the state of a door is known at all: windows of time, and what they do to its rows.

A window is [start, end). At its start the door's last state returns, at its end UNKNOWN follows
every row of that stamp, between windows the state is UNKNOWN.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.model.doors import DoorState
from semmap_log.interop.formats.files.csv_blocks import read_rows
from semmap_log.interop.formats.files.csv_times import instants_of
from semmap_log.interop.formats.parsing.csv_text import meant
from semmap_log.interop.formats.parsing.problems import Problems, shown


@dataclass(frozen=True, slots=True, order=True)
class KnownWindow:
    """A span of time [start, end), nanoseconds UTC; an empty one knows its one instant's rows."""

    start_ns: int
    end_ns: int
    line: int


def read_windows(path: Path, *, tz: str) -> dict[str, list[KnownWindow]]:
    """Return each door's windows, in order of time; those that touch are made one.

    Args:
        path: CSV with the columns door, start, end.
        tz: IANA zone of times without an offset.

    Raises:
        FormatError: The file cannot be read; a window ends before it starts, or two overlap.
    """
    problems = Problems(path)
    windows: dict[str, list[KnownWindow]] = {}
    for rows in read_rows(path, problems, required=("door", "start", "end")):
        starts, _, wrong_starts = instants_of([row.texts[1] for row in rows], tz=tz)
        ends, later_ends, wrong_ends = instants_of([row.texts[2] for row in rows], tz=tz)
        for index, (line, (door, start, end)) in enumerate(rows):
            wrong = wrong_starts.get(index) or wrong_ends.get(index)
            start_ns, end_ns = int(starts[index]), int(ends[index])
            if end_ns < start_ns:  # in the hour that comes twice its second coming may be meant
                end_ns = int(later_ends[index])
            if wrong:
                problems.add(line, wrong)
            elif end_ns < start_ns:
                problems.add(
                    line,
                    f"door {shown(door)}: expected a window that ends after it "
                    f"starts, got {start} to {end}",
                )
            else:
                windows.setdefault(meant(door), []).append(KnownWindow(start_ns, end_ns, line))
    merged = {door: list(_merged(found, door, problems)) for door, found in windows.items()}
    problems.raise_any()
    return merged


def _merged(windows: list[KnownWindow], door: str, problems: Problems) -> Iterator[KnownWindow]:
    windows.sort()
    current = windows[0]
    for window in windows[1:]:
        if window.start_ns < current.end_ns:
            problems.add(
                window.line,
                f"door {shown(door)}: expected windows that do not overlap, "
                f"but this one does that of line {current.line}",
            )
        elif window.start_ns == current.end_ns:
            current = KnownWindow(current.start_ns, window.end_ns, current.line)
        else:
            yield current
            current = window
    yield current


class KnownTimes:
    """Follows one door through its windows: which states come between its rows, and when."""

    def __init__(self, windows: Iterable[KnownWindow]) -> None:
        self.rows_outside = 0
        """How many rows lay in no window."""
        self._edges = deque(
            edge for window in windows for edge in ((window.start_ns, True), (window.end_ns, False))
        )
        """(time, whether a window starts there), in order."""
        self._inside = False
        self._last_row = self._current = DoorState.UNKNOWN

    def before_row(self, ns: int, state: DoorState) -> Iterator[tuple[int, DoorState]]:
        """Yield the (time, state) that come before the next row, which is at `ns`.

        Rows come in order of time. One outside all windows is kept, and UNKNOWN follows it.
        """
        yield from self._pass_edges(row_ns=ns)
        if not self._inside:
            self.rows_outside += 1
            self._inside = True
            self._edges.appendleft((ns, False))
        self._last_row = self._current = state

    def after_rows(self) -> Iterator[tuple[int, DoorState]]:
        """Yield the (time, state) that come after the last row."""
        yield from self._pass_edges(row_ns=None)

    def _pass_edges(self, row_ns: int | None) -> Iterator[tuple[int, DoorState]]:
        """Go through the edges before a row: starts up to its stamp, ends below it only."""
        while self._edges:
            ns, starts = self._edges[0]
            if row_ns is not None and (ns > row_ns or (ns == row_ns and not starts)):
                return
            self._edges.popleft()
            self._inside = starts
            state = self._returning(ns, row_ns) if starts else DoorState.UNKNOWN
            if state != self._current:
                self._current = state
                yield ns, state

    def _returning(self, start_ns: int, row_ns: int | None) -> DoorState:
        """Return the state at a window's start: a row at the same stamp says it itself."""
        is_empty = self._edges[0][0] == start_ns
        return self._current if is_empty or start_ns == row_ns else self._last_row
