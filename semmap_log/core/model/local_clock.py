"""Instants as the building's clocks show them, many at once, daylight saving time included."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta, timezone
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.moments import SECOND_NS, zone

Times = NDArray[np.int64]
HOUR_S, DAY_S, WEEK_S = 3_600, 86_400, 604_800
WORKING_DAYS, DAYS_IN_WEEK = 5, 7
_MONDAY_S = 4 * DAY_S
"""1970-01-05, a Monday: weeks are counted from there."""


class Hours(NamedTuple):
    """Time in pieces, through each of which the clocks show one hour of one day."""

    start_ns: Times
    """(n,), ascending."""
    end_ns: Times
    """(n,)."""
    hour: NDArray[np.int64]
    """(n,): what the clocks show, counted as by `LocalClock.hour_of`; not always ascending, and an
    hour that comes twice is there twice."""


class LocalClock:
    """The wall clocks of an IANA time zone."""

    def __init__(self, tz: str) -> None:
        """Take a zone.

        Raises:
            MomentError: There is no such zone.
        """
        zone(tz)
        self.tz = tz
        self._years = range(0)
        """Whose changes of the offset are known."""
        self._starts_s = np.zeros(0, np.int64)
        self._offsets_s = np.zeros(0, np.int64)

    def wall_s(self, times_ns: Times) -> NDArray[np.float64]:
        """Return what the clocks show, as seconds since a Monday's midnight (1970-01-05).

        As floats do, to less than a microsecond: a time just before an hour may be shown as the
        hour. `hour_of` is exact.
        """
        seconds, fraction_ns = np.divmod(np.asarray(times_ns, np.int64), SECOND_NS)
        return seconds + self.offset_s(seconds) - _MONDAY_S + fraction_ns / SECOND_NS

    def hour_of(self, times_ns: Times) -> NDArray[np.int64]:
        """Return the hour that the clocks show: 24 x day + hour, days as in `midnights_ns`."""
        seconds = np.asarray(times_ns, np.int64) // SECOND_NS
        hours: NDArray[np.int64] = (seconds + self.offset_s(seconds) - _MONDAY_S) // HOUR_S
        return hours

    def instants_ns(self, wall_s: NDArray[np.float64]) -> Times:
        """Return when the clocks show that: the first time of two; of none, when they skip it."""
        whole = np.floor(wall_s)
        shown_s = whole.astype(np.int64) + _MONDAY_S
        self._look_up(shown_s - DAY_S, shown_s + DAY_S)
        ends_s = np.append(self._starts_s[1:] + self._offsets_s[:-1], np.iinfo(np.int64).max)
        piece = np.searchsorted(np.maximum.accumulate(ends_s), shown_s, "right")
        seconds = shown_s - self._offsets_s[piece]
        starts_s = self._starts_s[piece]
        fraction_ns = np.round((wall_s - whole) * SECOND_NS).astype(np.int64)
        instants = np.maximum(seconds * SECOND_NS + fraction_ns, starts_s * SECOND_NS)
        return np.asarray(instants, np.int64)

    def midnights_ns(self, days: NDArray[np.int64]) -> Times:
        """Return when local days begin; days are counted from 1970-01-05, a Monday."""
        return self.instants_ns(np.asarray(days, np.float64) * DAY_S)

    def hours(self, first: int, end: int) -> Hours:
        """Return all the time in which the clocks show the hours `first` to before `end`."""
        edges_ns = self.instants_ns(np.array([first, end], np.float64) * HOUR_S)
        first_s, end_s = (edges_ns // SECOND_NS + (0, DAY_S)).tolist()  # they may be put back
        self._look_up(np.array([first_s]), np.array([end_s]))
        inside = (self._starts_s > first_s) & (self._starts_s < end_s)
        changes_s = [first_s, *self._starts_s[inside].tolist(), end_s]
        starts_s = np.concatenate([self._hour_starts_s(a, b) for a, b in pairwise(changes_s)])
        start_ns, end_ns = starts_s * SECOND_NS, np.append(starts_s[1:], end_s) * SECOND_NS
        hour = self.hour_of(start_ns)
        asked = (hour >= first) & (hour < end)
        return Hours(start_ns[asked], end_ns[asked], hour[asked])

    def _hour_starts_s(self, first_s: int, end_s: int) -> NDArray[np.int64]:
        """Return when hours begin in a time of one offset, its own beginning included."""
        shown_s = first_s + int(self.offset_s(np.array([first_s]))[0])
        next_s = first_s + HOUR_S - shown_s % HOUR_S
        return np.append(np.int64(first_s), np.arange(next_s, end_s, HOUR_S, dtype=np.int64))

    def offset_s(self, seconds: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return how far the clocks are ahead of UTC at seconds since the epoch."""
        seconds = np.asarray(seconds, np.int64)
        self._look_up(seconds, seconds)
        return self._offsets_s[np.searchsorted(self._starts_s, seconds, "right") - 1]

    def _look_up(self, first_s: NDArray[np.int64], last_s: NDArray[np.int64]) -> None:
        """Know the changes of the offset between some times; what is known stays so."""
        if not (first_s.size and last_s.size):
            first_s = last_s = np.zeros(1, np.int64)
        first, last = _year_of(int(first_s.min())), _year_of(int(last_s.max()))
        if first in self._years and last in self._years:
            return
        known = self._years or range(first, first + 1)
        self._years = range(min(first, known.start), max(last + 1, known.stop))
        found = [change for year in self._years for change in _changes(self.tz, year)]
        starts_s, offsets_s = np.array(found, np.int64).T
        is_change = np.append(True, np.diff(offsets_s) != 0)
        self._starts_s, self._offsets_s = starts_s[is_change], offsets_s[is_change]


_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
_LOOKS_S = 6 * DAY_S
"""A change and its way back in that time would stay unseen; since 1960 no zone's lie so near."""


def _year_of(second: int) -> int:
    return (_EPOCH + timedelta(seconds=second)).year


@lru_cache(maxsize=4096)
def _changes(tz: str, year: int) -> tuple[tuple[int, int], ...]:
    """Return (second, offset from then on) of the start of a UTC year, and of each change in it."""
    starts = [datetime(y, 1, 1, tzinfo=timezone.utc) for y in (year, year + 1)]
    first_s, end_s = (round((start - _EPOCH).total_seconds()) for start in starts)
    looks_s = [*range(first_s, end_s, _LOOKS_S), end_s]
    changes_s = [second for a, b in pairwise(looks_s) for second in _changes_in(tz, a, b)]
    return tuple((second, _offset_s(tz, second)) for second in (first_s, *changes_s))


def _changes_in(tz: str, first_s: int, end_s: int) -> Iterator[int]:
    """Yield when the offset changes, after `first_s` and up to `end_s`."""
    if _offset_s(tz, first_s) == _offset_s(tz, end_s):
        return
    if end_s - first_s == 1:
        yield end_s
        return
    middle_s = (first_s + end_s) // 2
    yield from _changes_in(tz, first_s, middle_s)
    yield from _changes_in(tz, middle_s, end_s)


def _offset_s(tz: str, second: int) -> int:
    offset = (_EPOCH + timedelta(seconds=second)).astimezone(zone(tz)).utcoffset()
    assert offset is not None, "a zone has one at any time"
    return round(offset.total_seconds())
