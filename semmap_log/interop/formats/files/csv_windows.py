"""Windows of time in which the state of a door is known at all, and what they do to its rows.

A window is [start, end). At its start the door's last state returns, at its end UNKNOWN follows
every row of that stamp, between windows the state is UNKNOWN. Columns of ISO-8601 texts are parsed
to instants all at once.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import SECOND_NS, both_instants, wall_offsets_s
from semmap_log.errors import MomentError
from semmap_log.interop.formats.files.csv_blocks import read_rows
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.interop.formats.parsing.text_column import TextColumn, meant, number_at


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


DAY_S = 86_400
LAST_S = MAX_TIME_NS // SECOND_NS - 1
MOST_RUNS = 1000

_PATTERN = re.compile(
    r"0000-00-00[T ]00:00(?P<second>:00(?:[.,](?P<fraction>0{1,9}))?)?"
    r"(?P<offset> ?(?:[Zz]|(?P<sign>[+-])00(?::?(?P<minutes>00))?))?"
)
"""A time with each digit made 0: those that are read all at once."""


def instants_of(
    texts: Sequence[str], *, tz: str
) -> tuple[NDArray[np.int64], NDArray[np.int64], dict[int, str]]:
    """Return what `both_instants` returns for each text, much faster.

    Returns:
        The first instants, the second ones (different in the hour that comes twice only), and
        for the texts that are no times (both 0) what is wrong with them.
    """
    return instants_in(TextColumn.of(texts), tz=tz)


def instants_in(
    column: TextColumn, *, tz: str
) -> tuple[NDArray[np.int64], NDArray[np.int64], dict[int, str]]:
    """Return the same of a column of texts."""
    first = np.full(len(column), -1, np.int64)
    for pattern, rows, places in column.patterns():
        found = _PATTERN.fullmatch(pattern.decode("latin-1"))
        if found is not None:
            first[rows] = _instants(places, found, tz)
    second = first.copy()
    wrong: dict[int, str] = {}
    for index in np.flatnonzero(first < 0).tolist():
        first[index] = second[index] = 0
        try:
            text = column.text_at(index)
            first[index], second[index] = both_instants(text, tz=tz)
        except MomentError as error:
            wrong[index] = str(error)
    return first, second, wrong


def _instants(places: NDArray[np.uint8], found: re.Match[str], tz: str) -> NDArray[np.int64]:
    """Return the instants of texts of one pattern; -1 for those that are not so simple."""
    year_to_day = [number_at(places, *span) for span in ((0, 4), (5, 7), (8, 10))]
    hour, minute = number_at(places, 11, 13), number_at(places, 14, 16)
    second = number_at(places, 17, 19) if found["second"] else np.zeros_like(hour)
    good = (hour < 24) & (minute < 60) & (second < 60)
    has_offset = found["offset"] is not None
    start_s, days_good = _days_s(*year_to_day, tz="" if has_offset else tz)
    seconds = start_s + hour * 3600 + minute * 60 + second
    if found["sign"]:
        sign_at = found.start("sign")
        hours = number_at(places, sign_at + 1, sign_at + 3)
        minutes = np.zeros_like(hours)
        if found["minutes"]:
            minutes = number_at(places, *found.span("minutes"))
        good &= (hours < 24) & (minutes < 60)
        offset_s = hours * 3600 + minutes * 60
        seconds += offset_s if found["sign"] == "-" else -offset_s
    good &= days_good & (seconds >= 0) & (seconds <= LAST_S)
    instants = np.where(good, seconds, 0) * SECOND_NS
    if found["fraction"]:
        digits = len(found["fraction"])
        instants += number_at(places, *found.span("fraction")) * 10 ** (9 - digits)
    return np.where(good, instants, -1)


def _days_s(
    year: NDArray[np.int64], month: NDArray[np.int64], day: NDArray[np.int64], *, tz: str
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return when days begin in a zone ("": UTC), seconds; and which are good for that."""
    dates = year * 10_000 + month * 100 + day
    # Times mostly come in order: a date comes again and again.
    starts = np.flatnonzero(np.diff(dates, prepend=-1))
    if len(starts) <= MOST_RUNS:
        different = dates[starts]
        which = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(dates)))
    else:
        different, which = np.unique(dates, return_inverse=True)
    found = [_start_s(date, tz) for date in different.tolist()]
    good = np.array([start is not None for start in found], np.bool_)
    return np.array([start or 0 for start in found], np.int64)[which], good[which]


@lru_cache(maxsize=8192)
def _start_s(date: int, tz: str) -> int | None:
    """Return when a day begins: seconds since 1970.

    None for what is no day, and for one on which the zone's clocks change.
    """
    try:
        start = datetime(date // 10_000, date // 100 % 100, date % 100)  # noqa: DTZ001 - a wall clock
        begins_s = (start - datetime(1970, 1, 1)).days * DAY_S  # noqa: DTZ001 - the same
        if not tz:
            return begins_s
        hours = [start + timedelta(hours=hour) for hour in range(25)]
        offsets = {offset for hour in hours for offset in wall_offsets_s(hour, tz)}
    except (ValueError, OverflowError):  # a MomentError is one
        return None
    return begins_s - offsets.pop() if len(offsets) == 1 else None
