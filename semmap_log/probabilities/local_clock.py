"""Instants as the building's clocks show them, many at once, daylight saving time included."""

from __future__ import annotations

from bisect import bisect_left
from datetime import datetime, timedelta, timezone

import numpy as np
from numpy.typing import NDArray

from semmap_log.moments import SECOND_NS, zone

Times = NDArray[np.int64]
HOUR_S, DAY_S, WEEK_S = 3_600, 86_400, 604_800
_MONDAY_S = 4 * DAY_S
"""1970-01-05, a Monday: weeks are counted from there."""


class LocalClock:
    """The wall clocks of an IANA time zone."""

    def __init__(self, tz: str) -> None:
        """Take a zone.

        Raises:
            MomentError: There is no such zone.
        """
        self.tz = tz
        self._zone = zone(tz)
        self._first_day, self._end_day = 0, 0
        self._starts_s = np.zeros(1, np.int64)
        self._offsets_s = np.zeros(1, np.int64)

    def wall_s(self, times_ns: Times) -> NDArray[np.float64]:
        """Return what the clocks show, as seconds since a Monday's midnight (1970-01-05)."""
        seconds, fraction_ns = np.divmod(np.asarray(times_ns, np.int64), SECOND_NS)
        return seconds + self.offset_s(seconds) - _MONDAY_S + fraction_ns / SECOND_NS

    def instants_ns(self, wall_s: NDArray[np.float64]) -> Times:
        """Return when the clocks show that: the first time of two, the time after a skip."""
        whole = np.floor(wall_s)
        shown_s = whole.astype(np.int64) + _MONDAY_S
        before, after = (self.offset_s(shown_s + step) for step in (-DAY_S, DAY_S))
        first_s, second_s = shown_s - before, shown_s - after
        is_second = (self.offset_s(first_s) != before) & (self.offset_s(second_s) == after)
        fraction_ns = np.round((wall_s - whole) * SECOND_NS).astype(np.int64)
        return np.where(is_second, second_s, first_s) * SECOND_NS + fraction_ns

    def midnights_ns(self, days: NDArray[np.int64]) -> Times:
        """Return when local days begin; days are counted from 1970-01-05, a Monday."""
        return self.instants_ns(np.asarray(days, np.float64) * DAY_S)

    def offset_s(self, seconds: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return how far the clocks are ahead of UTC at seconds since the epoch."""
        seconds = np.asarray(seconds, np.int64)
        if not seconds.size:
            return np.zeros(seconds.shape, np.int64)
        first, end = int(seconds.min()) // DAY_S, int(seconds.max()) // DAY_S + 1
        if first < self._first_day or end > self._end_day:
            self._look_up(first - _SPARE_DAYS, end + _SPARE_DAYS)
        return self._offsets_s[np.searchsorted(self._starts_s, seconds, "right") - 1]

    def _look_up(self, first_day: int, end_day: int) -> None:
        """Find where the offset changes between two days; what was found before is kept."""
        if self._end_day:
            first_day, end_day = min(first_day, self._first_day), max(end_day, self._end_day)
        starts, offsets = [first_day * DAY_S], [self._offset_at(first_day * DAY_S)]
        for day in range(first_day, end_day):
            end_s = (day + 1) * DAY_S
            while offsets[-1] != self._offset_at(end_s):
                change = bisect_left(
                    range(starts[-1] if day == first_day else day * DAY_S, end_s),
                    True,
                    key=lambda second: self._offset_at(second) != offsets[-1],
                )
                start_s = (starts[-1] if day == first_day else day * DAY_S) + change
                starts.append(start_s)
                offsets.append(self._offset_at(start_s))
        self._starts_s, self._offsets_s = np.array(starts), np.array(offsets)
        self._first_day, self._end_day = first_day, end_day

    def _offset_at(self, second: int) -> int:
        at = _EPOCH + timedelta(seconds=max(second, _LEAST_S))
        offset = at.astimezone(self._zone).utcoffset()
        assert offset is not None
        return round(offset.total_seconds())


_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
_LEAST_S = -10 * 365 * DAY_S
_SPARE_DAYS = 400
"""Looked up beside what is asked for, since more will be."""
