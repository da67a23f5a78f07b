"""Many times at once: a column of ISO-8601 texts as instants."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime, timedelta
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from semmap_log.errors import MomentError
from semmap_log.events import MAX_TIME_NS
from semmap_log.moments import SECOND_NS, both_instants, wall_offsets_s

DAY_US = 86_400_000_000
LAST_US = MAX_TIME_NS // 1000 - DAY_US
"""A day less than an int64 of nanoseconds holds: an offset cannot carry it over the end."""


def instants_of(
    texts: Sequence[str], *, tz: str
) -> tuple[NDArray[np.int64], NDArray[np.int64], dict[int, str]]:
    """Return what `both_instants` returns for each text, much faster.

    Returns:
        The first instants, the second ones (different in the hour that comes twice only), and
        for the texts that are no times (both 0) what is wrong with them.
    """
    first = np.zeros(len(texts), np.int64)
    second = np.zeros(len(texts), np.int64)
    wrong: dict[int, str] = {}
    wall_us = _wall_clock_us(texts)
    by_hand = np.ones(len(texts), np.bool_)
    if wall_us is not None:
        days, day_of = np.unique(wall_us // DAY_US, return_inverse=True)
        offsets = [_offset_s(int(day), tz) for day in days]
        even = np.array([offset is not None for offset in offsets], np.bool_)[day_of]
        offset_s = np.array([offset or 0 for offset in offsets], np.int64)[day_of]
        by_hand = ~even | (wall_us < DAY_US) | (wall_us > LAST_US)
        first[:] = np.where(by_hand, 0, wall_us * 1000 - offset_s * SECOND_NS)
        second[:] = first
    for index in np.flatnonzero(by_hand).tolist():
        try:
            first[index], second[index] = both_instants(texts[index], tz=tz)
        except MomentError as error:  # noqa: PERF203 - few rows come here
            wrong[index] = str(error)
    return first, second, wrong


_WALL_CLOCK = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d{1,6})?", re.ASCII)


def _wall_clock_us(texts: Sequence[str]) -> NDArray[np.int64] | None:
    """Return the microseconds since 1970 that wall clocks show; None if not all texts are such."""
    # numpy alone would read `now` and `2015`, too.
    if not all(map(_WALL_CLOCK.fullmatch, texts)):
        return None
    try:
        return np.array(texts, dtype="datetime64[us]").astype(np.int64)
    except ValueError:
        return None


@lru_cache(maxsize=8192)
def _offset_s(day: int, tz: str) -> int | None:
    """Return the zone's offset on that day since 1970; None where it is not the same all day."""
    if not 0 <= day <= LAST_US // DAY_US:
        return None
    start = datetime(1970, 1, 1) + timedelta(days=day)  # noqa: DTZ001 - a wall clock
    hours = [start + timedelta(hours=hour) for hour in range(25)]
    try:
        offsets = {offset for hour in hours for offset in wall_offsets_s(hour, tz)}
    except MomentError:
        return None
    return offsets.pop() if len(offsets) == 1 else None
