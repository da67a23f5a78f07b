"""Instants as the building's clocks show them, many at once, daylight saving time included.

Also what a time means that a caller of Python gives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import date, datetime, timedelta, timezone
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.events import is_whole_number
from semmap_log.core.model.moments import INSTANTS, SECOND_NS, Moment, parse_moment, zone
from semmap_log.errors import MomentError

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


Time = int | str | date | np.datetime64 | Moment | None
"""Nanoseconds UTC, a text as on the command line (`2026-03-01T14:02`, `2h ago`, `event:12`), a
datetime, date or pandas Timestamp (without a zone it is in the log's), a numpy.datetime64 (UTC), or
what `moment` made of one."""


NUMBER_UNITS = {"seconds": 10**9, "milliseconds": 10**12, "microseconds": 10**15}
"""What a number may be of instead, from 2001 to 2286, from so many on to ten times as many."""


def moment_of(
    time: Time,
    *,
    tz: str,
    end_ns: Callable[[], int],
    last_ns: Callable[[], int] | None = None,
) -> Moment:
    """Return what a time means in a log.

    Args:
        time: A moment in any of its forms.
        tz: The log's zone.
        end_ns: Returns what `now` is, and `2h ago` counts from; called only where that matters.
        last_ns: Returns up to when `14:02` is the last one; default: `end_ns`.

    Raises:
        MomentError: It cannot be read.
    """
    if time is None:
        return Moment()
    if isinstance(time, Moment):
        return time
    if isinstance(time, date):
        time = time.isoformat()
    elif isinstance(time, np.datetime64):
        time = int(time.astype("datetime64[ns]").astype(np.int64))
    if isinstance(time, str):
        return parse_moment(time, tz=tz, end_ns=end_ns, last_ns=last_ns)
    if not is_whole_number(time):
        raise MomentError(
            f"expected a time as whole nanoseconds since 1970, a text such as {INSTANTS}, or a "
            f"datetime; got {time!r}."
        )
    return Moment(ns=int(time))


def check_time_unit(time: int, first_ns: Callable[[], int | None]) -> None:
    """Refuse a number that would be in January 1970 as nanoseconds, in a log that begins later.

    Args:
        time: Nanoseconds.
        first_ns: Returns when the log begins; called only for a number of that time.

    Raises:
        MomentError: It is one, and says which unit it may be of.
    """
    for unit, least in NUMBER_UNITS.items():
        if least <= time < 10 * least and (first_ns() or 0) > 100 * NUMBER_UNITS["microseconds"]:
            factor = 10**18 // least
            raise MomentError(
                f"expected a time as whole nanoseconds since 1970, got {time}, which looks like "
                f"{unit}; multiply by {factor:_}."
            )


def happened_ns_of(time: Time, *, tz: str, now_ns: int) -> int | None:
    """Return the happened time that a caller gives; None: none is given.

    Args:
        time: A moment in any of its forms, but for the number of an event.
        tz: The log's zone.
        now_ns: What `now` is, and `2h ago` counts from.

    Raises:
        MomentError: It cannot be read, or is the number of an event.
    """
    moment = moment_of(time, tz=tz, end_ns=lambda: now_ns)
    if moment.event is not None:
        raise MomentError(
            f"expected when it happened, a time such as {INSTANTS}; got the number of event "
            f"{moment.event}; `show` prints its time."
        )
    return moment.ns
