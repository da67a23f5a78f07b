"""Many times at once: a column of ISO-8601 texts as instants."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime, timedelta
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.moments import SECOND_NS, both_instants, wall_offsets_s
from semmap_log.errors import MomentError
from semmap_log.interop.formats.parsing.text_column import TextColumn, number_at

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
